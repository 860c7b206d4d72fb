"""Ascent on the log marginal likelihood within bounds, continued from call to call."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from scipy.optimize import minimize

Evaluate = Callable[[np.ndarray], tuple[float, np.ndarray]]

# Wide enough for any sensible model; inside, every entry of the covariance is a normal float.
_SMALLEST, _LARGEST = 1e-6, 1e6
_SMALLEST_NOISE, _LARGEST_NOISE = 1e-20, 1e12


def bounds(min_noise_variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds of theta = (log alpha, log l_1, log l_2, log sigma^2).

    Parameters
    ----------
    min_noise_variance : float
        Floor of sigma^2, scaled units. Below 1e-20 it counts as 1e-20, whose logarithm is finite.

    Returns
    -------
    lower, upper : ndarrays of shape (4,)
        The amplitude and the lengthscales lie in [1e-6, 1e6], sigma^2 ends at 1e12.
    """
    lower = [_SMALLEST, _SMALLEST, _SMALLEST, max(min_noise_variance, _SMALLEST_NOISE)]
    upper = [_LARGEST, _LARGEST, _LARGEST, _LARGEST_NOISE]
    return np.log(lower), np.log(upper)


class Adam:
    """Adam (Kingma and Ba 2015, Algorithm 1) with projection on the bounds.

    Parameters
    ----------
    learning_rate : float
        Step size on the logarithms.
    """

    beta1, beta2, epsilon = 0.9, 0.999, 1e-8

    def __init__(self, learning_rate: float) -> None:
        self._learning_rate = learning_rate
        self._steps = 0
        self._mean = np.zeros(4)
        self._square = np.zeros(4)

    def ascend(
        self,
        evaluate: Evaluate,
        theta: np.ndarray,
        iterations: int,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> np.ndarray:
        """Take ``iterations`` steps, one evaluation each.

        Parameters
        ----------
        evaluate : callable
            Maps theta to the likelihood and its gradient.
        theta : ndarray of shape (4,)
            Where to start.
        iterations : int
            Number of steps.
        lower, upper : ndarrays of shape (4,)
            Bounds that theta is clipped to after each step.

        Returns
        -------
        ndarray of shape (4,)
            Theta after the last step. A gradient that is not finite ends the ascent before it.
        """
        for _ in range(iterations):
            _, gradient = evaluate(theta)
            if not np.isfinite(gradient).all():
                break
            self._steps += 1
            self._mean = self.beta1 * self._mean + (1.0 - self.beta1) * gradient
            self._square = self.beta2 * self._square + (1.0 - self.beta2) * gradient**2
            mean = self._mean / (1.0 - self.beta1**self._steps)
            square = self._square / (1.0 - self.beta2**self._steps)
            step = self._learning_rate * mean / (np.sqrt(square) + self.epsilon)
            theta = np.clip(theta + step, lower, upper)
        return theta


class _BudgetSpentError(Exception):
    """Leaves the minimiser when its evaluations are used up."""


class Lbfgs:
    """SciPy's L-BFGS-B under a hard limit of evaluations."""

    def ascend(
        self,
        evaluate: Evaluate,
        theta: np.ndarray,
        iterations: int,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> np.ndarray:
        """Maximise with at most ``iterations`` evaluations.

        Parameters
        ----------
        evaluate : callable
            Maps theta to the likelihood and its gradient.
        theta : ndarray of shape (4,)
            Where to start; clipped to the bounds.
        iterations : int
            Most evaluations of the likelihood and its gradient.
        lower, upper : ndarrays of shape (4,)
            Bounds.

        Returns
        -------
        ndarray of shape (4,)
            The best theta evaluated.
        """
        best_value, best = -np.inf, theta
        evaluations = 0

        def objective(candidate: np.ndarray) -> tuple[float, np.ndarray]:
            nonlocal best_value, best, evaluations
            if evaluations == iterations:
                raise _BudgetSpentError
            evaluations += 1
            value, gradient = evaluate(candidate)
            if not (np.isfinite(value) and np.isfinite(gradient).all()):
                raise _BudgetSpentError
            if value > best_value:
                best_value, best = value, candidate.copy()
            return -value, -gradient

        with suppress(_BudgetSpentError):
            minimize(
                objective,
                np.clip(theta, lower, upper),
                jac=True,
                method="L-BFGS-B",
                bounds=np.column_stack([lower, upper]),
            )
        return best
