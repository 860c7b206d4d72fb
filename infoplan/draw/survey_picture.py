"""A survey as a picture: track and flags, the mean, and its deviation, on scales in metres."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.relief import grid_of, on_grid
from infoplan.draw import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, TALLEST, FLATTEST = 9.0, 8.0, 2.6
"""Of the picture, inches; its height follows the place's, within these."""


def draw_survey(
    samples: pd.DataFrame, maps: pd.DataFrame, folder: Path, place: str, unit: str
) -> list[Path]:
    """Draw a survey's end.

    Parameters
    ----------
    samples, maps
        Its tables.
    folder
        Where ``picture.png``, the same as PDF, and the samples that are drawn as CSV land.
    place, unit
        The log's name, and the unit of its values.

    Returns
    -------
    list of Path
        Of the files, the PNG first.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    extent = grid_of(maps).extent
    mean, std = on_grid(maps, "mean"), on_grid(maps, "std")
    low, high = float(np.nanmin(mean)), float(np.nanmax(mean))
    ratio = (extent[3] - extent[2]) / (extent[1] - extent[0])
    height = min(max(ratio * WIDTH / 4 + 1.2, FLATTEST), TALLEST)
    named = f"({style.inert(unit, style.LONGEST_UNIT)})" if unit else ""
    flagged = samples["flagged"].to_numpy(dtype=bool)
    with style.journal():
        drawing = style.new_figure(WIDTH, height)
        track, *others = drawing.subplots(1, 3, sharex=True, sharey=True)
        track.plot(samples["x1"], samples["x2"], color="0.75", lw=0.6, zorder=1)
        kept = samples[~flagged]
        values = track.scatter(
            kept["x1"], kept["x2"], c=kept["measured"], s=5, cmap=style.ELEVATION, vmin=low,
            vmax=high, zorder=2,
        )  # fmt: skip
        style.frame_workspace(track, extent)
        style.colour_bar(values, track, f"value {named}".rstrip())
        style.panel(track, "a", f"{style.inert(place)}: {flagged.sum()} flagged")
        _mark(track, samples[flagged], "#D55E00")
        for axes, letter, what, grid, cmap in (
            (others[0], "b", "mean", mean, style.ELEVATION),
            (others[1], "c", "standard deviation", std, style.DEVIATION),
        ):
            image = style.show_map(axes, grid, extent, cmap=cmap)
            axes.plot(samples["x1"], samples["x2"], color="white", lw=0.5, alpha=0.6)
            _mark(axes, samples[flagged], "white")
            style.colour_bar(image, axes, f"{what} {named}".rstrip())
            style.panel(axes, letter, what)
        for axes in (track, *others):
            axes.set(xlabel="m", ylabel="")
        track.set_ylabel("m")
        numbers = samples[["x1", "x2", "measured", "flagged", "score"]]
        return style.save(drawing, folder, "picture", numbers)


def _mark(axes: "Axes", flagged: pd.DataFrame, colour: str) -> None:
    """Mark flagged samples."""
    axes.plot(flagged["x1"], flagged["x2"], "x", color=colour, ms=5, mew=1.2, zorder=3)
