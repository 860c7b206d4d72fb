"""Reward maps on the query grid: counts of flagged samples, smoothing, normalising, lookup.

A map is an array of ``rows x cols`` nodes; the outer nodes lie on the borders of the extent, row
0 at ``ymin``, column 0 at ``xmin``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import correlate1d, gaussian_filter1d

from infoplan.compiled import kernel

LONG = 1_000_000
"""Radius, in nodes, from which the sum of a Gaussian kernel is its integral."""


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
    for axis, deviation in enumerate(nodes):
        matrix = _smooth_axis(matrix, deviation, axis)
    return matrix


def _smooth_axis(matrix: NDArray[np.float64], sigma: float, axis: int) -> NDArray[np.float64]:
    """Smooth along one axis, in time that does not grow with a kernel longer than the map."""
    n, radius = matrix.shape[axis], math.floor(4 * sigma + 0.5)
    if sigma <= 1e-15:
        return matrix
    if radius <= max(4 * n, 5000):
        return gaussian_filter1d(matrix, sigma, axis=axis, mode="nearest")
    kernel = np.exp(-0.5 * (np.arange(1 - n, n) / sigma) ** 2)
    if radius < LONG:
        whole = 1 + 2 * np.exp(-0.5 * (np.arange(1, radius + 1) / sigma) ** 2).sum()
    else:
        # Of a kernel this long the sum is the integral, up to rounding.
        whole = sigma * math.sqrt(2 * math.pi) * math.erf((radius + 0.5) / (sigma * math.sqrt(2)))
    # What lies beyond an end has the value of the end's node.
    side = (whole - 1) / 2 - np.concatenate([[0.0], np.cumsum(kernel[n:])])
    along = [-1 if other == axis else 1 for other in range(matrix.ndim)]
    first, last = np.take(matrix, [0], axis), np.take(matrix, [n - 1], axis)
    beyond = first * side.reshape(along) + last * side[::-1].reshape(along)
    return (correlate1d(matrix, kernel, axis, mode="constant") + beyond) / whole


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
