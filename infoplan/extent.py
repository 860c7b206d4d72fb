"""The extent of a workspace, and what it may be."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError

Extent = tuple[float, float, float, float]

MAX_COORDINATE = 1e9
"""Largest coordinate of a workspace, up or down."""
MIN_SIDE, MIN_SHARE = 1e-6, 1e-9
"""Least side of a workspace, and that as a share of its largest coordinate."""
MAX_ASPECT = 1e6
"""Most that a side may be longer than the other, times."""


def checked_extent(extent: Sequence[float]) -> Extent:
    """Return a workspace's xmin, xmax, ymin, ymax as floats, or raise a `UsageError`."""
    try:
        xmin, xmax, ymin, ymax = (float(bound) for bound in extent)
    except (TypeError, ValueError):
        xmin = xmax = ymin = ymax = math.nan
    if not (-math.inf < xmin < xmax < math.inf and -math.inf < ymin < ymax < math.inf):
        raise UsageError(
            f"terrain.extent={extent} is no workspace: give [xmin,xmax,ymin,ymax], four finite "
            "numbers with xmin < xmax and ymin < ymax"
        )
    largest, sides = max(map(abs, (xmin, xmax, ymin, ymax))), (xmax - xmin, ymax - ymin)
    if largest > MAX_COORDINATE or min(sides) < max(MIN_SIDE, MIN_SHARE * largest):
        raise UsageError(
            f"terrain.extent={extent} is no workspace: its sides must be at least {MIN_SIDE:g} "
            f"and {MIN_SHARE:g} of the largest coordinate, which is at most {MAX_COORDINATE:g}"
        )
    if max(sides) > MAX_ASPECT * min(sides):
        raise UsageError(
            f"terrain.extent={extent} is no workspace: one side is more than {MAX_ASPECT:g} times "
            "as long as the other"
        )
    return xmin, xmax, ymin, ymax


def query_grid(extent: Extent, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Nodes of an even grid over a workspace, borders included.

    Parameters
    ----------
    extent
        xmin, xmax, ymin, ymax.
    shape
        Number of rows along y and of columns along x, at least 2 each.

    Returns
    -------
    ndarray, shape (rows * columns, 2)
        x and y, row-major: x runs fastest.
    """
    rows, columns = shape
    xmin, xmax, ymin, ymax = extent
    y, x = np.meshgrid(
        np.linspace(ymin, ymax, rows), np.linspace(xmin, xmax, columns), indexing="ij"
    )
    return np.column_stack([x.ravel(), y.ravel()])
