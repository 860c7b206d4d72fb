"""Reward maps on the query grid: counts of flagged samples, smoothing, normalising, lookup.

A map is an array of ``rows x cols`` nodes; the outer nodes lie on the borders of the extent, row
0 at ``ymin``, column 0 at ``xmin``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from infoplan.compiled import kernel


@kernel()
def nearest_index(value: float, low: float, high: float, nodes: int) -> int:
    """Return the nearest of the nodes evenly from `low` to `high`.

    Parameters
    ----------
    value : float
        A coordinate, workspace units.
    low, high : float
        The first and the last node.
    nodes : int
        Number of nodes.

    Returns
    -------
    int
        Index of the nearest node; half-way goes up, beyond the ends to the end.
    """
    index = math.floor((value - low) * (nodes - 1) / (high - low) + 0.5)
    return min(max(index, 0), nodes - 1)


@kernel()
def _count(
    x: NDArray[np.float64],
    extent: tuple[float, float, float, float],
    counts: NDArray[np.int64],
) -> None:
    rows, cols = counts.shape
    for i in range(x.shape[0]):
        row = nearest_index(x[i, 1], extent[2], extent[3], rows)
        col = nearest_index(x[i, 0], extent[0], extent[1], cols)
        counts[row, col] += 1


def count_flags(
    x: ArrayLike, extent: tuple[float, float, float, float], shape: tuple[int, int]
) -> NDArray[np.int64]:
    """Count flagged samples at their nearest nodes (the paper's outlier matrix, Fig. 3 (a)).

    Parameters
    ----------
    x : array_like, shape (n, 2)
        Positions of the flagged samples, workspace units.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax``.
    shape : tuple of 2 ints
        ``rows, cols`` of the query grid.

    Returns
    -------
    ndarray of int64, shape (rows, cols)
        Number of samples at each node.
    """
    counts = np.zeros(tuple(shape), dtype=np.int64)
    xmin, xmax, ymin, ymax = (float(bound) for bound in extent)
    _count(np.ascontiguousarray(x, dtype=np.float64), (xmin, xmax, ymin, ymax), counts)
    return counts


def smooth(
    counts: ArrayLike, sigma: float, extent: tuple[float, float, float, float]
) -> NDArray[np.float64]:
    """Smooth an outlier matrix with a Gaussian kernel (paper's Fig. 3 (b)).

    Parameters
    ----------
    counts : array_like, shape (rows, cols)
        Counts at the nodes of the query grid.
    sigma : float
        Standard deviation of the kernel, workspace units, the same along both axes; 0 leaves the
        counts as they are. The kernel is cut at 4 sigma.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax``.

    Returns
    -------
    ndarray, shape (rows, cols)
        The smoothed counts; beyond the border the nearest node's count goes on.
    """
    matrix = np.asarray(counts, dtype=np.float64)
    rows, cols = matrix.shape
    xmin, xmax, ymin, ymax = extent
    # Divided by each axis' node spacing; an axis of a single node has nothing to smooth.
    nodes = (sigma * (rows - 1) / (ymax - ymin), sigma * (cols - 1) / (xmax - xmin))
    return gaussian_filter(matrix, nodes, mode="nearest")


def normalise(reward_map: ArrayLike) -> NDArray[np.float64]:
    """Divide a map by its maximum.

    Parameters
    ----------
    reward_map : array_like, shape (rows, cols)
        Rewards, none negative.

    Returns
    -------
    ndarray, shape (rows, cols)
        Largest value 1; an all-zero map stays zero.
    """
    values = np.asarray(reward_map, dtype=np.float64)
    largest = values.max()
    return values / largest if largest > 0.0 else np.zeros_like(values)
