"""Fig. 7: where the predictions are wrong, and which samples were kept."""

from pathlib import Path

import numpy as np
import pandas as pd

from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.missions import mission_maps
from infoplan.palette import BLUE

NEEDS = (("UCT-COPOD", 0.1, "batch"), ("PUCT-COPOD", 0.1, "batch"))


def draw(selection: Selection, folder: Path, seed: int) -> list[Path]:
    """Draw Fig. 7 from missions at rho 0.1; returns its files.

    The colours end at the 99th percentile of both maps' errors, so that a single node cannot
    darken or bleach the rest.
    """
    missions = {need[0]: mission_maps(selection, *need, seed) for need in NEEDS}
    errors = {method: np.abs(m.mean - m.truth) for method, m in missions.items()}
    highest = float(np.nanquantile(np.concatenate([e.ravel() for e in errors.values()]), 0.99))
    frames = []
    with style.journal():
        figure = style.new_figure(style.COLUMN, 1.75)
        row = figure.subplots(1, 2, sharey=True)
        for axes, letter, (method, mission) in zip(row, "ab", missions.items(), strict=True):
            image = style.show_map(
                axes, errors[method], mission.extent, cmap=style.ERROR, vmin=0.0, vmax=highest
            )
            style.show_obstacles(axes, mission.obstacles)
            kept = mission.samples[mission.samples["used"].astype(bool)]
            # A white rim lets the dots be seen on black, their blue on white.
            axes.plot(kept["x1"], kept["x2"], "o", color=BLUE, ms=1.7, mec="white", mew=0.25)
            style.panel(axes, letter, f"{method}, seed {seed}")
            nodes = mission.table[["x1", "x2"]].assign(abs_error=errors[method].ravel())
            frames += [
                nodes.assign(method=method, kind="node"),
                kept[["x1", "x2"]].assign(method=method, kind="sample kept"),
            ]
        row[1].set_ylabel("")
        style.colour_bar(
            image,
            row[-1],
            f"absolute error ({style.inert(selection.unit, style.LONGEST_UNIT)})",
            extend="max",
        )
        numbers = pd.concat(frames)[["method", "kind", "x1", "x2", "abs_error"]]
        return style.save(figure, folder, "fig7", numbers)
