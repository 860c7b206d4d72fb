"""Compiled passes over the anisotropic Gaussian kernel (the paper's eq. `kernel`).

Inputs are stored coordinate by coordinate, shape (2, n), so that the inner loops read contiguous
memory and compile to vector instructions. ``rates`` are 1 / (2 l_d^2), so that the kernel is
alpha^2 exp(-sum_d rates_d (x_d - x'_d)^2).

A symmetric or lower triangular n x n matrix is a vector of n (n + 1) / 2 elements in LAPACK's
rectangular full packed format (Gustavson et al. 2010; TRANSR = 'N', UPLO = 'L'): half the memory
of a square, and still factorised by blocked routines. With n1 = ceil(n / 2) and lda = n rounded up
to odd it is an lda x n1 matrix in Fortran order: the first n1 columns of the lower triangle, and
the rest of it, transposed, in the corner that these leave free.
"""

import numpy as np

from infoplan.compiled import kernel

# Kernel values below 1e-20 of the variance are far below rounding: zero keeps subnormals away.
_SMALLEST_EXPONENT = -46.05170185988091

_LOG2_E = 1.4426950408889634
# ln 2 in two parts: the product of the first with a small integer is exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# Adding 1.5 * 2^52 leaves the nearest integer in the lowest bits of a double.
_ROUND = 6755399441055744.0


@kernel(fastmath={"contract"})
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


@kernel(fastmath={"contract"})
def _correlation(t: float) -> float:
    """exp(t) of a non-positive t, cut to zero where it is negligible."""
    e = _exp(max(t, -700.0))
    return e if t > _SMALLEST_EXPONENT else 0.0


@kernel()
def position(i: int, j: int, n: int) -> int:
    """Place of element (i, j), i >= j, of a packed n x n matrix."""
    split, even, lda = (n + 1) // 2, 1 - n % 2, n | 1
    if j < split:
        return j * lda + i + even
    return (i - split + 1 - even) * lda + j - split


@kernel()
def _run(p: int, n: int) -> tuple[int, int, int]:
    """Points whose entries with point p lie side by side: the first, the end, and their place.

    Over all p the runs hold every pair of different points once.
    """
    split = (n + 1) // 2
    if p < split:
        return p + 1, n, position(p, p, n) + 1
    return split, p, position(p, split, n)


@kernel(fastmath={"contract"})
def fill_covariance(
    x: np.ndarray, rates: np.ndarray, variance: float, diagonal: float, out: np.ndarray
) -> None:
    """Write the covariance of the data.

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
    out : ndarray of shape (n (n + 1) / 2,), packed
        Overwritten.
    """
    x1, x2 = x[0], x[1]
    n = x1.size
    for p in range(n):
        out[position(p, p, n)] = diagonal
        first, stop, place = _run(p, n)
        # Slices, so that the loop's index is seen to be non-negative and the loop vectorises.
        run1, run2, run = x1[first:stop], x2[first:stop], out[place : place + stop - first]
        for i in range(run.size):
            d1 = run1[i] - x1[p]
            d2 = run2[i] - x2[p]
            run[i] = variance * _correlation(-(rates[0] * d1 * d1 + rates[1] * d2 * d2))


@kernel(fastmath={"contract"})
def fill_cross_covariance(
    a: np.ndarray, b: np.ndarray, rates: np.ndarray, variance: float, out: np.ndarray
) -> None:
    """Write the covariances between two sets of inputs.

    Parameters
    ----------
    a, b : ndarrays of shape (2, m) and (2, n)
        Inputs.
    rates : ndarray of shape (2,)
        1 / (2 l_d^2).
    variance : float
        alpha^2.
    out : ndarray of shape (m, n)
        Overwritten.
    """
    b1, b2 = b[0], b[1]
    for i in range(a.shape[1]):
        for j in range(b1.size):
            d1 = a[0, i] - b1[j]
            d2 = a[1, i] - b2[j]
            out[i, j] = variance * _correlation(-(rates[0] * d1 * d1 + rates[1] * d2 * d2))


@kernel(fastmath={"contract", "reassoc"})
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
    inverse : ndarray of shape (n (n + 1) / 2,), packed
        K_y^-1.

    Returns
    -------
    pairs, first_axis, second_axis : float
        Sums over pairs of different data of W c, W c rates_1 d_1^2 and W c rates_2 d_2^2.
    trace : float
        The trace of W.
    """
    x1, x2 = x[0], x[1]
    n = x1.size
    pairs = first_axis = second_axis = trace = 0.0
    for p in range(n):
        trace += weights[p] * weights[p] - inverse[position(p, p, n)]
        first, stop, place = _run(p, n)
        run1, run2, run = x1[first:stop], x2[first:stop], inverse[place : place + stop - first]
        run_weights = weights[first:stop]
        for i in range(run.size):
            d1 = run1[i] - x1[p]
            d2 = run2[i] - x2[p]
            t1 = rates[0] * d1 * d1
            t2 = rates[1] * d2 * d2
            wc = (run_weights[i] * weights[p] - run[i]) * _correlation(-(t1 + t2))
            pairs += wc
            first_axis += wc * t1
            second_axis += wc * t2
    return pairs, first_axis, second_axis, trace


@kernel()
def diagonal(n: int, packed: np.ndarray) -> np.ndarray:
    """Copy the diagonal of a packed n x n matrix, in double precision."""
    out = np.empty(n)
    for p in range(n):
        out[p] = packed[position(p, p, n)]
    return out


@kernel()
def append_rows(
    old: int, factor: np.ndarray, above: np.ndarray, corner: np.ndarray, out: np.ndarray
) -> None:
    """Write a triangular matrix whose last rows are new.

    Parameters
    ----------
    old : int
        Size of the matrix before.
    factor : ndarray of shape (>= old (old + 1) / 2,), packed
        Its first rows.
    above : ndarray of shape (old, new)
        The new rows up to the old size, transposed.
    corner : ndarray of shape (new (new + 1) / 2,), packed
        The new rows after it.
    out : ndarray of shape (>= n (n + 1) / 2,), packed, n = old + new
        Overwritten.
    """
    new = above.shape[1]
    n = old + new
    for j in range(old):
        for i in range(j, old):
            out[position(i, j, n)] = factor[position(i, j, old)]
        for i in range(new):
            out[position(old + i, j, n)] = above[j, i]
    for j in range(new):
        for i in range(j, new):
            out[position(old + i, old + j, n)] = corner[position(i, j, new)]
