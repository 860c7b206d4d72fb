"""Where the robot must not go: polygons, and the test of a step against their edges.

A polygon belongs to the obstacle with its border; the robot may neither be in it nor drive through.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.compiled import kernel
from infoplan.errors import UsageError
from infoplan.robot import inside

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]

MOST_POLYGONS = 1000
"""Of an obstacle; each is part of a run's configuration."""

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


@dataclass(frozen=True, eq=False)
class Obstacles:
    """No-go zones.

    Attributes
    ----------
    polygons
        The vertices of each in turn, shape (k, 2), workspace units. What an odd number of its edges
        parts from afar is in it; an obstacle is in any of them.
    """

    polygons: tuple[Floats, ...] = ()

    @cached_property
    def walls(self) -> Walls:
        """Their edges, as `crosses` takes them."""
        rings = [np.column_stack([p, np.roll(p, -1, axis=0)]) for p in self.polygons]
        edges = np.concatenate(rings) if rings else np.empty((0, 4))
        return _listed(np.ascontiguousarray(edges))

    def contain(self, x: ArrayLike) -> NDArray[np.bool_]:
        """Tell which positions are in an obstacle, shape (n,), from x of shape (n, 2).

        Of the border either may be told.
        """
        points = np.asarray(x, dtype=np.float64).reshape(-1, 2)
        found = np.zeros(len(points), dtype=bool)
        for polygon in self.polygons:
            low, high = polygon.min(axis=0), polygon.max(axis=0)
            near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1) & ~found)
            found[near] = _in_polygon(points[near], polygon)
        return found

    def meet(self, x: ArrayLike) -> int | None:
        """Find the first of some positions in turn, shape (n, 2), that is not reached freely.

        Returns
        -------
        int or None
            Its number; None if all of them, and the straight ways between, are free.
        """
        points = np.ascontiguousarray(x, dtype=np.float64)
        if not self.polygons or not len(points):
            return None
        if self.contain(points[:1])[0]:
            return 0
        for i, (start, end) in enumerate(pairwise(points), start=1):
            if crosses(start[0], start[1], end[0], end[1], self.walls):
                return i
        return None


NOWHERE = Obstacles()
"""No obstacle."""


def obstacles_of(polygons: Sequence[Sequence[Sequence[float]]]) -> Obstacles:
    """Make obstacles of lists of vertices.

    Raises
    ------
    UsageError
        If one is no polygon.
    """
    made = []
    for polygon in polygons:
        try:
            vertices = np.array(polygon, dtype=np.float64)
        except (TypeError, ValueError):
            vertices = np.empty(0)
        if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 3:
            raise UsageError(
                f"terrain.obstacles={[*polygons]} are no polygons: give the vertices of each, at "
                "least three pairs [x,y]"
            )
        if not np.isfinite(vertices).all():
            raise UsageError(f"terrain.obstacles={[*polygons]} must be finite numbers")
        made.append(vertices)
    if len(made) > MOST_POLYGONS:
        raise UsageError(
            f"terrain.obstacles has {len(made)} polygons, and at most {MOST_POLYGONS} can be kept: "
            "join some, or take a coarser mask"
        )
    return Obstacles(tuple(made))


def rectangles(mask: NDArray[np.bool_], extent: Extent) -> list[list[list[float]]]:
    """Cover what is marked on a map by rectangles.

    Parameters
    ----------
    mask
        At the nodes of an even grid over the workspace, borders included, row 0 at ymin, shape
        (rows, columns), at least 2 each.
    extent
        xmin, xmax, ymin, ymax.

    Returns
    -------
    list
        Vertices of each rectangle: together the places whose nearest node is marked.
    """
    ends = []
    for nodes, low, high in zip(mask.shape[::-1], extent[::2], extent[1::2], strict=True):
        middles = low + (np.arange(nodes - 1) + 0.5) * (high - low) / (nodes - 1)
        ends.append([float(low), *middles.tolist(), float(high)])
    open_runs: dict[tuple[int, int], int] = {}
    found = []
    for row in range(mask.shape[0] + 1):
        runs = _runs(mask[row]) if row < mask.shape[0] else []
        ended = [run for run in open_runs if run not in runs]
        found += [(*run, open_runs.pop(run), row) for run in ended]
        for run in runs:
            open_runs.setdefault(run, row)
    x, y = ends
    return [
        [[x[a], y[c]], [x[b], y[c]], [x[b], y[d]], [x[a], y[d]]] for a, b, c, d in sorted(found)
    ]


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


def _in_polygon(points: Floats, polygon: Floats) -> NDArray[np.bool_]:
    """Tell which positions have an odd number of a polygon's edges to their right."""
    odd = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        passes = (ay > y) != (by > y)
        at = ax + (y[passes] - ay) * (bx - ax) / (by - ay) if by != ay else x[passes]
        odd[passes] ^= x[passes] < at
    return odd


def _runs(row: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """List the first and the end of each stretch that is marked."""
    steps = np.diff(np.concatenate([[0], row.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def _listed(edges: Floats) -> Walls:
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
