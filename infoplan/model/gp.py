"""Gaussian process regression as a mission uses it: scaled data, kept hyperparameters."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from infoplan.errors import RunError
from infoplan.model.likelihood import Likelihood
from infoplan.model.optimize import Adam, Lbfgs, bounds


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters in scaled units.

    Parameters
    ----------
    amplitude : float
        alpha, not its square.
    lengthscale_1, lengthscale_2 : float
        Of the first and second input dimension.
    noise_std : float
        sigma, without the jitter.
    """

    amplitude: float
    lengthscale_1: float
    lengthscale_2: float
    noise_std: float


class GaussianProcess:
    """Zero-mean Gaussian process with the anisotropic Gaussian kernel and Gaussian noise.

    The pilot data are the first data of the model and fix the scalers: inputs go to [-1, 1] by
    the pilot's bounding box, observations to zero mean and unit (population) standard deviation.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    amplitude : float
        First alpha.
    lengthscale : float
        First lengthscale of both dimensions.
    noise_variance : float
        First sigma^2.
    jitter : float
        Added to sigma^2 in every factorisation. One that fails is repeated with ten times the
        jitter until it succeeds, or the jitter exceeds all variances; the next starts from this
        value again.
    min_noise_variance : float
        Floor of the learned sigma^2.
    optimizer : {"adam", "lbfgs"}
        How the log marginal likelihood is maximised.
    learning_rate : float
        Adam's step on the logarithms of the hyperparameters.
    dtype : {"float64", "float32"}
        Precision of kernel matrices, factorisations and solves.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers: no extent, equal, non-finite or huge values. All that
        computes with the covariance raises it, too, if that cannot be factorised.
    """

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        *,
        amplitude: float = 1.0,
        lengthscale: float = 0.5,
        noise_variance: float = 1.0,
        jitter: float = 1e-6,
        min_noise_variance: float = 1e-4,
        optimizer: str = "adam",
        learning_rate: float = 0.01,
        dtype: str = "float64",
    ) -> None:
        self._set_up(
            Likelihood(jitter, dtype),
            x_pilot,
            y_pilot,
            [amplitude, lengthscale, lengthscale, noise_variance],
            min_noise_variance,
            optimizer,
            learning_rate,
        )

    def _set_up(
        self,
        likelihood: Any,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        start: list[float],
        min_noise_variance: float,
        optimizer: str,
        learning_rate: float,
    ) -> None:
        """Fit the scalers and take the pilot; any likelihood with the public face of `Likelihood`.

        `start` are the first alpha, both lengthscales and sigma^2.
        """
        x, y = _checked(x_pilot, y_pilot)
        if not (y.size and np.ptp(x[:, 0]) > 0.0 and np.ptp(x[:, 1]) > 0.0):
            raise RunError(
                "The pilot samples span no area, and their bounding box scales the model's "
                "inputs: use a pilot path with an extent along both axes."
            )
        if not np.ptp(y) > 0.0:
            raise RunError(
                "The pilot's measurements are all equal, and their standard deviation scales the "
                "model: use a pilot path over varying terrain, or a sensor noise above zero."
            )
        self._x_low = x.min(axis=0)
        self._x_extent = np.ptp(x, axis=0)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            self._y_mean = float(y.mean())
            self._y_std = float(y.std())
        if not (np.isfinite(self._y_mean) and 0.0 < self._y_std < np.inf):
            raise RunError(
                f"The pilot's measurements, {y.min():.3g} to {y.max():.3g}, differ by too much or "
                "too little for a standard deviation, which scales the model: use another unit."
            )
        self._lower, self._upper = bounds(min_noise_variance)
        self._theta = np.log(np.maximum(start, 1e-20))
        self._optimizer = Adam(learning_rate) if optimizer == "adam" else Lbfgs()
        self._likelihood = likelihood
        self.replace(x, y)

    @property
    def hyperparameters(self) -> Hyperparameters:
        """The present hyperparameters, scaled units."""
        amplitude, lengthscale_1, lengthscale_2, noise_variance = np.exp(self._theta).tolist()
        return Hyperparameters(amplitude, lengthscale_1, lengthscale_2, noise_variance**0.5)

    @property
    def observation_noise_std(self) -> float:
        """The learned sigma in the unit of the measurements."""
        return self._y_std * self.hyperparameters.noise_std

    @property
    def jitter(self) -> float:
        """The jitter that the last factorisation used, scaled units squared."""
        return self._likelihood.jitter

    @property
    def log_marginal_likelihood(self) -> float:
        """Of the present data and hyperparameters, in nats, scaled units."""
        return self._likelihood.value(self._theta)

    @property
    def n_data(self) -> int:
        """Number of data in the model."""
        return self._y.size

    def append(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add data.

        Parameters
        ----------
        x : array_like of shape (n, 2)
            Positions, workspace units.
        y : array_like of shape (n,)
            Measurements; n may be 0.

        Raises
        ------
        RunError
            If a value is not finite.
        """
        x, y = _checked(x, y)
        self.replace(np.concatenate([self._x, x]), np.concatenate([self._y, y]))

    def replace(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take these data in place of the present ones; scalers and hyperparameters stay.

        Parameters
        ----------
        x : array_like of shape (n, 2)
            Positions, workspace units.
        y : array_like of shape (n,)
            Measurements; n may be 0.

        Raises
        ------
        RunError
            If a value is not finite.
        """
        self._x, self._y = _checked(x, y)
        self._likelihood.set_data(self._scaled(self._x), (self._y - self._y_mean) / self._y_std)

    def optimize(self, iterations: int) -> None:
        """Climb the log marginal likelihood from the present hyperparameters.

        Parameters
        ----------
        iterations : int
            Adam: the number of gradient evaluations and steps. L-BFGS: the most evaluations.
            Hyperparameters that would not be finite are never taken.
        """
        self._theta = self._optimizer.ascend(
            self._likelihood.value_and_gradient, self._theta, iterations, self._lower, self._upper
        )

    def predict(self, x: np.ndarray, *, noisy: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and standard deviation.

        Parameters
        ----------
        x : array_like of shape (m, 2)
            Query positions, workspace units.
        noisy : bool
            Add sigma^2 to the latent variance (the jitter is never added).

        Returns
        -------
        mean, std : ndarrays of shape (m,)
            In the unit of the measurements. The latent variance is at least alpha^2 times the
            machine epsilon of the dtype.
        """
        mean, variance = self._likelihood.predict(self._theta, self._scaled(np.asarray(x, float)))
        if noisy:
            variance += self._noise_variance()
        return self._y_mean + self._y_std * mean, self._y_std * np.sqrt(variance)

    def weights_and_inverse(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Condition on other data under the present hyperparameters; the model stays as it is.

        What leave-one-out predictions in closed form need (Rasmussen & Williams, eq. 5.12): the
        residual of datum i is w_i / P_ii, its variance 1 / P_ii, in scaled units.

        Parameters
        ----------
        x : array_like of shape (n, 2)
            Positions, workspace units.
        y : array_like of shape (n,)
            Measurements.

        Returns
        -------
        weights : ndarray of shape (n,)
            w = K_y^-1 y, scaled units.
        inverse : ndarray of shape (n, n)
            P = K_y^-1, with the variance of the observation noise and the jitter in K_y.

        Raises
        ------
        RunError
            If a value is not finite.
        """
        x, y = _checked(x, y)
        likelihood = Likelihood(self.jitter)
        likelihood.set_data(self._scaled(x), (y - self._y_mean) / self._y_std)
        theta = np.append(self._theta[:3], np.log(self._noise_variance()))
        return likelihood.weights_and_inverse(theta)

    def _noise_variance(self) -> float:
        """Variance of the observation noise, scaled units."""
        return float(np.exp(self._theta[3]))

    def _scaled(self, x: np.ndarray) -> np.ndarray:
        """Return inputs in units of the pilot's bounding box, shape (2, n)."""
        return np.ascontiguousarray((2.0 * ((x - self._x_low) / self._x_extent) - 1.0).T)


def _checked(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Copy data to float arrays of shapes (n, 2) and (n,); refuse values that are not finite."""
    x = np.array(x, dtype=float).reshape(-1, 2)
    y = np.array(y, dtype=float).reshape(-1)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RunError("The model was given positions or measurements that are not finite numbers.")
    return x, y
