"""A posterior's curvature K^-1 + W where W, the data's, may be negative, in stable factors.

The sites of clear positive curvature go into B = I + sqrt(W) K sqrt(W), whose Cholesky factor is
stable, and the few others, the set E of flat and negative ones, into a correction of low rank.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.linalg.lapack import dpotrf, dpotri


@dataclass
class Curved:
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


def curved_at(covariance: np.ndarray, curvature: np.ndarray, flat: float) -> Curved | None:
    """Factorise a curvature.

    Parameters
    ----------
    covariance : ndarray of shape (n, n)
        K, jitter included.
    curvature : ndarray of shape (n,)
        W.
    flat : float
        Sites of less curvature go into the correction.

    Returns
    -------
    Curved or None
        None if a factorisation failed.
    """
    is_other = curvature < flat
    root, others = np.sqrt(np.where(is_other, 0.0, curvature)), np.flatnonzero(is_other)
    b = covariance * root
    b *= root[:, None]
    b[np.diag_indices_from(b)] += 1.0
    factor = factorised(b)
    if factor is None:
        return None
    half = solve_triangular(
        factor, root[:, None] * covariance[:, others], lower=True, check_finite=False
    )
    spread = covariance[np.ix_(others, others)] - half.T @ half
    square_root = factorised(spread.copy())
    if square_root is None:
        return None
    inner = _inner_factor(square_root, curvature[others])
    if inner is None:
        curvature = np.maximum(curvature, 0.0)
        inner = _inner_factor(square_root, curvature[others])
        assert inner is not None  # the identity plus squares
    their_curvature = curvature[others]
    reduced = solve_triangular(
        inner, square_root.T * their_curvature, lower=True, check_finite=False
    )
    log_roots = np.log(factor.diagonal()).sum() + np.log(inner.diagonal()).sum()
    return Curved(
        covariance=covariance,
        curvature=curvature,
        root=root,
        factor=factor,
        others=others,
        half=half,
        spread=spread,
        update=np.diag(their_curvature) - reduced.T @ reduced,
        log_determinant=2.0 * float(log_roots),
    )


def posterior_of(curved: Curved) -> tuple[np.ndarray, np.ndarray]:
    """Precision that the data add, R = W (I + K W)^-1, and variances of the latent values."""
    inverse, _ = dpotri(curved.factor, lower=1)
    precision = symmetric(inverse)
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
    return factorised(np.eye(len(curvature)) + (square_root.T * curvature) @ square_root)


def factorised(matrix: np.ndarray) -> np.ndarray | None:
    """Lower Cholesky factor of a symmetric matrix, in its place; None if it is not positive."""
    if not matrix.size:
        return matrix
    factor, info = dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
    return factor if info == 0 and bool(np.isfinite(factor.diagonal()).all()) else None


def symmetric(lower: np.ndarray) -> np.ndarray:
    """Fill the upper triangle of a matrix from its lower one."""
    full = np.tril(lower)
    full += np.tril(lower, -1).T
    return full
