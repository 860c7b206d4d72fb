"""How rugged the terrain is, and what that does to errors and false alarms."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RADIUS = 2.0
"""Radius around a node in which its local relief is taken, workspace units."""

CLASSES = ("flat", "middle", "rugged")
"""The thirds of the query grid by local relief."""


class Grid(NamedTuple):
    """The query grid of a mission: number of nodes, and the workspace they span."""

    shape: tuple[int, int]
    extent: tuple[float, float, float, float]


def grid_of(maps: pd.DataFrame) -> Grid:
    """Find the query grid from one mission's map table."""
    x, y = np.unique(maps["x1"]), np.unique(maps["x2"])
    extent = (float(x[0]), float(x[-1]), float(y[0]), float(y[-1]))
    return Grid((len(y), len(x)), extent)


def on_grid(maps: pd.DataFrame, column: str) -> Floats:
    """Return a column of one mission's map table as an array, row 0 at the lowest y."""
    return maps[column].to_numpy(dtype=float).reshape(grid_of(maps).shape)


def local_relief(
    elevation: Floats, extent: tuple[float, float, float, float], radius: float = RADIUS
) -> Floats:
    """Highest less lowest elevation among the nodes within a radius of each node.

    Parameters
    ----------
    elevation
        Shape (rows, columns), the outer nodes on the borders of the extent.
    extent
        xmin, xmax, ymin, ymax, workspace units.
    radius
        Workspace units.

    Returns
    -------
    ndarray, shape (rows, columns)
        The elevation's unit.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    rows, columns = elevation.shape
    dy, dx = (extent[3] - extent[2]) / (rows - 1), (extent[1] - extent[0]) / (columns - 1)
    down, right = int(radius / dy + 1e-9), int(radius / dx + 1e-9)
    i, j = np.mgrid[-down : down + 1, -right : right + 1]
    disc = np.hypot(i * dy, j * dx) <= radius * (1 + 1e-9)
    # Beyond the border the nearest node is repeated, which the disc holds already.
    highest = maximum_filter(elevation, footprint=disc, mode="nearest")
    return highest - minimum_filter(elevation, footprint=disc, mode="nearest")
