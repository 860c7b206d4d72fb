"""Fig. 5: RMSE against the number of samples, mean over seeds with a band, any methods."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.claims import METHODS
from infoplan.analyse.curves import collapsed_ends, on_common_axis
from infoplan.analyse.tables import Selection, load_curves
from infoplan.draw import style
from infoplan.draw.line_panels import PANELS, draw_panels, panel_numbers
from infoplan.method_identity import NEVER_ERRS, PAPERS_CHOICES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOM = 1.5
"""The highest point of a line, times this, is as far as a panel reaches."""

NEEDS = tuple(
    dict.fromkeys(
        (method, rho, "batch" if PAPERS_CHOICES[method][1] in NEVER_ERRS else scope)
        for rho, scope in PANELS.values()
        for method in METHODS
    )
)


def draw(selection: Selection, folder: Path, *, single_seeds: bool = False) -> list[Path]:
    """Draw Fig. 5 from the runs that are there; returns its files.

    A method's band is the pointwise 95 % t interval of the mean over seeds; a single seed has
    none. Infinite errors are gaps, and named.
    """
    numbers = plotted_numbers(selection)
    with style.journal():
        return style.save(
            curves_figure(selection, numbers, single_seeds=single_seeds), folder, "fig5", numbers
        )


def curves_figure(
    selection: Selection, numbers: pd.DataFrame, *, single_seeds: bool = False
) -> "Figure":
    """Make the picture of `draw` from its numbers, within `infoplan.draw.style.journal`."""
    unit = style.inert(selection.unit, style.LONGEST_UNIT)
    labels = ("collected samples", f"RMSE ({unit})")
    figure, shown = draw_panels(selection, numbers, "collected", labels, single_seeds=single_seeds)
    # The 95 % band of two seeds is thirteen standard errors wide: it may leave the panel.
    drawn = np.concatenate([line.get_ydata() for axes in shown for line in axes.get_lines()])
    highest = drawn[np.isfinite(drawn) & (drawn > 0)].max(initial=0.0)
    top = shown[0].get_ylim()[1]
    shown[0].set_ylim(0, min(top, ROOM * highest) if highest else top)
    shown[0].set_xlim(0, selection.budget)
    return figure


def plotted_numbers(selection: Selection) -> pd.DataFrame:
    """Return what the figure shows.

    Returns
    -------
    DataFrame
        As of `panel_numbers` over ``collected``, with ``collapsed``: how many of the seeds end with
        a collapsed model; NaN if that is not known.
    """
    collapsed: dict[str, float] = {}

    def lines(run: Selection) -> pd.DataFrame:
        curves = load_curves(run)
        ends = collapsed_ends(curves, run.results_dir).values()
        (name,) = run.options
        collapsed[name] = np.nan if None in ends else sum(map(bool, ends))
        return on_common_axis(curves).droplevel("run", axis=1)

    numbers = panel_numbers(selection, lines)
    where = list(numbers).index("n") + 1
    numbers.insert(where, "collapsed", numbers["run"].map(collapsed))
    return numbers
