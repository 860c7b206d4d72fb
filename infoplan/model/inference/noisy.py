"""Gaussian conditioning where each datum has a noise variance of its own, in dense matrices.

The covariance of the observations is A = K + diag(noise) + jitter I.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.linalg.lapack import dpotri, dtfttr, dtrttf

from infoplan.errors import RunError
from infoplan.model.covariance import passes_of
from infoplan.model.inference.curvature import factorised, symmetric
from infoplan.model.kernel import Kernel
from infoplan.model.theta import gradient_of, not_factorised, parameters_of

# Where a jitter of zero starts to grow.
_FIRST_JITTER = 1e-10
# Query points a triangular solve: larger blocks take more memory, smaller ones more time.
_BLOCK = 512


@dataclass
class Noisy:
    """The covariance A of some observations, factorised.

    Attributes
    ----------
    kernel : Kernel
        Of the latent function.
    theta : ndarray of shape (k,)
        Log hyperparameters.
    x : ndarray of shape (2, n)
        Scaled inputs.
    jitter : float
        What the factorisation took.
    factor : ndarray of shape (n, n)
        Lower Cholesky factor of A.
    """

    kernel: Kernel
    theta: np.ndarray
    x: np.ndarray
    jitter: float
    factor: np.ndarray

    def solve(self, vector: np.ndarray) -> np.ndarray:
        """Return A^-1 v."""
        solved: np.ndarray = cho_solve((self.factor, True), vector, check_finite=False)
        return solved

    def inverse(self) -> np.ndarray:
        """Return A^-1."""
        lower, _ = dpotri(self.factor, lower=1)
        return symmetric(lower)

    def log_determinant(self) -> float:
        """Return log |A|."""
        return 2.0 * float(np.log(self.factor.diagonal()).sum())

    def gradient(self, slope: np.ndarray, by_noise: float) -> np.ndarray:
        """Differentiate a function of A by theta.

        Parameters
        ----------
        slope : ndarray of shape (n, n)
            W, symmetric, with which the function's differential is tr(W dA) / 2.
        by_noise : float
            Its derivative by log sigma^2.
        """
        variance, constants, _ = parameters_of(self.kernel, self.theta)
        packed, _ = dtrttf(-slope, uplo="L")
        nothing = np.zeros(len(slope))
        sums, trace = passes_of(self.kernel).gradient_sums(self.x, constants, nothing, packed)
        return gradient_of(variance, sums, trace, by_noise)

    def predict(self, weights: np.ndarray, query: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance.

        Parameters
        ----------
        weights : ndarray of shape (n,)
            A^-1 times the observations.
        query : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        mean, variance : ndarrays of shape (m,)
            In scaled units; the variance is at least alpha^2 times the machine epsilon.
        """
        variance, constants, _ = parameters_of(self.kernel, self.theta)
        means = np.zeros(query.shape[1])
        variances = np.full(query.shape[1], variance)
        for start in range(0, query.shape[1] if len(weights) else 0, _BLOCK):
            part = np.ascontiguousarray(query[:, start : start + _BLOCK])
            block = slice(start, start + part.shape[1])
            cross = np.empty((part.shape[1], len(weights)))
            passes_of(self.kernel).fill_cross(part, self.x, constants, variance, cross)
            means[block] = cross @ weights
            solved = solve_triangular(self.factor, cross.T, lower=True, check_finite=False)
            variances[block] -= np.einsum("ij,ij->j", solved, solved)
        return means, np.maximum(variances, variance * float(np.finfo(float).eps))


def factorise(
    kernel: Kernel, theta: np.ndarray, x: np.ndarray, noise: np.ndarray, jitter: float, model: str
) -> Noisy:
    """Factorise the covariance of some observations.

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    theta : ndarray of shape (k,)
        Log hyperparameters.
    x : ndarray of shape (2, n)
        Scaled inputs.
    noise : ndarray of shape (n,)
        Noise variance of each observation.
    jitter : float
        Added to all of them, ten times as much whenever the factorisation fails.
    model : str
        Name of the model, for the error.

    Raises
    ------
    RunError
        If no jitter up to the largest variance helps.
    """
    variance, constants, _ = parameters_of(kernel, theta)
    n = x.shape[1]
    packed = np.empty(n * (n + 1) // 2)
    passes_of(kernel).fill(x, constants, variance, variance, packed)
    covariance = symmetric(dtfttr(n, packed, uplo="L")[0]) if n else np.empty((0, 0))
    most = variance + float(noise.max(initial=0.0))
    while True:
        matrix = covariance.copy()
        matrix[np.diag_indices(n)] += noise + jitter
        factor = factorised(matrix)
        if factor is not None:
            return Noisy(kernel, theta.copy(), x, jitter, factor)
        if not jitter <= most < np.finfo(float).max:
            raise RunError(not_factorised(model, kernel, theta))
        jitter = max(10.0 * jitter, _FIRST_JITTER)
