"""The Pareto optimal set of a few vectors."""

import numpy as np
from numpy.typing import NDArray

from infoplan.compiled import kernel


@kernel()
def dominates(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Tell whether one vector dominates another, for maximisation.

    Parameters
    ----------
    a, b : ndarray, shape (D,)
        The two vectors.

    Returns
    -------
    bool
        True if `a` is at least `b` in every objective and above it in one.
    """
    above = False
    for d in range(a.shape[0]):
        if a[d] < b[d]:
            return False
        if a[d] > b[d]:
            above = True
    return above


@kernel()
def mark_pareto_optimal(vectors: NDArray[np.float64], mask: NDArray[np.bool_]) -> None:
    """Mark the Pareto optimal vectors in place, without allocating.

    Parameters
    ----------
    vectors : ndarray, shape (n, D)
        One vector a row.
    mask : ndarray of bool, shape (n,)
        Overwritten: True where no other vector dominates the row.
    """
    for i in range(vectors.shape[0]):
        mask[i] = True
        for j in range(vectors.shape[0]):
            if dominates(vectors[j], vectors[i]):
                mask[i] = False
                break


@kernel()
def pareto_optimal(vectors: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the Pareto optimal set, for maximisation (paper's Selection, PUCT).

    Parameters
    ----------
    vectors : ndarray, shape (n, D)
        One vector a row.

    Returns
    -------
    ndarray of bool, shape (n,)
        True where no other vector is at least as large in every objective and larger in one;
        duplicates of an optimal vector all belong. With ``D = 1`` these are the maximum and its
        exact ties.
    """
    mask = np.empty(vectors.shape[0], dtype=np.bool_)
    mark_pareto_optimal(vectors, mask)
    return mask
