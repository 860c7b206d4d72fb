"""One stored mission as arrays, for the figures that show maps."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.curves import drawable
from infoplan.analyse.relief import grid_of, on_grid
from infoplan.analyse.tables import Selection, load_maps, load_samples
from infoplan.draw.style import Extent

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MissionMaps:
    """The end of a mission.

    Attributes
    ----------
    samples, table
        Its tables of samples and of maps.
    extent
        xmin, xmax, ymin, ymax of the workspace.
    truth, mean, std, density
        On the query grid, shape (rows, columns), row 0 at the bottom; terrain's unit, the smoothed
        outlier density in samples. NaN where a value is infinite or beyond all measure.
    rmse
        Final root mean squared error, terrain's unit.
    obstacles
        Vertices of each no-go zone.
    """

    samples: pd.DataFrame
    table: pd.DataFrame
    extent: Extent
    truth: Floats
    mean: Floats
    std: Floats
    density: Floats
    rmse: float
    obstacles: list[list[list[float]]]


def mission_maps(
    selection: Selection, method: str, rho: float, scope: str, seed: int
) -> MissionMaps:
    """Load the end of one mission of a method."""
    run = str(selection.run(method, rho, scope))
    one = selection.only([run], [seed])
    table = load_maps(one)
    truth, mean, std, density = (
        on_grid(table, name) for name in ("truth", "mean", "std", "outlier_density")
    )
    with np.errstate(over="ignore", invalid="ignore"):
        rmse = float(np.sqrt(np.mean((mean - truth) ** 2)))
    truth, mean, std = (drawable(values, truth) for values in (truth, mean, std))
    extent = grid_of(table).extent
    obstacles = selection.options[run].get("terrain.obstacles", [])
    return MissionMaps(load_samples(one), table, extent, truth, mean, std, density, rmse, obstacles)
