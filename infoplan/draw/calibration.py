"""Calibration: how often the truth lies within central intervals of the final model."""

from pathlib import Path

import pandas as pd

from infoplan.analyse.calibration import LEVELS, calibration_curve
from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.line_panels import draw_panels, panel_numbers


def draw(selection: Selection, folder: Path) -> list[Path]:
    """Draw the share of the query grid's nodes within central intervals; returns its files.

    A line a method with its pointwise 95 % t interval over seeds, from the runs that are there. On
    the grey diagonal a model is calibrated; below it, too sure.
    """
    numbers = panel_numbers(selection, coverage)
    labels = ("level of the interval", "share of the map within")
    with style.journal():
        figure, shown = draw_panels(selection, numbers, "level", labels)
        for axes in shown:
            axes.plot([0, 1], [0, 1], color=style.FAINT, lw=0.6, zorder=0)
            axes.set_aspect("equal")
        shown[0].set(xlim=(0, 1), ylim=(0, 1))
        return style.save(figure, folder, "calibration", numbers)


def coverage(run: Selection) -> pd.DataFrame:
    """Share within the intervals of each level, 0 and 1 included, a column a seed.

    A normal distribution has nothing within its interval of level 0, and all within that of 1.
    """
    found = calibration_curve(run, [0.0, *LEVELS, 1.0])
    return found.pivot(index="level", columns="seed", values="covered")
