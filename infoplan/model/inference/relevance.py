"""Inference under Gaussian noise with a further variance for those data that need one.

Ament et al. (2024), "Robust Gaussian Processes via Relevance Pursuit". Datum i has the noise
variance sigma^2 + rho_i; rho_i is above 0 for the data of the support alone. Under given
hyperparameters the support grows through given sizes by the data whose rho, alone, would be
largest, all rho are set to the maximum of the likelihood at each size, and of the sizes the most
probable is taken.
"""

from collections.abc import Sequence

import numpy as np

from infoplan.model.inference.noisy import Noisy, factorise
from infoplan.model.inference.pursuit import pursue
from infoplan.model.kernel import Kernel
from infoplan.model.theta import noise_variance_of


class RelevanceInference:
    """Log marginal likelihood of some data, its gradient and the predictive distribution.

    All are functions of theta (`infoplan.model.theta`) at the rho that pursuit finds under it.

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    jitter : float
        Added to the noise variances, ten times as much whenever a factorisation fails.
    fractions : sequence of float
        Sizes of the support that are compared, as shares of the data.
    outlier_fraction : float
        Mean of the exponential prior on the size, as a share of the data.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    """

    def __init__(
        self, kernel: Kernel, jitter: float, *, fractions: Sequence[float], outlier_fraction: float
    ) -> None:
        self._kernel = kernel
        self.jitter = jitter
        self._configured_jitter = jitter
        self._fractions, self._outlier_fraction = sorted(fractions), outlier_fraction
        self._x, self._y = np.empty((2, 0)), np.empty(0)
        self._noisy: Noisy | None = None

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data.

        Parameters
        ----------
        x : ndarray of shape (2, n)
            Scaled inputs, finite.
        y : ndarray of shape (n,)
            Scaled observations, finite.
        """
        self._x, self._y, self._noisy = x, y, None

    def lml(self, theta: np.ndarray) -> float:
        """Log marginal likelihood.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        float
            In nats; 0 without data.
        """
        return self._likelihood(self._pursued(theta))

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Log marginal likelihood and its gradient.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        value : float
            In nats.
        gradient : ndarray of shape (k,)
            Its derivatives by theta. As each rho is at its maximum, or at its bound 0, they are
            those at a fixed rho.
        """
        if not self._y.size:
            return 0.0, np.zeros_like(theta)
        noisy = self._pursued(theta)
        weights = noisy.solve(self._y)
        slope = np.outer(weights, weights) - noisy.inverse()
        by_noise = 0.5 * noise_variance_of(theta) * float(slope.trace())
        return self._likelihood(noisy), noisy.gradient(slope, by_noise)

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance.

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
        noisy = self._pursued(theta)
        return noisy.predict(noisy.solve(self._y), x)

    def _likelihood(self, noisy: Noisy) -> float:
        with np.errstate(over="ignore"):  # huge data: minus infinity, which no optimiser takes
            misfit = float(self._y @ noisy.solve(self._y))
        return -0.5 * (misfit + noisy.log_determinant() + self._y.size * float(np.log(2.0 * np.pi)))

    def _pursued(self, theta: np.ndarray) -> Noisy:
        """Return the factorised covariance of the data with the rho found under theta."""
        if self._noisy is None or not np.array_equal(theta, self._noisy.theta):
            self._noisy = None  # its memory serves the next
            n = self._y.size
            noise = np.full(n, noise_variance_of(theta))
            first = self._factorise(theta, noise)
            sizes = sorted({int(fraction * n) for fraction in self._fractions} - {0})
            rho = pursue(first.inverse(), self._y, sizes, self._outlier_fraction * n)
            self._noisy = self._factorise(theta, noise + rho) if rho.any() else first
            self.jitter = self._noisy.jitter
        return self._noisy

    def _factorise(self, theta: np.ndarray, noise: np.ndarray) -> Noisy:
        return factorise(
            self._kernel, theta, self._x, noise, self._configured_jitter,
            "process of relevance pursuit",
        )  # fmt: skip
