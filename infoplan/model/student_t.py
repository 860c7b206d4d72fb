"""Gaussian process regression with Student-t noise, by the Laplace approximation.

An observation is y = f + scale t, with t from Student's t distribution of `dof` degrees of freedom:
heavy tails, so that a far outlier hardly pulls the latent function. The posterior is approximated
by a Gaussian at its mode (Rasmussen & Williams, Section 3.4), its marginal likelihood and gradient
as in their Section 5.5.1. The likelihood is not log-concave: residuals above scale sqrt(dof) have
a negative curvature W, which needs care in the search for the mode and in the determinants
(Vanhatalo, Jylanki and Vehtari 2009; Jylanki, Vanhatalo and Vehtari 2011).

Here the sites of clear positive curvature go into B = I + sqrt(W) K sqrt(W), whose Cholesky factor
is stable, and the few others, the set E of flat and negative ones, into a correction of low rank.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.linalg.lapack import dpotrf, dpotri, dtfttr, dtrttf
from scipy.special import gammaln

from infoplan.errors import RunError
from infoplan.model.gp import GaussianProcess
from infoplan.model.kernel import fill_covariance, fill_cross_covariance, gradient_sums
from infoplan.model.likelihood import not_factorised, parameters

# Curvature below this share of the largest possible goes into the correction.
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


class StudentTProcess(GaussianProcess):
    """Zero-mean Gaussian process with the anisotropic Gaussian kernel and Student-t noise.

    Used like `infoplan.model.GaussianProcess`, with the same scalers; the noise parameter is the
    squared scale of the t distribution in place of a variance.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    dof : float
        Degrees of freedom, above 2 so that the noise has a variance; fixed.
    amplitude : float
        First alpha.
    lengthscale : float
        First lengthscale of both dimensions.
    noise_variance : float
        First squared scale.
    jitter : float
        Added to the variance of the latent values. A covariance that is not positive definite is
        tried again with ten times as much, until it is.
    min_noise_variance : float
        Floor of the learned squared scale.
    optimizer : {"adam", "lbfgs"}
        How the approximate log marginal likelihood is maximised.
    learning_rate : float
        Adam's step on the logarithms of the hyperparameters.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers: no extent, equal or non-finite values.
    """

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        *,
        dof: float = 4.0,
        amplitude: float = 1.0,
        lengthscale: float = 0.5,
        noise_variance: float = 1.0,
        jitter: float = 1e-6,
        min_noise_variance: float = 1e-4,
        optimizer: str = "adam",
        learning_rate: float = 0.01,
    ) -> None:
        self._variance_per_scale = dof / (dof - 2.0)
        self._set_up(
            LaplaceLikelihood(dof, jitter),
            x_pilot,
            y_pilot,
            [amplitude, lengthscale, lengthscale, noise_variance],
            min_noise_variance,
            optimizer,
            learning_rate,
        )

    @property
    def observation_noise_std(self) -> float:
        """Standard deviation of the learned noise in the unit of the measurements."""
        return float(self._variance_per_scale**0.5 * super().observation_noise_std)

    def _noise_variance(self) -> float:
        return self._variance_per_scale * super()._noise_variance()


@dataclass
class _Curved:
    """The posterior's curvature at some latent values: K^-1 + W, by its factors.

    Attributes
    ----------
    covariance : ndarray of shape (n, n)
        K, jitter included.
    curvature : ndarray of shape (n,)
        W, minus the second derivatives of the log likelihood; where K^-1 + W would not be positive
        definite, which it is at a mode, the negative ones are 0.
    root : ndarray of shape (n,)
        sqrt(W) where the curvature is clearly positive, else 0.
    factor : ndarray of shape (n, n)
        L, the lower Cholesky factor of B = I + root K root.
    others : ndarray of int, shape (m,)
        The sites E that B leaves out.
    half : ndarray of shape (n, m)
        L^-1 root K_E.
    spread : ndarray of shape (m, m)
        S, the covariance of the sites E under the curvature that is in B.
    update : ndarray of shape (m, m)
        P = W_E (I + S W_E)^-1: what E adds to the precision.
    log_determinant : float
        Of I + K W.
    """

    covariance: np.ndarray
    curvature: np.ndarray
    root: np.ndarray
    factor: np.ndarray
    others: np.ndarray
    half: np.ndarray
    spread: np.ndarray
    update: np.ndarray
    log_determinant: float

    def explained(self, vector: np.ndarray) -> np.ndarray:
        """Return R v, with R = W (I + K W)^-1 = (K + W^-1)^-1."""
        inside = self._inside(vector)
        left = vector[self.others] - self.covariance[self.others] @ inside
        weight = self.update @ left
        inside -= self._inside(self.covariance[:, self.others] @ weight)
        inside[self.others] += weight
        return inside

    def _inside(self, vector: np.ndarray) -> np.ndarray:
        solved = cho_solve((self.factor, True), self.root * vector, check_finite=False)
        return np.asarray(self.root * solved)


@dataclass
class _Mode:
    """The posterior's mode under some hyperparameters.

    Attributes
    ----------
    weights, latent : ndarrays of shape (n,)
        a = K^-1 f and f at the mode.
    curved : _Curved
        The curvature there.
    value : float
        Approximate log marginal likelihood.
    """

    weights: np.ndarray
    latent: np.ndarray
    curved: _Curved
    value: float


class LaplaceLikelihood:
    """Approximate log marginal likelihood of some data as a function of the hyperparameters.

    The hyperparameters are theta = (log alpha, log l_1, log l_2, log scale^2), scaled units. An
    evaluation takes two or more Cholesky factorisations, a gradient an inverse and a few products
    of n x n with n x m matrices besides.

    Parameters
    ----------
    dof : float
        Degrees of freedom of the noise.
    jitter : float
        Added to the diagonal of K, ten times as much whenever a factorisation fails.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    """

    def __init__(self, dof: float, jitter: float) -> None:
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

    def value(self, theta: np.ndarray) -> float:
        """Approximate log marginal likelihood (Rasmussen & Williams, eq. 3.32).

        Parameters
        ----------
        theta : ndarray of shape (4,)
            Log hyperparameters.

        Returns
        -------
        float
            In nats; 0 without data.
        """
        return self._find(theta).value if self.n_data else 0.0

    def value_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Approximate log marginal likelihood and its gradient.

        Rasmussen & Williams, Algorithm 5.1, implicit terms through the moving mode included, with
        the scale's derivatives besides the kernel's.

        Parameters
        ----------
        theta : ndarray of shape (4,)
            Log hyperparameters.

        Returns
        -------
        value : float
            In nats.
        gradient : ndarray of shape (4,)
            Its derivatives by theta.
        """
        if self.n_data == 0:
            return 0.0, np.zeros(4)
        mode = self._find(theta)
        variance, rates, _ = parameters(theta)
        covariance = mode.curved.covariance
        precision, posterior_variance = _posterior(mode.curved)
        # How the value rises with the latent values, of which the mode is a function.
        pull = 0.5 * posterior_variance * self._third_derivative(mode, theta)
        moved = pull - precision @ (covariance @ pull)
        # a a^T + a u^T + u a^T - R, as the sums over w w^T minus an "inverse".
        precision += np.outer(moved, moved)
        packed, _ = dtrttf(precision, uplo="L")
        weights = mode.weights + moved
        pairs, first, second, trace = gradient_sums(self._x, rates, weights, packed)
        log_density, slope, curvature = self._scale_derivatives(mode, theta)
        gradient = [
            variance * (2.0 * pairs + trace),
            2.0 * variance * first,
            2.0 * variance * second,
            log_density.sum() - 0.5 * posterior_variance @ curvature + moved @ (covariance @ slope),
        ]
        return mode.value, np.array(gradient)

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance of the approximate posterior.

        Parameters
        ----------
        theta : ndarray of shape (4,)
            Log hyperparameters.
        x : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        mean, variance : ndarrays of shape (m,)
            In scaled units; the variance is at least alpha^2 times the machine epsilon.
        """
        variance, rates, _ = parameters(theta)
        means = np.zeros(x.shape[1])
        variances = np.full(x.shape[1], variance)
        if self.n_data:
            mode = self._find(theta)
            curved = mode.curved
            for start in range(0, x.shape[1], _BLOCK):
                part = np.ascontiguousarray(x[:, start : start + _BLOCK])
                block = slice(start, start + part.shape[1])
                cross = np.empty((part.shape[1], self.n_data))
                fill_cross_covariance(part, self._x, rates, variance, cross)
                means[block] = cross @ mode.weights
                solved = solve_triangular(
                    curved.factor, curved.root[:, None] * cross.T, lower=True, check_finite=False
                )
                left = cross[:, curved.others].T - curved.half.T @ solved
                variances[block] -= np.einsum("ij,ij->j", solved, solved)
                variances[block] -= np.einsum("ij,ij->j", left, curved.update @ left)
        floor = variance * float(np.finfo(float).eps)
        return means, np.maximum(variances, floor)

    def _find(self, theta: np.ndarray) -> _Mode:
        """Return the mode under some hyperparameters, found already or not."""
        if self._mode is None or self._theta is None or not np.array_equal(theta, self._theta):
            self.jitter = self._configured_jitter
            while (mode := self._search_quietly(theta)) is None:
                self.jitter = max(10.0 * self.jitter, _FIRST_JITTER)
                if self.jitter > _MOST_JITTER:
                    raise RunError(not_factorised("Student-t process", theta))
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
        variance, rates, _ = parameters(theta)
        n = self.n_data
        packed = np.empty(n * (n + 1) // 2)
        fill_covariance(self._x, rates, variance, variance + self.jitter, packed)
        lower, _ = dtfttr(n, packed, uplo="L")
        return _symmetric(lower)

    def _gaussian_weights(self, covariance: np.ndarray, theta: np.ndarray) -> np.ndarray | None:
        """Weights under Gaussian noise of the same scale."""
        noisy = covariance.copy()
        noisy[np.diag_indices_from(noisy)] += parameters(theta)[2]
        factor = _factorised(noisy)
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
        scale = np.sqrt(parameters(theta)[2])
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
    ) -> _Curved | None:
        """Factorise the curvature at some latent values; None if that failed."""
        curvature = self._curvature(theta, latent)
        is_other = curvature < _FLAT * (self._dof + 1.0) / (self._dof * parameters(theta)[2])
        root, others = np.sqrt(np.where(is_other, 0.0, curvature)), np.flatnonzero(is_other)
        b = covariance * root
        b *= root[:, None]
        b[np.diag_indices_from(b)] += 1.0
        factor = _factorised(b)
        if factor is None:
            return None
        half = solve_triangular(
            factor, root[:, None] * covariance[:, others], lower=True, check_finite=False
        )
        spread = covariance[np.ix_(others, others)] - half.T @ half
        square_root = _factorised(spread.copy())
        if square_root is None:
            return None
        inner = _inner_factor(square_root, curvature[others])
        if inner is None:
            curvature = np.maximum(curvature, 0.0)
            inner = _inner_factor(square_root, curvature[others])
            assert inner is not None  # the identity plus squares
        flat = curvature[others]
        reduced = solve_triangular(inner, square_root.T * flat, lower=True, check_finite=False)
        log_roots = np.log(factor.diagonal()).sum() + np.log(inner.diagonal()).sum()
        return _Curved(
            covariance=covariance,
            curvature=curvature,
            root=root,
            factor=factor,
            others=others,
            half=half,
            spread=spread,
            update=np.diag(flat) - reduced.T @ reduced,
            log_determinant=2.0 * float(log_roots),
        )

    # The likelihood: with r = y - f, v = dof scale^2 and d = v + r^2.

    def _height(self, theta: np.ndarray, weights: np.ndarray, latent: np.ndarray) -> float:
        """Log posterior of the latent values, up to the constants of its Gaussian prior."""
        dof, v = self._dof, self._dof * parameters(theta)[2]
        constant = gammaln(0.5 * (dof + 1.0)) - gammaln(0.5 * dof) - 0.5 * np.log(np.pi * v)
        misfit = np.log1p((self._y - latent) ** 2 / v).sum()
        return float(
            -0.5 * (weights @ latent) + self.n_data * constant - 0.5 * (dof + 1.0) * misfit
        )

    def _slope(self, theta: np.ndarray, latent: np.ndarray) -> np.ndarray:
        r = self._y - latent
        return (self._dof + 1.0) * r / (self._dof * parameters(theta)[2] + r**2)

    def _curvature(self, theta: np.ndarray, latent: np.ndarray) -> np.ndarray:
        v, r2 = self._dof * parameters(theta)[2], (self._y - latent) ** 2
        return (self._dof + 1.0) * (v - r2) / (v + r2) ** 2

    def _third_derivative(self, mode: _Mode, theta: np.ndarray) -> np.ndarray:
        v, r = self._dof * parameters(theta)[2], self._y - mode.latent
        return -2.0 * (self._dof + 1.0) * r * (3.0 * v - r**2) / (v + r**2) ** 3

    def _scale_derivatives(
        self, mode: _Mode, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Differentiate log density, slope and curvature by log scale^2."""
        more, v = self._dof + 1.0, self._dof * parameters(theta)[2]
        r = self._y - mode.latent
        d = v + r**2
        return (
            0.5 * (more * r**2 / d - 1.0),
            -more * r * v / d**2,
            more * v * (3.0 * r**2 - v) / d**3,
        )


def _posterior(curved: _Curved) -> tuple[np.ndarray, np.ndarray]:
    """Precision that the data add, R = W (I + K W)^-1, and variances of the latent values."""
    inverse, _ = dpotri(curved.factor, lower=1)
    precision = _symmetric(inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        # B^-1 = I - root (K^-1 + root^2)^-1 root.
        variance = (1.0 - precision.diagonal()) / curved.root**2
    variance[curved.others] = curved.spread.diagonal()
    precision *= curved.root[:, None]
    precision *= curved.root
    if curved.others.size:
        beside = -precision @ curved.covariance[:, curved.others]
        beside[curved.others, np.arange(curved.others.size)] += 1.0
        precision += (beside @ curved.update) @ beside.T
        covaried = curved.covariance @ beside
        variance -= np.einsum("ij,ij->i", covaried @ curved.update, covaried)
    return precision, variance


def _inner_factor(square_root: np.ndarray, curvature: np.ndarray) -> np.ndarray | None:
    """Factor of I + C^T W C with S = C C^T: what the sites outside B add to the determinant."""
    return _factorised(np.eye(len(curvature)) + (square_root.T * curvature) @ square_root)


def _factorised(matrix: np.ndarray) -> np.ndarray | None:
    """Lower Cholesky factor of a symmetric matrix, in its place; None if it is not positive."""
    if not matrix.size:
        return matrix
    factor, info = dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
    return factor if info == 0 and bool(np.isfinite(factor.diagonal()).all()) else None


def _symmetric(lower: np.ndarray) -> np.ndarray:
    """Fill the upper triangle of a matrix from its lower one."""
    full = np.tril(lower)
    full += np.tril(lower, -1).T
    return full
