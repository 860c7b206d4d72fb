"""Regression with a Gaussian process as a mission uses it: scaled data, kept hyperparameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Protocol

import numpy as np

from infoplan.model.inference.exact import ExactInference
from infoplan.model.kernel import Kernel
from infoplan.model.optimizers import Adam, Lbfgs, maximise, optimizer_of, steepest
from infoplan.model.prior import Prior
from infoplan.model.scaling import Scaler, checked
from infoplan.model.theta import (
    bounds_of,
    first_theta,
    hyperparameters_of,
    lengthscale_floors,
    noise_variance_of,
    theta_of,
    with_noise_variance,
)

# How far restarts may lie from the first logarithms.
_RESTART = float(np.log(10.0))
# A refit climbs on about so many of the data first.
_THINNED = 600
# Ends whose logarithms differ by less are the same.
_SAME = 0.05
# Nats by which two ends may differ and be one optimum, and the steepest slope at one.
_LEVEL, _FLAT = 0.1, 0.1
# How often a climb is repeated where taking its end changes what is maximised.
_ROUNDS = 5


@dataclass(frozen=True)
class Refit:
    """What came of a refit (`Regression.refit`).

    Attributes
    ----------
    gain : float
        Nats by which what is maximised lies above its value before.
    slope : float
        Largest derivative by a logarithm at the end, those against a bound left out, in nats.
    converged : bool
        Whether that slope is at most 0.1.
    agreeing : int
        How many of the starts led to within 0.1 nats of the end, itself included.
    starts : int
        How many there were.
    """

    gain: float
    slope: float
    converged: bool
    agreeing: int
    starts: int


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


class JointInference(Inference, Protocol):
    """An inference that tells the joint distribution of what it predicts."""

    def covariance(self, theta: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance of the latent function."""
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
    min_noise_variance : float
        Floor of the learned sigma^2.
    optimizer : {"adam", "lbfgs"}
        How the log marginal likelihood is maximised.
    learning_rate : float
        Adam's step on the logarithms of the hyperparameters.
    min_lengthscale : float
        Floor of the kernel's `lengthscale_1` and `lengthscale_2`, from the start on, in `spacing`;
        0: none.
    spacing : float
        Distance of two successive samples, workspace units.
    lengthscale_prior, noise_prior : (float, float) or None
        Median, and standard deviation of the logarithm, of a log-normal prior of every lengthscale
        and of sigma^2, scaled units: what is maximised is the likelihood times these; None: none.
    noise_start : {"carried", "restarted"}
        Where sigma^2 starts in every `optimize`: as it is, or at its first value.
    optimizer_state : {"carried", "reset"}
        Whether the optimiser remembers the calls before (`Adam.reset`, `Lbfgs.reset`).
    restarts : int
        Further starts of every `optimize`, of which the best end is taken. Restart r of call c
        (both from 0) starts at the first hyperparameters, each times a factor that is log-uniform
        in [0.1, 10], drawn by ``numpy.random.default_rng([c, r])``, with a fresh optimiser.
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
        min_lengthscale: float = 0.0,
        spacing: float = 1.0,
        lengthscale_prior: Sequence[float] | None = None,
        noise_prior: Sequence[float] | None = None,
        noise_start: str = "carried",
        optimizer_state: str = "carried",
        restarts: int = 0,
        noise_factor: float = 1.0,
    ) -> None:
        x, y = checked(x_pilot, y_pilot)
        self._scaler = Scaler.of_pilot(x, y)
        shortest = 2.0 * min_lengthscale * spacing / self._scaler.x_extent
        floors = lengthscale_floors(kernel, shortest)
        self._inference, self._kernel = inference, kernel
        self._theta = self._first = np.maximum(theta, floors)
        self._bounds = bounds_of(kernel, min_noise_variance, floors)
        self._prior = Prior(kernel, lengthscale_prior, noise_prior)
        self._has_prior = lengthscale_prior is not None or noise_prior is not None
        self._new_optimizer = partial(optimizer_of, optimizer, learning_rate)
        self._optimizer: Adam | Lbfgs = self._new_optimizer()
        self._starts_noise_anew = noise_start == "restarted"
        self._forgets = optimizer_state == "reset"
        self._restarts, self._calls = restarts, 0
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
        """Climb the log marginal likelihood, times the priors, from the present hyperparameters.

        Parameters
        ----------
        iterations : int
            Adam: the number of gradient evaluations and steps. L-BFGS: the most evaluations.
            Hyperparameters that would not be finite are never taken. Every restart gets as many.
        """
        if self._starts_noise_anew and iterations:
            start = with_noise_variance(self._theta, noise_variance_of(self._first))
            self._theta = np.clip(start, self._bounds.lower, self._bounds.upper)
        if self._forgets:
            self._optimizer.reset()
        self._theta = self._optimizer.ascend(
            self._value_and_gradient, self._theta, iterations, self._bounds
        )
        if self._restarts and iterations:
            self._restart(iterations)
        self._calls += 1

    def _restart(self, iterations: int) -> None:
        """Climb from other starts, too, and go on from the best end."""
        best = self._value(self._theta)
        for number in range(self._restarts):
            rng = np.random.default_rng([self._calls, number])
            start = self._first + rng.uniform(-_RESTART, _RESTART, self._first.shape)
            start = np.clip(start, self._bounds.lower, self._bounds.upper)
            optimizer = self._new_optimizer()
            end = optimizer.ascend(self._value_and_gradient, start, iterations, self._bounds)
            if (value := self._value(end)) > best:
                best, self._theta, self._optimizer = value, end, optimizer

    def refit(self, others: Sequence[Mapping[str, float]] = ()) -> Refit:
        """Take the hyperparameters at the highest optimum of what `optimize` climbs.

        L-BFGS-B runs to its end from the present hyperparameters, from others, from long
        lengthscales (half the pilot's box, amplitude and noise 1), and from little noise (a
        quarter of the box, amplitude 1, noise variance 0.01): on every so manyth datum first, about
        600, then on all from each end that differs. From middle lengthscales, an eighth of the box,
        it runs on all data at once: thinned data may lead past an optimum there. The highest end
        counts.

        Parameters
        ----------
        others : sequence of mappings
            Further starts, as for `recall`.
        """
        before = self._value(self._theta)
        long, quiet, middle = (
            first_theta(self._kernel, 1.0, length, noise)
            for length, noise in ((1.0, 1.0), (0.5, 0.01), (0.25, 1.0))
        )
        told = [theta_of(self._kernel, other) for other in others]
        starts = [self._theta, *told, long, quiet]
        x, y = self._scaler.inputs(self._x), self._scaler.outputs(self._y)
        step = max(1, round(y.size / _THINNED))
        self._inference.set_data(np.ascontiguousarray(x[:, ::step]), y[::step])
        roughly = [maximise(self._value_and_gradient, start, self._bounds) for start in starts]
        self._inference.set_data(x, y)
        begun = [*roughly, middle]
        ends: list[np.ndarray] = []
        values: list[float] = []
        for number, start in enumerate(begun):
            like = [k for k in range(number) if np.abs(begun[k] - start).max() < _SAME]
            if like:
                ends.append(ends[like[0]])
                values.append(values[like[0]])
                continue
            self._theta = start
            self._climb()
            ends.append(self._theta)
            values.append(self._value(self._theta))
        best = int(np.argmax(values))
        self.recall(vars(hyperparameters_of(self._kernel, ends[best])))
        if self._slope() > _FLAT:  # the last climb has changed what is maximised
            self._climb()
        values[best], slope = self._value(self._theta), self._slope()
        agreeing = sum(value > values[best] - _LEVEL for value in values)
        return Refit(values[best] - before, slope, slope <= _FLAT, agreeing, len(begun))

    def _climb(self) -> None:
        """Climb to the top; again, where taking the end changes what is maximised."""
        for _ in range(_ROUNDS):
            self._theta = maximise(self._value_and_gradient, self._theta, self._bounds)
            self.recall(vars(self.hyperparameters))
            if self._slope() <= _FLAT:
                return

    def _slope(self) -> float:
        """Give the largest derivative along which what is maximised may still rise."""
        return steepest(self._value_and_gradient(self._theta)[1], self._theta, self._bounds)

    def _value_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Evaluate what is maximised."""
        value, gradient = self._inference.lml_and_gradient(theta)
        if self._has_prior:
            log_density, slope = self._prior.log_density(theta)
            return value + log_density, gradient + slope
        return value, gradient

    def _value(self, theta: np.ndarray) -> float:
        """Evaluate it without the gradient."""
        return self._inference.lml(theta) + self._prior.log_density(theta)[0]

    def adopt(self, other: "Regression") -> None:
        """Take the hyperparameters of another model of this kind; data and scalers stay."""
        self._theta = other._theta.copy()

    def recall(self, hyperparameters: Mapping[str, float]) -> None:
        """Take hyperparameters that were told before; data and scalers stay.

        Parameters
        ----------
        hyperparameters : mapping
            All of `Regression.hyperparameters`, as the row of a curve has them.
        """
        self._theta = theta_of(self._kernel, hyperparameters)

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


class JointRegression(Regression):
    """A regression that knows how what it predicts at several positions goes together."""

    _inference: JointInference

    def covariance(self, x: np.ndarray) -> np.ndarray:
        """Covariance of the latent function, given the data.

        Parameters
        ----------
        x : array_like of shape (m, 2)
            Query positions, workspace units.

        Returns
        -------
        ndarray of shape (m, m)
            In the unit of the measurements squared; its diagonal is the variance of `predict`.
        """
        scaled = self._scaler.inputs(np.asarray(x, float))
        return self._scaler.y_std**2 * self._inference.covariance(self._theta, scaled)
