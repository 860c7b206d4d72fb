"""Ascent on the log marginal likelihood within bounds, continued from call to call."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from infoplan.model.theta import Bounds

Evaluate = Callable[[np.ndarray], tuple[float, np.ndarray]]

# How far L-BFGS moves a logarithm on new data: a factor of 20, either way.
_REACH = 3.0
# A logarithm so near to a bound lies on it.
_ROUNDING = 1e-9


def _is_usable(value: float, gradient: np.ndarray) -> bool:
    """Tell whether the value and the squares of the gradient are finite."""
    with np.errstate(over="ignore"):
        return bool(np.isfinite(value) and np.isfinite(gradient @ gradient))


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
        self.reset()

    def reset(self) -> None:
        """Forget the moments of the gradient and the number of steps."""
        self._steps = 0
        self._mean = np.zeros(())  # of any shape from the first step on
        self._square = np.zeros(())

    def ascend(
        self,
        evaluate: Evaluate,
        theta: np.ndarray,
        iterations: int,
        bounds: Bounds,
    ) -> np.ndarray:
        """Take ``iterations`` steps, one evaluation each.

        Parameters
        ----------
        evaluate : callable
            Maps theta to the likelihood and its gradient.
        theta : ndarray of shape (k,)
            Where to start.
        iterations : int
            Number of steps.
        bounds : Bounds
            Theta is clipped to them after each step.

        Returns
        -------
        ndarray of shape (k,)
            Theta after the last step. A value or gradient that is not finite ends the ascent at
            the last theta where they were finite.
        """
        usable = theta
        for _ in range(iterations):
            value, gradient = evaluate(theta)
            if not _is_usable(value, gradient):
                return usable
            usable = theta
            self._steps += 1
            self._mean = self.beta1 * self._mean + (1.0 - self.beta1) * gradient
            self._square = self.beta2 * self._square + (1.0 - self.beta2) * gradient**2
            mean = self._mean / (1.0 - self.beta1**self._steps)
            square = self._square / (1.0 - self.beta2**self._steps)
            step = self._learning_rate * mean / (np.sqrt(square) + self.epsilon)
            theta = np.clip(theta + step, bounds.lower, bounds.upper)
        return theta


class _SpentError(Exception):
    """Leaves the minimiser when its evaluations are used up."""


class Lbfgs:
    """SciPy's L-BFGS-B with a hard limit of evaluations, in variables of comparable curvature.

    Each call minimises over theta divided by the square roots of the diagonal of the inverse
    Hessian that the calls before have seen, so that the first step of an epoch has the right
    length. Lengthscales stay where the likelihood is not flat to rounding (`Bounds.flat`), from
    where a long step would never come back. For the same reason
    calls after the first move no hyperparameter by more than a factor of 20: on an epoch's first
    spikes a step may lead to where all is noise.
    """

    def __init__(self) -> None:
        self._scale: np.ndarray | None = None
        self._reach = np.inf

    def reset(self) -> None:
        """Forget the curvature; how far a hyperparameter may move stays."""
        self._scale = None

    def ascend(
        self,
        evaluate: Evaluate,
        theta: np.ndarray,
        iterations: int,
        bounds: Bounds,
    ) -> np.ndarray:
        """Maximise with at most ``iterations`` evaluations.

        Parameters
        ----------
        evaluate : callable
            Maps theta to the likelihood and its gradient.
        theta : ndarray of shape (k,)
            Where to start; clipped to the bounds.
        iterations : int
            Most evaluations of the likelihood and its gradient. Fewer are made once it converges.
        bounds : Bounds
            The likelihood is not evaluated beyond them.

        Returns
        -------
        ndarray of shape (k,)
            The best theta evaluated. A value or gradient that is not finite ends the ascent.
        """
        # Its import would cost a mission with Adam a tenth of a second and 20 MiB.
        from scipy.optimize import minimize

        upper = np.minimum(bounds.upper, bounds.flat)
        start = np.clip(theta, bounds.lower, upper)
        lower = np.maximum(bounds.lower, start - self._reach)
        upper = np.minimum(upper, start + self._reach)
        scale = np.ones(theta.shape) if self._scale is None else self._scale
        seen: list[tuple[float, np.ndarray, np.ndarray]] = []

        def objective(scaled: np.ndarray) -> tuple[float, np.ndarray]:
            if len(seen) == iterations:
                raise _SpentError
            candidate = np.clip(scaled * scale, lower, upper)
            value, gradient = evaluate(candidate)
            if not _is_usable(value, gradient):
                raise _SpentError
            seen.append((value, candidate, gradient))
            return -value, -gradient * scale

        with suppress(_SpentError):
            minimize(
                objective,
                start / scale,
                jac=True,
                method="L-BFGS-B",
                bounds=np.column_stack([lower, upper]) / scale[:, np.newaxis],
            )
        if not seen:
            return theta
        self._scale = _curvature_scale(scale, [s[1] for s in seen], [s[2] for s in seen])
        self._reach = _REACH
        return max(seen, key=lambda s: s[0])[1]


def maximise(evaluate: Evaluate, theta: np.ndarray, bounds: Bounds) -> np.ndarray:
    """Run SciPy's L-BFGS-B until the gradient vanishes, or the value rises no more.

    Parameters
    ----------
    evaluate : callable
        Maps theta to the likelihood and its gradient.
    theta : ndarray of shape (k,)
        Where to start; clipped to the bounds.
    bounds : Bounds
        The likelihood is not evaluated beyond them.

    Returns
    -------
    ndarray of shape (k,)
        The best theta evaluated; the start if nothing could be evaluated.
    """
    from scipy.optimize import minimize

    start = np.clip(theta, bounds.lower, bounds.upper)
    best = (-np.inf, start)

    def objective(candidate: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal best
        value, gradient = evaluate(candidate)
        if not _is_usable(value, gradient):
            raise _SpentError
        if value > best[0]:
            best = value, candidate.copy()
        return -value, -gradient

    with suppress(_SpentError):
        minimize(
            objective, start, jac=True, method="L-BFGS-B",
            bounds=np.column_stack([bounds.lower, bounds.upper]),
            options={"maxiter": 500, "maxfun": 500, "ftol": 1e-10, "gtol": 1e-2},
        )  # fmt: skip
    return best[1]


def steepest(gradient: np.ndarray, theta: np.ndarray, bounds: Bounds) -> float:
    """Return the largest slope in size along which theta may still rise within its bounds."""
    blocked = ((theta <= bounds.lower + _ROUNDING) & (gradient < 0)) | (
        (theta >= bounds.upper - _ROUNDING) & (gradient > 0)
    )
    return float(np.abs(np.where(blocked, 0.0, gradient)).max())


def optimizer_of(name: str, learning_rate: float) -> Adam | Lbfgs:
    """Return a new optimiser by its name in the options, adam or lbfgs."""
    return Adam(learning_rate) if name == "adam" else Lbfgs()


def _curvature_scale(
    scale: np.ndarray, points: list[np.ndarray], gradients: list[np.ndarray]
) -> np.ndarray:
    """Update the square roots of the diagonal of the inverse Hessian of minus the likelihood.

    BFGS (Nocedal and Wright 2006, eq. 6.17) over successive points, those of negative curvature
    left out, from the diagonal known before.
    """
    inverse = np.diag(scale**2)
    for k in range(1, len(points)):
        step, change = points[k] - points[k - 1], gradients[k - 1] - gradients[k]
        curvature = step @ change
        if curvature > 1e-10 * np.linalg.norm(step) * np.linalg.norm(change):
            left = np.eye(len(step)) - np.outer(step, change) / curvature
            inverse = left @ inverse @ left.T + np.outer(step, step) / curvature
    return np.clip(np.sqrt(np.diag(inverse)), 1e-3, 10.0)
