"""One stored mission as arrays, for the figures that show maps."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

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
        outlier density in samples.
    """

    samples: pd.DataFrame
    table: pd.DataFrame
    extent: Extent
    truth: Floats
    mean: Floats
    std: Floats
    density: Floats

    @property
    def rmse(self) -> float:
        """Final root mean squared error, terrain's unit."""
        return float(np.sqrt(np.mean((self.mean - self.truth) ** 2)))


def mission_maps(
    selection: Selection, method: str, rho: float, scope: str, seed: int
) -> MissionMaps:
    """Load the end of one mission of a method."""
    one = selection.only([str(selection.run(method, rho, scope))], [seed])
    table = load_maps(one)
    maps = {name: on_grid(table, name) for name in ("truth", "mean", "std", "outlier_density")}
    return MissionMaps(load_samples(one), table, grid_of(table).extent, *maps.values())
