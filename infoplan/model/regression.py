"""Regression with a Gaussian process as a mission uses it: scaled data, kept hyperparameters."""

from types import SimpleNamespace
from typing import Protocol

import numpy as np

from infoplan.model.inference.exact import ExactInference
from infoplan.model.kernel import Kernel
from infoplan.model.optimizers import Adam, Lbfgs
from infoplan.model.scaling import Scaler, checked
from infoplan.model.theta import (
    bounds_of,
    hyperparameters_of,
    noise_variance_of,
    with_noise_variance,
)


class Inference(Protocol):
    """What the regression needs of `ExactInference` and its likes."""

    jitter: float

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data."""

    def lml(self, theta: np.ndarray) -> float:
        """Log marginal likelihood."""
        ...

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Log marginal likelihood and its gradient."""
        ...

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance."""
        ...


class Regression:
    """A zero-mean Gaussian process, its data and its hyperparameters.

    The pilot data are the first data of the model and fix the scalers.

    Parameters
    ----------
    inference : Inference
        How the data are conditioned on.
    kernel : Kernel
        That of the inference.
    theta : ndarray of shape (k,)
        First log hyperparameters.
    x_pilot, y_pilot
        Data, as for `GaussianProcess`.
    min_noise_variance, optimizer, learning_rate
        As for `GaussianProcess`.
    noise_factor : float
        Variance of the observation noise over sigma^2.
    """

    def __init__(
        self,
        inference: Inference,
        kernel: Kernel,
        theta: np.ndarray,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        *,
        min_noise_variance: float,
        optimizer: str,
        learning_rate: float,
        noise_factor: float = 1.0,
    ) -> None:
        x, y = checked(x_pilot, y_pilot)
        self._scaler = Scaler.of_pilot(x, y)
        self._inference, self._kernel, self._theta = inference, kernel, theta
        self._bounds = bounds_of(kernel, min_noise_variance)
        self._optimizer = Adam(learning_rate) if optimizer == "adam" else Lbfgs()
        self._noise_factor = noise_factor
        self.replace(x, y)

    @property
    def hyperparameters(self) -> SimpleNamespace:
        """The present hyperparameters, scaled units: `amplitude`, the kernel's, `noise_std`."""
        return hyperparameters_of(self._kernel, self._theta)

    @property
    def observation_noise_std(self) -> float:
        """Standard deviation of the learned noise in the unit of the measurements."""
        sigma = float(self.hyperparameters.noise_std)
        return float(self._noise_factor**0.5 * (self._scaler.y_std * sigma))

    @property
    def jitter(self) -> float:
        """The jitter that the last factorisation used, scaled units squared."""
        return self._inference.jitter

    @property
    def log_marginal_likelihood(self) -> float:
        """Of the present data and hyperparameters, in nats, scaled units."""
        return self._inference.lml(self._theta)

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
        x, y = checked(x, y)
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
        self._x, self._y = checked(x, y)
        self._inference.set_data(self._scaler.inputs(self._x), self._scaler.outputs(self._y))

    def optimize(self, iterations: int) -> None:
        """Climb the log marginal likelihood from the present hyperparameters.

        Parameters
        ----------
        iterations : int
            Adam: the number of gradient evaluations and steps. L-BFGS: the most evaluations.
            Hyperparameters that would not be finite are never taken.
        """
        self._theta = self._optimizer.ascend(
            self._inference.lml_and_gradient, self._theta, iterations, self._bounds
        )

    def adopt(self, other: "Regression") -> None:
        """Take the hyperparameters of another model of this kind; data and scalers stay."""
        self._theta = other._theta.copy()

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
        mean, variance = self._inference.predict(
            self._theta, self._scaler.inputs(np.asarray(x, float))
        )
        if noisy:
            variance += self._noise_variance()
        y_mean, y_std = self._scaler.y_mean, self._scaler.y_std
        return y_mean + y_std * mean, y_std * np.sqrt(variance)

    def weights_and_inverse(
        self, x: np.ndarray, y: np.ndarray, chosen: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Condition on other data under the present hyperparameters; the model stays as it is.

        What leave-one-out predictions in closed form need (Rasmussen & Williams, eq. 5.12): the
        residual of datum i is w_i / P_ii, its variance 1 / P_ii, in scaled units.

        Parameters
        ----------
        x : array_like of shape (n, 2)
            Positions, workspace units.
        y : array_like of shape (n,)
            Measurements.
        chosen : ndarray of int, shape (c,)
            Numbers of the data that are asked for.

        Returns
        -------
        weights : ndarray of shape (c,)
            Theirs of w = K_y^-1 y, scaled units.
        inverse : ndarray of shape (c, c)
            Theirs of P = K_y^-1, with the variance of the observation noise and the jitter in K_y.

        Raises
        ------
        RunError
            If a value is not finite.
        """
        x, y = checked(x, y)
        inference = ExactInference(self._kernel, self.jitter)
        inference.set_data(self._scaler.inputs(x), self._scaler.outputs(y))
        weights, inverse = inference.weights_and_inverse(
            with_noise_variance(self._theta, self._noise_variance())
        )
        return weights[chosen], inverse[np.ix_(chosen, chosen)]

    def _noise_variance(self) -> float:
        """Variance of the observation noise, scaled units."""
        return self._noise_factor * noise_variance_of(self._theta)
