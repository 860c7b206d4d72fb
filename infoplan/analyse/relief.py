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


class QueryGrid(NamedTuple):
    """The query grid of a mission: number of nodes, and the workspace they span."""

    shape: tuple[int, int]
    extent: tuple[float, float, float, float]


def grid_of(maps: pd.DataFrame) -> QueryGrid:
    """Find the query grid from one mission's map table."""
    x, y = np.unique(maps["x1"]), np.unique(maps["x2"])
    extent = (float(x[0]), float(x[-1]), float(y[0]), float(y[-1]))
    return QueryGrid((len(y), len(x)), extent)


def on_grid(maps: pd.DataFrame, column: str) -> Floats:
    """Return a column of one mission's map table as an array, row 0 at the lowest y."""
    return maps[column].to_numpy(dtype=float).reshape(grid_of(maps).shape)


def local_relief(
    elevation: Floats, extent: tuple[float, float, float, float], radius: float = RADIUS
) -> Floats:
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


def relief_at(samples: pd.DataFrame, maps: pd.DataFrame) -> Floats:
    """Local relief at each sample's nearest node, from one mission's samples and map.

    Returns
    -------
    ndarray, shape (n,)
        The terrain's unit.
    """
    relief = local_relief(on_grid(maps, "truth"), grid_of(maps).extent)
    return relief[nearest_nodes(samples, grid_of(maps))]


def nearest_nodes(
    samples: pd.DataFrame, grid: QueryGrid
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row and column of the query-grid node nearest to each sample; half-way goes up."""
    (rows, columns), (xmin, xmax, ymin, ymax) = grid
    indices = []
    for name, low, high, nodes in (("x2", ymin, ymax, rows), ("x1", xmin, xmax, columns)):
        steps = (samples[name].to_numpy(dtype=float) - low) * (nodes - 1) / (high - low)
        indices.append(np.clip(np.floor(steps + 0.5).astype(np.intp), 0, nodes - 1))
    return indices[0], indices[1]


def by_relief(samples: pd.DataFrame, maps: pd.DataFrame) -> pd.DataFrame:
    """Split a mission's errors and false alarms by terrain relief.

    Parameters
    ----------
    samples, maps
        One mission's tables.

    Returns
    -------
    DataFrame
        One row for each third of the query grid by local relief, `CLASSES`: ``relief`` (its mean
        local relief) and ``rmse`` (final, over its nodes), the terrain's unit; ``clean`` samples
        after the pilot that are no outliers, ``false_alarms`` among them at the end, and their
        ``false_alarm_rate`` (NaN without any).
    """
    truth, mean = on_grid(maps, "truth"), on_grid(maps, "mean")
    relief = local_relief(truth, grid_of(maps).extent)
    # By rank, so that the thirds are equal even where much land is equally flat.
    rank = np.argsort(np.argsort(relief.ravel(), kind="stable")).reshape(relief.shape)
    third = rank * len(CLASSES) // relief.size
    judged = samples[(samples["epoch"] > 0) & ~samples["is_outlier"].astype(bool)]
    third_of_sample = third[nearest_nodes(judged, grid_of(maps))]
    flagged = judged["flagged"].to_numpy(dtype=bool)
    rows = []
    for index, name in enumerate(CLASSES):
        here, sampled = third == index, third_of_sample == index
        clean, alarms = int(sampled.sum()), int((sampled & flagged).sum())
        rows.append(
            {
                "class": name,
                "relief": relief[here].mean(),
                "rmse": _rmse((mean - truth)[here]),
                "clean": clean,
                "false_alarms": alarms,
                "false_alarm_rate": alarms / clean if clean else np.nan,
            }
        )
    return pd.DataFrame(rows)


def _rmse(errors: Floats) -> float:
    """Root mean square; infinite where the squares are."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(errors**2)))
