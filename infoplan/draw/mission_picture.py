"""A mission as a picture: track and flags on the mean, the deviation, and how the error went."""

from typing import TYPE_CHECKING

import pandas as pd

from infoplan.analyse.curves import drawable
from infoplan.analyse.relief import grid_of, on_grid
from infoplan.draw import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def mission_figure(curves: pd.DataFrame, samples: pd.DataFrame, maps: pd.DataFrame) -> "Figure":
    """Make the picture of a mission, within `infoplan.draw.style.journal`.

    Parameters
    ----------
    curves, samples, maps
        Its tables.
    """
    extent = grid_of(maps).extent
    flagged = samples[samples["flagged"].to_numpy(dtype=bool)]
    figure = style.new_figure(style.PAGE, 2.2)
    mean, deviation, error = figure.subplots(1, 3)
    for axes, letter, column, title, cmap in (
        (mean, "a", "mean", f"mean, {len(flagged)} flagged", style.ELEVATION),
        (deviation, "b", "std", "standard deviation", style.DEVIATION),
    ):
        image = style.show_map(axes, on_grid(maps, column), extent, cmap=cmap)
        axes.plot(samples["x1"], samples["x2"], color="white", lw=0.5, alpha=0.7)
        style.mark(axes, flagged, "flagged", 4.0)
        style.colour_bar(image, axes, "terrain's unit")
        style.panel(axes, letter, title)
    _draw_error(error, curves)
    return figure


def _draw_error(axes: "Axes", curves: pd.DataFrame) -> None:
    """Draw the RMSE of each evaluation; nobody knows it where the truth is unknown."""
    rmse = curves["rmse"]
    if rmse.notna().any():
        axes.plot(curves["collected"], drawable(rmse, rmse), ".-", ms=3)
        axes.set_ylim(bottom=0)
    else:
        axes.text(0.5, 0.5, "truth unknown", ha="center", va="center", transform=axes.transAxes)
    axes.set(xlabel="collected samples", ylabel="RMSE (terrain's unit)")
    axes.spines[["top", "right"]].set_visible(False)
    style.panel(axes, "c", "error of the mean")
