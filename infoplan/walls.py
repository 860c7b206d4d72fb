"""The edges of obstacles, and the test of a step against them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoplan.compiled import kernel
from infoplan.robot import inside

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]

MOST_CELLS = 256
"""Along a side of the raster by which edges are looked up."""


class Walls(NamedTuple):
    """Edges of polygons, listed by the cells of a raster that they may pass through.

    Parameters
    ----------
    edges : ndarray, shape (e, 4)
        x and y of both ends, workspace units.
    low, size : ndarray, shape (2,)
        Lower left corner of the raster, and the sides of a cell.
    starts : ndarray of int64, shape (rows * columns + 1,)
        Where each cell's part of `members` begins, row-major.
    members : ndarray of int64
        Numbers of edges.
    columns : int
        Of the raster.
    """

    edges: Floats
    low: Floats
    size: Floats
    starts: NDArray[np.int64]
    members: NDArray[np.int64]
    columns: int


def walls_of(edges: Floats) -> Walls:
    """List edges by the cells that their bounding boxes meet."""
    if not len(edges):
        nothing = np.zeros(1, dtype=np.int64)
        return Walls(edges, np.zeros(2), np.ones(2), nothing, nothing[:0], 1)
    ends = edges.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    cells = int(min(max(math.isqrt(4 * len(edges)), 1), MOST_CELLS))
    size = np.maximum((high - low) / cells, np.finfo(np.float64).tiny)
    lists: list[list[int]] = [[] for _ in range(cells**2)]
    for number, edge in enumerate(edges.reshape(-1, 2, 2)):
        first, last = (
            [_cell(*place, cells) for place in zip(end, low, size, strict=True)]
            for end in (edge.min(axis=0), edge.max(axis=0))
        )
        for row in range(first[1], last[1] + 1):
            for column in range(first[0], last[0] + 1):
                lists[row * cells + column].append(number)
    starts = np.cumsum([0, *map(len, lists)])
    members = np.array([number for one in lists for number in one], dtype=np.int64)
    return Walls(edges, low, size, starts.astype(np.int64), members, cells)


@kernel()
def crosses(x0: float, y0: float, x1: float, y1: float, walls: Walls) -> bool:
    """Tell whether the straight way between two positions touches an edge.

    Parameters
    ----------
    x0, y0, x1, y1 : float
        Both positions, workspace units.
    walls : Walls
        The edges.

    Returns
    -------
    bool
        True also where an edge is touched only.
    """
    if walls.edges.shape[0] == 0:
        return False
    rows = (walls.starts.shape[0] - 1) // walls.columns
    first = _cell(min(x0, x1), walls.low[0], walls.size[0], walls.columns)
    last = _cell(max(x0, x1), walls.low[0], walls.size[0], walls.columns)
    top = _cell(max(y0, y1), walls.low[1], walls.size[1], rows)
    for row in range(_cell(min(y0, y1), walls.low[1], walls.size[1], rows), top + 1):
        for cell in range(row * walls.columns + first, row * walls.columns + last + 1):
            for place in range(walls.starts[cell], walls.starts[cell + 1]):
                edge = walls.edges[walls.members[place]]
                if _touch(x0, y0, x1, y1, edge[0], edge[1], edge[2], edge[3]):
                    return True
    return False


@kernel()
def is_free(poses: Floats, x: float, y: float, extent: Extent, walls: Walls) -> bool:
    """Tell whether a track stays in the workspace and touches no edge.

    Parameters
    ----------
    poses : ndarray, shape (n, 3)
        ``x1, x2, heading`` at its samples.
    x, y : float
        Where it starts.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax`` of the workspace.
    walls : Walls
        The edges.

    Returns
    -------
    bool
    """
    for i in range(poses.shape[0]):
        if not inside(poses[i, 0], poses[i, 1], extent):
            return False
        if crosses(x, y, poses[i, 0], poses[i, 1], walls):
            return False
        x, y = poses[i, 0], poses[i, 1]
    return True


@kernel()
def _cell(value: float, low: float, size: float, cells: int) -> int:
    """Cell of a coordinate, the outermost one beyond the ends."""
    return int(min(max(math.floor((value - low) / size), 0), cells - 1))


@kernel()
def _side(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Tell by the sign on which side of a line a position is; 0 on it."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@kernel()
def _touch(
    px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Tell whether two segments, p to q and a to b, have a point in common."""
    if max(px, qx) < min(ax, bx) or max(ax, bx) < min(px, qx):
        return False
    if max(py, qy) < min(ay, by) or max(ay, by) < min(py, qy):
        return False
    # Each position is judged by the same arithmetic in every test that it is part of, so that no
    # way slips through between two edges or two steps.
    if _side(ax, ay, bx, by, px, py) * _side(ax, ay, bx, by, qx, qy) > 0.0:
        return False
    return not _side(px, py, qx, qy, ax, ay) * _side(px, py, qx, qy, bx, by) > 0.0
