"""Exact inference under Gaussian noise, in one packed buffer.

The covariance of the observations is K_y = K + (sigma^2 + jitter) I.
"""

import numpy as np
from scipy.linalg import get_lapack_funcs

from infoplan.errors import RunError
from infoplan.model.covariance import passes_of
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.packed import append_rows, diagonal
from infoplan.model.theta import gradient_of, not_factorised, parameters_of

# Where a jitter of zero starts to grow.
_FIRST_JITTER = 1e-10
# Query points a triangular solve: larger blocks take more memory, smaller ones more time.
_BLOCK = 512


class ExactInference:
    """Log marginal likelihood of some data, its gradient and the predictive distribution.

    All are functions of theta (`infoplan.model.theta`).

    One packed buffer holds in turn K_y, its Cholesky factor and its inverse. The factor is kept
    for as long as the hyperparameters stay: it serves a prediction after a likelihood, and grows
    by a block of rows when data are only added.

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    jitter : float
        Added to the noise variance, in every factorisation. A factorisation that fails is tried
        again with ten times as much, until it succeeds or the jitter exceeds alpha^2 + sigma^2,
        by which any matrix of finite numbers has become positive definite.
    dtype : {"float64", "float32"}
        Of the buffer, the factorisation and the solves. Sums over data are always in double.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    """

    def __init__(self, kernel: Kernel, jitter: float, dtype: str = "float64") -> None:
        self._kernel, self._passes = kernel, passes_of(kernel)
        self.jitter = jitter
        self._configured_jitter = jitter
        self._x = np.empty((2, 0))
        self._y = np.empty(0)
        self._buffer = np.empty(0, dtype=dtype)
        self._theta: np.ndarray | None = None  # of the factor in the buffer, None without one
        self._rows = 0  # of the factor in the buffer
        self._weights: np.ndarray | None = None  # K_y^-1 y of the factor and the data
        self._pftrf, self._pftrs, self._pftri, self._tfttr = get_lapack_funcs(
            ("pftrf", "pftrs", "pftri", "tfttr"), dtype=dtype
        )
        self._tfsm, self._sfrk = get_lapack_funcs(("tfsm", "sfrk"), dtype=dtype)

    @property
    def n_data(self) -> int:
        """Number of data."""
        return self._y.size

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data.

        Parameters
        ----------
        x : ndarray of shape (2, n)
            Scaled inputs, finite.
        y : ndarray of shape (n,)
            Scaled observations, finite.
        """
        if not np.array_equal(x[:, : self._rows], self._x[:, : self._rows]):
            self._theta = None
        self._x, self._y = x, y
        self._weights = None

    def lml(self, theta: np.ndarray) -> float:
        """Log marginal likelihood (the paper's eq. `log_marginal_likelihood`).

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        float
            The likelihood in nats; 0 without data.
        """
        weights = self._solve(theta)
        log_diagonal = np.log(diagonal(self.n_data, self._packed()))
        with np.errstate(over="ignore"):  # huge data: minus infinity, which no optimiser takes
            misfit = 0.5 * (self._y @ weights)
        return float(-misfit - log_diagonal.sum() - 0.5 * self.n_data * np.log(2.0 * np.pi))

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Log marginal likelihood and its gradient (Rasmussen & Williams, eq. 5.9).

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        value : float
            The likelihood in nats.
        gradient : ndarray of shape (k,)
            Its derivatives by theta.
        """
        value = self.lml(theta)
        if self.n_data == 0:
            return value, np.zeros_like(theta)
        weights = self._solve(theta)
        self._theta = None  # the inverse takes the factor's place
        inverse, _ = self._pftri(self.n_data, self._packed(), uplo="L", overwrite_a=1)
        variance, constants, noise = parameters_of(self._kernel, theta)
        sums, trace = self._passes.gradient_sums(self._x, constants, weights, inverse)
        return value, gradient_of(variance, sums, trace, 0.5 * noise * trace)

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance (Rasmussen & Williams, Algorithm 2.1).

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        x : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        mean, variance : ndarrays of shape (m,)
            In scaled units. The variance is at least alpha^2 times the machine epsilon of the
            dtype, which is the rounding of the difference that gives it.
        """
        variance, constants, _ = parameters_of(self._kernel, theta)
        means = np.zeros(x.shape[1])
        variances = np.full(x.shape[1], variance)
        if self.n_data:
            weights = self._solve(theta).astype(self._buffer.dtype)
            factor = self._packed()
            scratch = np.empty((min(_BLOCK, x.shape[1]), self.n_data), dtype=self._buffer.dtype)
            for start in range(0, x.shape[1], _BLOCK):
                part = np.ascontiguousarray(x[:, start : start + _BLOCK])
                block = slice(start, start + part.shape[1])
                cross = scratch[: part.shape[1]]
                self._passes.fill_cross(part, self._x, constants, variance, cross)
                means[block] = cross @ weights
                solved = self._tfsm(1.0, factor, cross.T, uplo="L", overwrite_b=1).T
                variances[block] -= np.einsum("ij,ij->i", solved, solved)
        floor = variance * float(np.finfo(self._buffer.dtype).eps)
        return means, np.maximum(variances, floor)

    def covariance(self, theta: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance of the latent function given the data (Rasmussen & Williams, eq. 2.24).

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
        covariance = np.empty((x.shape[1], x.shape[1]), dtype=self._buffer.dtype)
        self._passes.fill_cross(x, x, constants, variance, covariance)
        if self.n_data:
            self._factorise(theta)
            cross = np.empty((x.shape[1], self.n_data), dtype=self._buffer.dtype)
            self._passes.fill_cross(x, self._x, constants, variance, cross)
            solved = self._tfsm(1.0, self._packed(), cross.T, uplo="L", overwrite_b=1).T
            covariance -= solved @ solved.T
        nodes = np.diag_indices_from(covariance)
        floor = variance * float(np.finfo(self._buffer.dtype).eps)
        covariance[nodes] = np.maximum(covariance[nodes], floor)
        return covariance.astype(float, copy=False)

    def weights_and_inverse(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve for the weights of the data, and invert their covariance.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        weights : ndarray of shape (n,)
            K_y^-1 y.
        inverse : ndarray of shape (n, n)
            K_y^-1.
        """
        weights = self._solve(theta)
        if self.n_data == 0:
            return weights, np.empty((0, 0))
        self._theta = None  # the inverse takes the factor's place
        packed, _ = self._pftri(self.n_data, self._packed(), uplo="L", overwrite_a=1)
        lower, _ = self._tfttr(self.n_data, packed, uplo="L")
        lower = np.tril(lower)
        return weights, (lower + np.tril(lower, -1).T).astype(float)

    def _packed(self) -> np.ndarray:
        """Return the part of the buffer that a matrix of the size of the data takes."""
        return self._buffer[: _packed_size(self.n_data)]

    def _solve(self, theta: np.ndarray) -> np.ndarray:
        """Factorise if need be, and return K_y^-1 y."""
        self._factorise(theta)
        if self._weights is None:
            if self.n_data == 0:
                self._weights = np.empty(0)
            else:
                weights, _ = self._pftrs(
                    self.n_data, self._packed(), self._y[:, np.newaxis], uplo="L"
                )
                self._weights = weights[:, 0].astype(float)
        return self._weights

    def _factorise(self, theta: np.ndarray) -> None:
        """Put the Cholesky factor of K_y into the buffer."""
        if self._theta is not None and np.array_equal(theta, self._theta):
            if self._rows == self.n_data:
                return
            if self.jitter == self._configured_jitter and self._grow(theta):
                return
        self._theta = self._weights = None
        if self._buffer.size < _packed_size(self.n_data):
            self._buffer = np.empty(_packed_size(self.n_data), dtype=self._buffer.dtype)
        self.jitter = self._configured_jitter
        variance, _, noise = parameters_of(self._kernel, theta)
        largest = float(np.finfo(self._buffer.dtype).max)
        while not self._build_and_factorise(theta):
            if not self.jitter <= variance + noise < largest:
                raise RunError(
                    not_factorised("Gaussian process", self._kernel, theta, self._buffer.dtype)
                )
            self.jitter = max(10.0 * self.jitter, _FIRST_JITTER)
        self._theta, self._rows = theta.copy(), self.n_data

    def _build_and_factorise(self, theta: np.ndarray) -> bool:
        """Factorise K_y with the present jitter; tell whether that succeeded."""
        variance, constants, noise = parameters_of(self._kernel, theta)
        packed = self._packed()
        on_diagonal = variance + noise + self.jitter
        self._passes.fill(self._x, constants, variance, on_diagonal, packed)
        return self._cholesky(self.n_data, packed)

    def _grow(self, theta: np.ndarray) -> bool:
        """Append the new data's rows to the factor; tell whether that succeeded."""
        variance, constants, noise = parameters_of(self._kernel, theta)
        old, new = self._rows, self.n_data - self._rows
        x_old, x_new = np.ascontiguousarray(self._x[:, :old]), self._x[:, old:].copy()
        dtype = self._buffer.dtype
        above = np.empty((old, new), dtype=dtype)
        corner = np.empty(_packed_size(new), dtype=dtype)
        self._passes.fill_cross(x_old, x_new, constants, variance, above)
        on_diagonal = variance + noise + self.jitter
        self._passes.fill(x_new, constants, variance, on_diagonal, corner)
        factor = self._buffer[: _packed_size(old)]
        left = self._tfsm(1.0, factor, above.T, side="R", uplo="L", trans="T", overwrite_b=1)
        corner = self._sfrk(new, old, -1.0, left, 1.0, corner, uplo="L", overwrite_c=1)
        if not self._cholesky(new, corner):
            return False
        grown = np.empty(_packed_size(self.n_data), dtype=dtype)
        append_rows(old, factor, left.T, corner, grown)
        self._buffer, self._rows, self._weights = grown, self.n_data, None
        return True

    def _cholesky(self, n: int, packed: np.ndarray) -> bool:
        """Factorise a packed matrix in its place; tell whether that succeeded."""
        if n == 0:
            return True
        _, info = self._pftrf(n, packed, uplo="L", overwrite_a=1)
        return info == 0 and bool(np.isfinite(diagonal(n, packed)).all())


def _packed_size(n: int) -> int:
    """Return the number of elements of a packed n x n matrix."""
    return n * (n + 1) // 2


def log_marginal_likelihood(
    x: np.ndarray,
    y: np.ndarray,
    theta: np.ndarray,
    *,
    kernel: str | Kernel = "squared_exponential",
    jitter: float = 1e-6,
    dtype: str = "float64",
) -> tuple[float, np.ndarray]:
    """Log marginal likelihood of data under given hyperparameters, and its gradient.

    The paper's eq. `log_marginal_likelihood`; Rasmussen & Williams, Algorithm 2.1 and eq. 5.9.

    Parameters
    ----------
    x : ndarray of shape (n, 2)
        Inputs, scaled already.
    y : ndarray of shape (n,)
        Observations, scaled already.
    theta : ndarray of shape (k,)
        (log alpha, the kernel's hyperparameters ..., log sigma^2); for the anisotropic Gaussian
        kernel these are log l_1 and log l_2.
    kernel : str or Kernel
        One of `infoplan.config.KERNELS`, or one's own.
    jitter : float
        Added to sigma^2, ten times as much whenever the factorisation fails, up to a bound.
    dtype : {"float64", "float32"}
        Precision of the factorisation.

    Returns
    -------
    value : float
        The likelihood in nats.
    gradient : ndarray of shape (k,)
        Its derivatives by theta.

    Examples
    --------
    >>> import numpy as np
    >>> value, gradient = log_marginal_likelihood(np.zeros((1, 2)), np.ones(1), np.zeros(4))
    >>> round(value, 4), gradient.shape
    (-1.5155, (4,))
    """
    inference = ExactInference(as_kernel(kernel), jitter, dtype)
    inference.set_data(np.ascontiguousarray(np.asarray(x, float).T), np.asarray(y, float))
    return inference.lml_and_gradient(np.asarray(theta, float))
