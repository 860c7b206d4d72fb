"""Fewer points along a track: the Douglas-Peucker algorithm."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def thinned(x: Floats, tolerance: float) -> NDArray[np.int64]:
    """Choose points of a track such that straight lines between them stay near to all others.

    Parameters
    ----------
    x
        Positions along the track, shape (n, 2), at least two.
    tolerance
        No position is farther than that from the line between the chosen ones around it.

    Returns
    -------
    ndarray of int64
        Numbers of the chosen, ascending, the first and the last among them (Douglas and Peucker,
        1973).
    """
    kept = {0, len(x) - 1}
    open_parts = [(0, len(x) - 1)]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        off = distances_to_line(x[first + 1 : last], x[first], x[last])
        farthest = int(np.argmax(off))
        if off[farthest] > tolerance:
            middle = first + 1 + farthest
            kept.add(middle)
            open_parts += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)


def distances_to_line(x: Floats, a: Floats, b: Floats) -> Floats:
    """Distances of positions, shape (n, 2), to the straight line between two, shape (2,) each."""
    way = b - a
    length = float(way @ way)
    share = np.clip((x - a) @ way / length, 0.0, 1.0) if length else np.zeros(len(x))
    return np.asarray(np.hypot(*(x - (a + share[:, None] * way)).T))
