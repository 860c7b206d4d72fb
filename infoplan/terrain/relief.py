"""How rugged terrain is, node by node, and the thirds of a grid by it."""

import numpy as np
from numpy.typing import NDArray

from infoplan.extent import Extent

Floats = NDArray[np.float64]

RADIUS = 2.0
"""Radius around a node in which its local relief is taken, workspace units."""

CLASSES = ("flat", "middle", "rugged")
"""The thirds of a grid by local relief."""


def local_relief(elevation: Floats, extent: Extent, radius: float = RADIUS) -> Floats:
    """Highest less lowest elevation among the nodes within a radius of each node.

    On a grid whose nodes lie further apart than the radius, its spacing takes the radius' place.

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
    radius = max(radius, dx, dy)
    # No further than the grid reaches, however small its workspace.
    down, right = (
        min(int(radius / step + 1e-9), nodes - 1) for step, nodes in ((dy, rows), (dx, columns))
    )
    i, j = np.mgrid[-down : down + 1, -right : right + 1]
    disc = np.hypot(i * dy, j * dx) <= radius * (1 + 1e-9)
    # Beyond the border the nearest node is repeated, which the disc holds already.
    highest = maximum_filter(elevation, footprint=disc, mode="nearest")
    return highest - minimum_filter(elevation, footprint=disc, mode="nearest")


def thirds(relief: Floats) -> NDArray[np.intp]:
    """Third of a grid that each node is in by its relief: 0, 1 or 2, the flattest first.

    By rank, so that the thirds are equal even where much land is equally flat.
    """
    rank = np.argsort(np.argsort(relief.ravel(), kind="stable")).reshape(relief.shape)
    return rank * len(CLASSES) // relief.size
