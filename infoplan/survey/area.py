"""Where a track ahead may go: within a polygon, and off no-go zones."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from infoplan.extent import Extent
from infoplan.obstacles import Obstacles
from infoplan.survey.thinning import distances_to_line

Floats = NDArray[np.float64]

CIRCLE = 16
"""Corners by which a hull is widened."""


@dataclass(frozen=True, eq=False)
class Area:
    """A polygon and the no-go zones in it.

    Attributes
    ----------
    border
        Its corners, shape (k, 2), workspace units.
    zones
        The corners of each zone.
    obstacles
        What must not be touched: all around the polygon, and the zones.
    """

    border: Floats
    zones: tuple[Floats, ...] = ()
    obstacles: Obstacles = field(init=False)

    def __post_init__(self) -> None:
        """Make an obstacle of what is not the polygon."""
        object.__setattr__(self, "obstacles", Obstacles((_around(self.border), *self.zones)))

    @property
    def extent(self) -> Extent:
        """The smallest xmin, xmax, ymin, ymax that hold it."""
        (xmin, ymin), (xmax, ymax) = self.border.min(axis=0), self.border.max(axis=0)
        return float(xmin), float(xmax), float(ymin), float(ymax)

    def holds(self, x: Floats) -> NDArray[np.bool_]:
        """Tell which places, shape (n, 2), are in the polygon and in no zone."""
        return self.encloses(x) & ~Obstacles(self.zones).contain(x)

    def encloses(self, x: Floats) -> NDArray[np.bool_]:
        """Tell which places, shape (n, 2), are in the polygon, zones or not."""
        return Obstacles((self.border,)).contain(x)

    def clearance(self, x: Floats) -> Floats:
        """Distance of places, shape (n, 2), to the nearest edge of the polygon or of a zone."""
        nearest = np.full(len(x), np.inf)
        for ring in (self.border, *self.zones):
            for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                nearest = np.minimum(nearest, distances_to_line(x, a, b))
        return nearest


def hull(x: Floats, margin: float) -> Floats:
    """Corners of the convex hull of some places, shape (n, 2), and of a margin around it."""
    turns = np.linspace(0.0, 2.0 * np.pi, CIRCLE, endpoint=False)
    circle = margin * np.column_stack([np.cos(turns), np.sin(turns)])
    outer = x[ConvexHull(x).vertices]
    widened = (outer[:, None] + circle).reshape(-1, 2)
    return np.asarray(widened[ConvexHull(widened).vertices])


def _around(border: Floats) -> Floats:
    """Make one polygon of the surroundings of another: a frame, and a cut to the hole in it."""
    low, high = border.min(axis=0), border.max(axis=0)
    margin = float((high - low).max())
    (left, bottom), (right, top) = low - margin, high + margin
    # From its leftmost corner straight to the left no edge is in the way.
    ring = np.roll(border, -int(np.argmin(border[:, 0])), axis=0)
    cut = [left, ring[0, 1]]
    frame: Sequence[Sequence[float]] = [
        cut, [left, bottom], [right, bottom], [right, top], [left, top], cut,
    ]  # fmt: skip
    return np.concatenate([np.array(frame), ring, ring[:1]])
