"""How rugged the terrain is, and what that does to errors and false alarms."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.terrain.relief import CLASSES, local_relief, thirds

Floats = NDArray[np.float64]


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
    third = thirds(relief)
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
