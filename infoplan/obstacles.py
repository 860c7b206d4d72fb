"""Where the robot must not go: polygons.

A polygon belongs to the obstacle with its border; the robot may neither be in it nor drive through.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.errors import UsageError

if TYPE_CHECKING:
    from infoplan.walls import Walls

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]

MOST_POLYGONS = 1000
"""Of an obstacle; each is part of a run's configuration."""


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
    def walls(self) -> "Walls":
        """Their edges, as `crosses` takes them."""
        from infoplan.walls import walls_of  # imports Numba, which only missions need

        rings = [np.column_stack([p, np.roll(p, -1, axis=0)]) for p in self.polygons]
        edges = np.concatenate(rings) if rings else np.empty((0, 4))
        return walls_of(np.ascontiguousarray(edges))

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
        from infoplan.walls import crosses

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
