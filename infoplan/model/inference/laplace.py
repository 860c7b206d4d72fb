"""Inference under Student-t noise, by the Laplace approximation.

An observation is y = f + scale t, with t from Student's t distribution of `dof` degrees of freedom.
The posterior is approximated by a Gaussian at its mode (Rasmussen & Williams, Section 3.4), its
marginal likelihood and gradient as in their Section 5.5.1. The likelihood is not log-concave:
residuals above scale sqrt(dof) have a negative curvature W, which needs care in the search for the
mode and in the determinants (Vanhatalo, Jylanki and Vehtari 2009; Jylanki, Vanhatalo and Vehtari
2011).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.linalg.lapack import dtfttr, dtrttf
from scipy.special import gammaln

from infoplan.errors import RunError
from infoplan.model.covariance import passes_of
from infoplan.model.inference.curvature import (
    Curved,
    curved_at,
    factorised,
    posterior_of,
    symmetric,
)
from infoplan.model.kernel import Kernel
from infoplan.model.theta import gradient_of, noise_variance_of, not_factorised, parameters_of

# Curvature below this share of the largest possible counts as flat.
_FLAT = 1e-3
# The mode is found when the latent values move by less than this, in units of the scale.
_TOLERANCE = 1e-9
# Factors are renewed where a step is longer than this share of the one before.
_SLOW = 0.3
_MOST_FACTORISATIONS = 100
_MOST_HALVINGS = 30
_FIRST_JITTER, _MOST_JITTER = 1e-10, 1e3
# Query points a triangular solve: larger blocks take more memory, smaller ones more time.
_BLOCK = 512


@dataclass
class _Mode:
    """The posterior's mode under some hyperparameters.

    Attributes
    ----------
    weights, latent : ndarrays of shape (n,)
        a = K^-1 f and f at the mode.
    curved : Curved
        The curvature there.
    value : float
        Approximate log marginal likelihood.
    """

    weights: np.ndarray
    latent: np.ndarray
    curved: Curved
    value: float


class LaplaceInference:
    """Log marginal likelihood of some data, its gradient and the predictive distribution, nearly.

    All are functions of theta (`infoplan.model.theta`), with scale^2 in place of sigma^2. An
    evaluation takes two or more Cholesky factorisations, a gradient an inverse and a few products
    of n x n with n x m matrices besides.

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    dof : float
        Degrees of freedom of the noise.
    jitter : float
        Added to the diagonal of K, ten times as much whenever a factorisation fails.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    """

    def __init__(self, kernel: Kernel, dof: float, jitter: float) -> None:
        self._kernel, self._passes = kernel, passes_of(kernel)
        self.jitter = jitter
        self._configured_jitter = jitter
        self._dof = dof
        self._x = np.empty((2, 0))
        self._y = np.empty(0)
        self._theta: np.ndarray | None = None  # of the mode, None without one
        self._mode: _Mode | None = None
        # Weights of the last mode, to start the next search from; None: nothing to start from.
        self._weights: np.ndarray | None = None

    @property
    def n_data(self) -> int:
        """Number of data."""
        return self._y.size

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data; those that come after the present ones continue the present mode.

        Parameters
        ----------
        x : ndarray of shape (2, n)
            Scaled inputs, finite.
        y : ndarray of shape (n,)
            Scaled observations, finite.
        """
        old = self.n_data
        continues = np.array_equal(x[:, :old], self._x) and np.array_equal(y[:old], self._y)
        if self._weights is not None:
            added = np.zeros(len(y) - old) if continues else None
            self._weights = None if added is None else np.concatenate([self._weights, added])
        self._x, self._y = x, y
        self._theta = self._mode = None

    def lml(self, theta: np.ndarray) -> float:
        """Approximate log marginal likelihood (Rasmussen & Williams, eq. 3.32).

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        float
            In nats; 0 without data.
        """
        return self._find(theta).value if self.n_data else 0.0

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Approximate log marginal likelihood and its gradient.

        Rasmussen & Williams, Algorithm 5.1, implicit terms through the moving mode included, with
        the scale's derivatives besides the kernel's.

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
        if self.n_data == 0:
            return 0.0, np.zeros_like(theta)
        mode = self._find(theta)
        variance, constants, _ = parameters_of(self._kernel, theta)
        covariance = mode.curved.covariance
        precision, posterior_variance = posterior_of(mode.curved)
        # How the value rises with the latent values, of which the mode is a function.
        pull = 0.5 * posterior_variance * self._third_derivative(mode, theta)
        moved = pull - precision @ (covariance @ pull)
        # a a^T + a u^T + u a^T - R, as the sums over w w^T minus an "inverse".
        precision += np.outer(moved, moved)
        packed, _ = dtrttf(precision, uplo="L")
        weights = mode.weights + moved
        sums, trace = self._passes.gradient_sums(self._x, constants, weights, packed)
        log_density, slope, curvature = self._scale_derivatives(mode, theta)
        by_noise = (
            log_density.sum() - 0.5 * posterior_variance @ curvature + moved @ (covariance @ slope)
        )
        return mode.value, gradient_of(variance, sums, trace, by_noise)

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance of the approximate posterior.

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
        variance, constants, _ = parameters_of(self._kernel, theta)
        means = np.zeros(x.shape[1])
        variances = np.full(x.shape[1], variance)
        if self.n_data:
            mode = self._find(theta)
            curved = mode.curved
            for start in range(0, x.shape[1], _BLOCK):
                part = np.ascontiguousarray(x[:, start : start + _BLOCK])
                block = slice(start, start + part.shape[1])
                cross = np.empty((part.shape[1], self.n_data))
                self._passes.fill_cross(part, self._x, constants, variance, cross)
                means[block] = cross @ mode.weights
                solved = solve_triangular(
                    curved.factor, curved.root[:, None] * cross.T, lower=True, check_finite=False
                )
                left = cross[:, curved.others].T - curved.half.T @ solved
                variances[block] -= np.einsum("ij,ij->j", solved, solved)
                variances[block] -= np.einsum("ij,ij->j", left, curved.update @ left)
        floor = variance * float(np.finfo(float).eps)
        return means, np.maximum(variances, floor)

    def covariance(self, theta: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance of the latent function under the approximate posterior.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        x : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        ndarray of shape (m, m)
            In scaled units; the diagonal is the variance of `predict`.
        """
        variance, constants, _ = parameters_of(self._kernel, theta)
        x = np.ascontiguousarray(x)
        covariance = np.empty((x.shape[1], x.shape[1]))
        self._passes.fill_cross(x, x, constants, variance, covariance)
        if self.n_data:
            curved = self._find(theta).curved
            cross = np.empty((x.shape[1], self.n_data))
            self._passes.fill_cross(x, self._x, constants, variance, cross)
            solved = solve_triangular(
                curved.factor, curved.root[:, None] * cross.T, lower=True, check_finite=False
            )
            left = cross[:, curved.others].T - curved.half.T @ solved
            covariance -= solved.T @ solved + left.T @ (curved.update @ left)
        nodes = np.diag_indices_from(covariance)
        covariance[nodes] = np.maximum(covariance[nodes], variance * float(np.finfo(float).eps))
        return covariance

    def _find(self, theta: np.ndarray) -> _Mode:
        """Return the mode under some hyperparameters, found already or not."""
        if self._mode is None or self._theta is None or not np.array_equal(theta, self._theta):
            self.jitter = self._configured_jitter
            while (mode := self._search_quietly(theta)) is None:
                self.jitter = max(10.0 * self.jitter, _FIRST_JITTER)
                if self.jitter > _MOST_JITTER:
                    raise RunError(not_factorised("Student-t process", self._kernel, theta))
            self._mode, self._theta, self._weights = mode, theta.copy(), mode.weights
        return self._mode

    def _search_quietly(self, theta: np.ndarray) -> _Mode | None:
        """Search; huge data overflow, and then no factorisation succeeds."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._search(theta)

    def _search(self, theta: np.ndarray) -> _Mode | None:
        """Find the mode; None if a factorisation failed.

        From the last one, whose neighbour it is; without one, the higher of those found from
        Gaussian noise and from the prior's mean.
        """
        covariance = self._covariance(theta)
        starts = [self._weights]
        if self._weights is None:
            starts = [self._gaussian_weights(covariance, theta), np.zeros(self.n_data)]
        best, highest = -np.inf, None
        for start in starts:
            climbed = None if start is None else self._climb(covariance, theta, start)
            if climbed is None:
                return None
            height, weights = climbed
            if height > best:
                best, highest = height, weights
        if highest is None:
            return None
        latent = covariance @ highest
        curved = self._curve(covariance, theta, latent)
        if curved is None:
            return None
        return _Mode(highest, latent, curved, best - 0.5 * curved.log_determinant)

    def _covariance(self, theta: np.ndarray) -> np.ndarray:
        variance, constants, _ = parameters_of(self._kernel, theta)
        n = self.n_data
        packed = np.empty(n * (n + 1) // 2)
        self._passes.fill(self._x, constants, variance, variance + self.jitter, packed)
        lower, _ = dtfttr(n, packed, uplo="L")
        return symmetric(lower)

    def _gaussian_weights(self, covariance: np.ndarray, theta: np.ndarray) -> np.ndarray | None:
        """Weights under Gaussian noise of the same scale."""
        noisy = covariance.copy()
        noisy[np.diag_indices_from(noisy)] += noise_variance_of(theta)
        factor = factorised(noisy)
        return None if factor is None else cho_solve((factor, True), self._y, check_finite=False)

    def _climb(
        self, covariance: np.ndarray, theta: np.ndarray, weights: np.ndarray
    ) -> tuple[float, np.ndarray] | None:
        """Climb to a mode of the posterior; None if a factorisation failed.

        Newton steps on f = K a, with curvatures that make them point uphill, halved until they do
        lead up (Rasmussen & Williams, Algorithm 3.1, damped). Factors serve for as many steps as
        converge quickly.

        Returns
        -------
        height : float
            Log posterior at the mode, up to the constants of the prior.
        weights : ndarray of shape (n,)
            a = K^-1 f at the mode.
        """
        scale = np.sqrt(noise_variance_of(theta))
        latent = covariance @ weights
        height = self._height(theta, weights, latent)
        for _ in range(_MOST_FACTORISATIONS):
            curved = self._curve(covariance, theta, latent)
            if curved is None:
                return None
            change = np.inf
            while True:
                target = curved.curvature * latent + self._slope(theta, latent)
                step = target - curved.explained(covariance @ target) - weights
                latent_step = covariance @ step
                before, change = change, float(np.abs(latent_step).max()) / scale
                share, height = self._shorten(theta, weights, latent, step, latent_step, height)
                weights, latent = weights + share * step, latent + share * latent_step
                if change <= _TOLERANCE or share == 0.0:
                    return height, weights
                if share < 1.0 or change > _SLOW * before:
                    break
        return height, weights

    def _shorten(
        self,
        theta: np.ndarray,
        weights: np.ndarray,
        latent: np.ndarray,
        step: np.ndarray,
        latent_step: np.ndarray,
        height: float,
    ) -> tuple[float, float]:
        """Largest of 1, 1/2, 1/4 ... of a step that leads up, and the height there; else 0."""
        share, rounding = 1.0, 1e-13 * (1.0 + abs(height))
        for _ in range(_MOST_HALVINGS):
            reached = self._height(theta, weights + share * step, latent + share * latent_step)
            if reached >= height - rounding:
                return share, reached
            share *= 0.5
        return 0.0, height

    def _curve(
        self, covariance: np.ndarray, theta: np.ndarray, latent: np.ndarray
    ) -> Curved | None:
        """Factorise the curvature at some latent values; None if that failed."""
        flat = _FLAT * (self._dof + 1.0) / (self._dof * noise_variance_of(theta))
        return curved_at(covariance, self._curvature(theta, latent), flat)

    # The likelihood: with r = y - f, v = dof scale^2 and d = v + r^2.

    def _height(self, theta: np.ndarray, weights: np.ndarray, latent: np.ndarray) -> float:
        """Log posterior of the latent values, up to the constants of its Gaussian prior."""
        dof, v = self._dof, self._dof * noise_variance_of(theta)
        constant = gammaln(0.5 * (dof + 1.0)) - gammaln(0.5 * dof) - 0.5 * np.log(np.pi * v)
        misfit = np.log1p((self._y - latent) ** 2 / v).sum()
        return float(
            -0.5 * (weights @ latent) + self.n_data * constant - 0.5 * (dof + 1.0) * misfit
        )

    def _slope(self, theta: np.ndarray, latent: np.ndarray) -> np.ndarray:
        r = self._y - latent
        return (self._dof + 1.0) * r / (self._dof * noise_variance_of(theta) + r**2)

    def _curvature(self, theta: np.ndarray, latent: np.ndarray) -> np.ndarray:
        v, r2 = self._dof * noise_variance_of(theta), (self._y - latent) ** 2
        return (self._dof + 1.0) * (v - r2) / (v + r2) ** 2

    def _third_derivative(self, mode: _Mode, theta: np.ndarray) -> np.ndarray:
        v, r = self._dof * noise_variance_of(theta), self._y - mode.latent
        # Of a huge scale the cube overflows: 0, or no number, where an ascent ends.
        with np.errstate(over="ignore", invalid="ignore"):
            return -2.0 * (self._dof + 1.0) * r * (3.0 * v - r**2) / (v + r**2) ** 3

    def _scale_derivatives(
        self, mode: _Mode, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Differentiate log density, slope and curvature by log scale^2."""
        more, v = self._dof + 1.0, self._dof * noise_variance_of(theta)
        r = self._y - mode.latent
        d = v + r**2
        with np.errstate(over="ignore", invalid="ignore"):  # as in _third_derivative
            return (
                0.5 * (more * r**2 / d - 1.0),
                -more * r * v / d**2,
                more * v * (3.0 * r**2 - v) / d**3,
            )
