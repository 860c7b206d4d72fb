"""Robust and conjugate inference: a generalised posterior in closed form, by weighted data.

Altamirano, Briol and Knoblauch (2024), "Robust and Conjugate Gaussian Process Regression". Datum
i has the inverse multiquadric weight w_i = beta / sqrt(1 + r_i^2 / c^2) of its distance r_i from a
centre, with beta = sigma / sqrt(2) as they choose it, so that data at the centre count as under
Gaussian noise. The posterior (their Proposition 3.1) is that of a Gaussian process whose datum has
the noise variance sigma^2 v, v = 1 + r^2 / c^2, and the value y - sigma^2 d log(w^2) / dy.
"""

import numpy as np

from infoplan.model.inference.noisy import Noisy, factorise
from infoplan.model.kernel import Kernel
from infoplan.model.theta import noise_variance_of

# Data whose distances from all others are looked at together.
_BLOCK = 256
# Below it the threshold would make the weights of equal data meaningless.
_SMALLEST_THRESHOLD = 1e-6


class RobustConjugateInference:
    """A leave-one-out criterion of some data, its gradient and the predictive distribution.

    All are functions of theta (`infoplan.model.theta`).

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    jitter : float
        Added to the noise variances, ten times as much whenever a factorisation fails.
    outlier_fraction : float
        The threshold c is the quantile of the distances |r_i| that so many exceed.
    neighbours : int or None
        Centre of a datum: the median of so many nearest others; None: the prior mean, 0.
    weighted : bool
        Whether a datum counts by w_i^2 / beta^2 in the criterion.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    """

    def __init__(
        self,
        kernel: Kernel,
        jitter: float,
        *,
        outlier_fraction: float,
        neighbours: int | None,
        weighted: bool,
    ) -> None:
        self._kernel = kernel
        self.jitter = jitter
        self._configured_jitter = jitter
        self._outlier_fraction, self._neighbours = outlier_fraction, neighbours
        self._weighted = weighted
        self._x, self._y = np.empty((2, 0)), np.empty(0)
        self._inflation = self._pull = self._y
        self._noisy: Noisy | None = None

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data, and weigh them.

        Parameters
        ----------
        x : ndarray of shape (2, n)
            Scaled inputs, finite.
        y : ndarray of shape (n,)
            Scaled observations, finite.
        """
        self._x, self._y, self._noisy = x, y, None
        distance = y - (0.0 if self._neighbours is None else medians(x, y, self._neighbours))
        self._inflation, self._pull = weigh(distance, self._outlier_fraction)

    def lml(self, theta: np.ndarray) -> float:
        """Leave-one-out log predictive density, in place of a marginal likelihood.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        float
            In nats; 0 without data.
        """
        noisy = self._factorise(theta)
        error, variance, _, _ = self._leave_one_out(noisy, noisy.inverse())
        return self._criterion(error, variance)

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Leave-one-out log predictive density and its gradient.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        value : float
            In nats.
        gradient : ndarray of shape (k,)
            Its derivatives by theta.
        """
        if not self._y.size:
            return 0.0, np.zeros_like(theta)
        noisy, noise = self._factorise(theta), noise_variance_of(theta)
        inverse = noisy.inverse()
        error, variance, weights, precision = self._leave_one_out(noisy, inverse)
        share = self._share()
        by_error = -share * error / variance
        by_variance = 0.5 * share * ((error / variance) ** 2 - 1.0 / variance)
        # Through the weights b = A^-1 y and the diagonal of A^-1, d(A^-1) = -A^-1 dA A^-1.
        by_precision = -(by_error * weights + by_variance) / precision**2
        moved = inverse @ (by_error / precision)
        slope = (-2.0 * inverse * by_precision) @ inverse
        slope -= np.outer(moved, weights)
        slope -= np.outer(weights, moved)
        by_noise = noise * (
            0.5 * slope.diagonal() @ self._inflation
            + (moved - by_error) @ self._pull
            - by_variance @ (self._inflation - 1.0)
        )
        return self._criterion(error, variance), noisy.gradient(slope, float(by_noise))

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and latent variance of the generalised posterior.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        x : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        mean, variance : ndarrays of shape (m,)
            In scaled units; the variance is at least alpha^2 times the machine epsilon.
        """
        noisy = self._factorise(theta)
        return noisy.predict(noisy.solve(self._targets(theta)), x)

    def _factorise(self, theta: np.ndarray) -> Noisy:
        """Return the factorised covariance of the data under some hyperparameters."""
        if self._noisy is None or not np.array_equal(theta, self._noisy.theta):
            self._noisy = None  # its memory serves the next
            noise = noise_variance_of(theta) * self._inflation
            self._noisy = factorise(
                self._kernel, theta, self._x, noise, self._configured_jitter,
                "robust conjugate Gaussian process",
            )  # fmt: skip
            self.jitter = self._noisy.jitter
        return self._noisy

    def _targets(self, theta: np.ndarray) -> np.ndarray:
        """Values that the posterior is conditioned on."""
        return self._y + noise_variance_of(theta) * self._pull

    def _leave_one_out(
        self, noisy: Noisy, inverse: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Predict each datum from the others (their eq. for the leave-one-out criterion).

        Returns
        -------
        error, variance : ndarrays of shape (n,)
            Of the prediction with Gaussian noise; the first is observation less mean.
        weights, precision : ndarrays of shape (n,)
            A^-1 times the values conditioned on, and the diagonal of A^-1.
        """
        noise, precision = noise_variance_of(noisy.theta), inverse.diagonal()
        weights = noisy.solve(self._targets(noisy.theta))
        error = weights / precision - noise * self._pull
        variance = 1.0 / precision - noise * (self._inflation - 1.0)
        return error, variance, weights, precision

    def _share(self) -> np.ndarray:
        """How much each datum counts in the criterion."""
        return 1.0 / self._inflation if self._weighted else np.ones_like(self._inflation)

    def _criterion(self, error: np.ndarray, variance: np.ndarray) -> float:
        density = -0.5 * (np.log(2.0 * np.pi * variance) + error**2 / variance)
        return float(self._share() @ density)


def weigh(distance: np.ndarray, outlier_fraction: float) -> tuple[np.ndarray, np.ndarray]:
    """Weigh data by their distances from the centre.

    Parameters
    ----------
    distance : ndarray of shape (n,)
        r, signed.
    outlier_fraction : float
        The threshold c is the quantile of |r| that so many exceed.

    Returns
    -------
    inflation : ndarray of shape (n,)
        v = 1 + r^2 / c^2, the noise variance over sigma^2.
    pull : ndarray of shape (n,)
        -d log(w^2) / dy = 2 r / (c^2 + r^2).
    """
    if not distance.size:
        return distance, distance
    threshold = float(np.quantile(np.abs(distance), 1.0 - outlier_fraction))
    square = max(threshold, _SMALLEST_THRESHOLD) ** 2
    return 1.0 + distance**2 / square, 2.0 * distance / (square + distance**2)


def medians(x: np.ndarray, y: np.ndarray, count: int) -> np.ndarray:
    """Median of the observations nearest to each datum.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Inputs.
    y : ndarray of shape (n,)
        Observations.
    count : int
        How many others; more where they are equally near, all where there are fewer.

    Returns
    -------
    ndarray of shape (n,)
        0, the prior mean, for a lone datum.
    """
    n = y.size
    found = np.zeros(n)
    for start in range(0, n if n > 1 else 0, _BLOCK):
        own = np.arange(start, min(start + _BLOCK, n))
        squares = (x[0, own, None] - x[0]) ** 2 + (x[1, own, None] - x[1]) ** 2
        squares[own - start, own] = np.inf
        reach = np.partition(squares, min(count, n - 1) - 1, axis=1)[:, min(count, n - 1) - 1]
        for row, number in enumerate(own):
            found[number] = np.median(y[squares[row] <= reach[row]])
    return found
