"""Triangular matrices in half the memory of a square.

A symmetric or lower triangular n x n matrix is a vector of n (n + 1) / 2 elements in LAPACK's
rectangular full packed format (Gustavson et al. 2010; TRANSR = 'N', UPLO = 'L'): half the memory
of a square, and still factorised by blocked routines. With n1 = ceil(n / 2) and lda = n rounded up
to odd it is an lda x n1 matrix in Fortran order: the first n1 columns of the lower triangle, and
the rest of it, transposed, in the corner that these leave free.
"""

import numpy as np

from infoplan.compiled import kernel


@kernel()
def position(i: int, j: int, n: int) -> int:
    """Place of element (i, j), i >= j, of a packed n x n matrix."""
    split, even, lda = (n + 1) // 2, 1 - n % 2, n | 1
    if j < split:
        return j * lda + i + even
    return (i - split + 1 - even) * lda + j - split


@kernel()
def run_of(p: int, n: int) -> tuple[int, int, int]:
    """Points whose entries with point p lie side by side: the first, the end, and their place.

    Over all p the runs hold every pair of different points once.
    """
    split = (n + 1) // 2
    if p < split:
        return p + 1, n, position(p, p, n) + 1
    return split, p, position(p, split, n)


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
