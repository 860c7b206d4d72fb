"""Fig. 5: RMSE against the number of samples, mean over seeds with a band, any methods."""

from pathlib import Path

import pandas as pd

from infoplan.analyse.claims import METHODS
from infoplan.analyse.curves import on_common_axis
from infoplan.analyse.tables import Selection, load_curves
from infoplan.draw import style
from infoplan.draw.line_panels import PANELS, draw_panels, panel_numbers
from infoplan.method_identity import NEVER_ERRS, PAPERS_CHOICES

NEEDS = tuple(
    dict.fromkeys(
        (method, rho, "batch" if PAPERS_CHOICES[method][1] in NEVER_ERRS else scope)
        for rho, scope in PANELS.values()
        for method in METHODS
    )
)


def draw(selection: Selection, folder: Path, *, single_seeds: bool = False) -> list[Path]:
    """Draw Fig. 5 from the runs that are there; returns its files.

    A method's band is the pointwise 95 % percentile bootstrap interval of the mean over whole
    seeds; a single seed has none. Infinite errors are gaps, and named.
    """
    numbers = plotted_numbers(selection)
    unit = style.inert(selection.unit, style.LONGEST_UNIT)
    labels = ("collected samples", f"RMSE ({unit})")
    with style.journal():
        figure, shown = draw_panels(
            selection, numbers, "collected", labels, single_seeds=single_seeds
        )
        shown[0].set_ylim(bottom=0)
        shown[0].set_xlim(0, selection.budget)
        return style.save(figure, folder, "fig5", numbers)


def _curves(run: Selection) -> pd.DataFrame:
    """RMSE of a run after numbers of collected samples, a column a seed."""
    return on_common_axis(load_curves(run)).droplevel("run", axis=1)


def plotted_numbers(selection: Selection) -> pd.DataFrame:
    """Return what the figure shows, as of `panel_numbers` over ``collected``."""
    return panel_numbers(selection, _curves)
