"""Fig. 4: the pilot path, and the final standard deviation without a detector."""

from pathlib import Path

import pandas as pd

from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.missions import mission_maps

NEEDS = (("UCT-NONE", 0.1, "batch"),)


def draw(selection: Selection, folder: Path, seed: int) -> list[Path]:
    """Draw Fig. 4 from a mission of UCT-NONE at rho 0.1; returns its files."""
    mission = mission_maps(selection, *NEEDS[0], seed)
    pilot = mission.samples[mission.samples["epoch"] == 0]
    unit = style.inert(selection.unit, style.LONGEST_UNIT)
    with style.journal():
        figure = style.new_figure(style.COLUMN, 1.6)
        left, right = figure.subplots(1, 2, sharey=True)
        relief = style.show_relief(left, mission.truth, mission.extent)
        left.plot(pilot["x1"], pilot["x2"], ".-", color="white", ms=1.6, lw=0.5, clip_on=False)
        left.plot(*pilot[["x1", "x2"]].iloc[0], "o", color="white", mec=style.INK, ms=3.5, mew=0.7,
                  clip_on=False)  # fmt: skip
        style.panel(left, "a", "pilot path")
        style.colour_bar(relief, left, f"elevation ({unit})")
        deviation = style.show_map(right, mission.std, mission.extent, cmap=style.DEVIATION)
        style.panel(right, "b", "UCT-NONE, final")
        style.colour_bar(deviation, right, f"std. deviation ({unit})")
        right.set_ylabel("")
        for axes in (left, right):
            style.show_obstacles(axes, mission.obstacles)
        path = pilot[["x1", "x2", "truth"]].assign(panel="a")
        deviations = mission.table[["x1", "x2", "truth", "std"]].assign(panel="b")
        numbers = pd.concat([path, deviations])[["panel", "x1", "x2", "truth", "std"]]
        return style.save(figure, folder, "fig4", numbers)
