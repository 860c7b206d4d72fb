"""Compiled passes over the anisotropic Gaussian kernel (the paper's eq. `kernel`).

Inputs are stored coordinate by coordinate, shape (2, n), so that the inner loops read contiguous
memory and compile to vector instructions. ``rates`` are 1 / (2 l_d^2), so that the kernel is
alpha^2 exp(-sum_d rates_d (x_d - x'_d)^2). Matrices are in Fortran order, as LAPACK wants them.
"""

import numpy as np
from numba import njit

# Kernel values below 1e-20 of the variance are far below rounding: zero keeps subnormals away.
_SMALLEST_EXPONENT = -46.05170185988091

_LOG2_E = 1.4426950408889634
# ln 2 in two parts: the product of the first with a small integer is exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# Adding 1.5 * 2^52 leaves the nearest integer in the lowest bits of a double.
_ROUND = 6755399441055744.0


@njit(cache=True, fastmath={"contract"})
def _exp(t: float) -> float:
    """Exponential of -700 <= t <= 0, without a call or a branch, so that loops over it vectorise.

    exp(t) = 2^k exp(r) with |r| <= ln(2) / 2: a Taylor polynomial of degree 13 (its remainder is
    below 1e-17 there), and k written into the exponent bits.
    """
    rounded = t * _LOG2_E + _ROUND
    k = rounded - _ROUND
    r = (t - k * _LN2_HIGH) - k * _LN2_LOW
    p = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0
    p = r * p + 1.0 / 39916800.0
    p = r * p + 1.0 / 3628800.0
    p = r * p + 1.0 / 362880.0
    p = r * p + 1.0 / 40320.0
    p = r * p + 1.0 / 5040.0
    p = r * p + 1.0 / 720.0
    p = r * p + 1.0 / 120.0
    p = r * p + 1.0 / 24.0
    p = r * p + 1.0 / 6.0
    p = r * p + 0.5
    p = r * p + 1.0
    p = r * p + 1.0
    bits = (np.float64(rounded).view(np.int64) + 1023) << 52
    return p * np.int64(bits).view(np.float64)


@njit(cache=True, fastmath={"contract"})
def _correlation(t: float) -> float:
    """exp(t) of a non-positive t, cut to zero where it is negligible."""
    e = _exp(max(t, -700.0))
    return e if t > _SMALLEST_EXPONENT else 0.0


@njit(cache=True, fastmath={"contract"})
def fill_covariance(
    x: np.ndarray, rates: np.ndarray, variance: float, diagonal: float, out: np.ndarray
) -> None:
    """Write the lower triangle of the covariance of the data.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Inputs.
    rates : ndarray of shape (2,)
        1 / (2 l_d^2).
    variance : float
        alpha^2.
    diagonal : float
        What the diagonal holds: alpha^2 + sigma^2 + jitter.
    out : ndarray of shape (n, n), Fortran order
        Overwritten; above the diagonal nothing is touched.
    """
    x1, x2 = x[0], x[1]
    n = x1.size
    for j in range(n):
        out[j, j] = diagonal
        for i in range(j + 1, n):
            d1 = x1[i] - x1[j]
            d2 = x2[i] - x2[j]
            out[i, j] = variance * _correlation(-(rates[0] * d1 * d1 + rates[1] * d2 * d2))


@njit(cache=True, fastmath={"contract"})
def fill_cross_covariance(
    a: np.ndarray, b: np.ndarray, rates: np.ndarray, variance: float, out: np.ndarray
) -> None:
    """Write the covariances between two sets of inputs.

    Parameters
    ----------
    a, b : ndarrays of shape (2, n) and (2, m)
        Inputs.
    rates : ndarray of shape (2,)
        1 / (2 l_d^2).
    variance : float
        alpha^2.
    out : ndarray of shape (n, m), Fortran order
        Overwritten.
    """
    a1, a2 = a[0], a[1]
    n = a1.size
    for j in range(b.shape[1]):
        for i in range(n):
            d1 = a1[i] - b[0, j]
            d2 = a2[i] - b[1, j]
            out[i, j] = variance * _correlation(-(rates[0] * d1 * d1 + rates[1] * d2 * d2))


@njit(cache=True, fastmath={"contract", "reassoc"})
def gradient_sums(
    x: np.ndarray, rates: np.ndarray, weights: np.ndarray, inverse: np.ndarray
) -> tuple[float, float, float, float]:
    """Compute the sums that make up the gradient of the log marginal likelihood.

    With W = w w^T - K_y^-1 (Rasmussen & Williams, eq. 5.9) and the correlations c = k / alpha^2.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Inputs.
    rates : ndarray of shape (2,)
        1 / (2 l_d^2).
    weights : ndarray of shape (n,)
        w = K_y^-1 y.
    inverse : ndarray of shape (n, n), Fortran order
        K_y^-1; its lower triangle is read.

    Returns
    -------
    below, first, second : float
        Sums below the diagonal of W c, of W c rates_1 d_1^2 and of W c rates_2 d_2^2.
    trace : float
        The trace of W.
    """
    x1, x2 = x[0], x[1]
    n = x1.size
    below = first = second = trace = 0.0
    for j in range(n):
        trace += weights[j] * weights[j] - inverse[j, j]
        for i in range(j + 1, n):
            d1 = x1[i] - x1[j]
            d2 = x2[i] - x2[j]
            t1 = rates[0] * d1 * d1
            t2 = rates[1] * d2 * d2
            wc = (weights[i] * weights[j] - inverse[i, j]) * _correlation(-(t1 + t2))
            below += wc
            first += wc * t1
            second += wc * t2
    return below, first, second, trace


@njit(cache=True)
def copy_triangle(n: int, source: np.ndarray, m: int, target: np.ndarray) -> None:
    """Copy the lower triangle of an n x n matrix to the corner of an m x m matrix, m >= n.

    Parameters
    ----------
    n, m : int
        Sizes of the two matrices, both in Fortran order.
    source, target : ndarrays of shape (>= n^2,) and (>= m^2,)
        Their storage; both may be the same memory.
    """
    # Backwards: within one buffer an element never moves to a lower address.
    for j in range(n - 1, -1, -1):
        for i in range(n - 1, j - 1, -1):
            target[j * m + i] = source[j * n + i]
