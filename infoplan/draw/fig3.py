"""Fig. 3: the outlier matrix, raw and smoothed."""

from pathlib import Path

import numpy as np

from infoplan.analyse.relief import grid_of, nearest_nodes
from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.missions import MissionMaps, mission_maps

NEEDS = (("PUCT-COPOD", 0.1, "batch"),)


def draw(selection: Selection, folder: Path, seed: int) -> list[Path]:
    """Draw Fig. 3 from a mission of PUCT-COPOD at rho 0.1; returns its files."""
    mission = mission_maps(selection, *NEEDS[0], seed)
    counts = outlier_matrix(mission)
    with style.journal():
        figure = style.new_figure(style.COLUMN, 1.65)
        left, right = figure.subplots(1, 2, sharey=True)
        seen = np.where(counts > 0, counts, np.nan)
        raw = style.show_map(left, seen, mission.extent, cmap=style.DENSITY, vmin=0, smooth=False)
        style.panel(left, "a", "flagged samples")
        smooth = style.show_map(right, mission.density, mission.extent, cmap=style.DENSITY)
        style.panel(right, "b", "smoothed")
        right.set_ylabel("")
        for axes in (left, right):
            style.show_obstacles(axes, mission.obstacles)
        style.colour_bar(raw, left, "count", whole=True)
        style.colour_bar(smooth, right, "count per node")
        numbers = mission.table[["x1", "x2"]].assign(
            count=counts.ravel(), smoothed=mission.density.ravel()
        )
        return style.save(figure, folder, "fig3", numbers)


def outlier_matrix(mission: MissionMaps) -> np.ndarray:
    """Count the flagged samples at their nearest nodes, shape (rows, columns)."""
    flagged = mission.samples[mission.samples["flagged"].astype(bool)]
    counts = np.zeros(mission.truth.shape)
    np.add.at(counts, nearest_nodes(flagged, grid_of(mission.table)), 1)
    return counts
