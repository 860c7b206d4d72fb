"""A survey as a picture: track and flags, the mean, and its deviation, on scales in metres."""

from itertools import cycle
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

LOG = "log"
"""Column of the samples that tells the log of each."""

COLOURS, LINES, MARKERS = ("0.6", "#56B4E9", "#CC79A7", "#E69F00"), ("-", "--", ":"), "os^D"
"""Of the tracks of several logs, in turn."""


def draw_survey(
    samples: pd.DataFrame, maps: pd.DataFrame, folder: Path, place: str, unit: str
) -> list[Path]:
    """Draw a survey's end.

    Parameters
    ----------
    samples, maps
        Its tables; the samples of several logs with a column ``log``.
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
        _draw_tracks(track, samples)
        kept = samples[~flagged]
        for part, marker in zip(_tracks(kept).values(), cycle(MARKERS), strict=False):
            values = track.scatter(
                part["x1"], part["x2"], c=part["measured"], s=6, cmap=style.ELEVATION, vmin=low,
                vmax=high, zorder=2, marker=marker, linewidths=0,
                rasterized=True,  # a path a sample takes a viewer its time
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
            for part in _tracks(samples).values():
                axes.plot(part["x1"], part["x2"], color="white", lw=0.5, alpha=0.6)
            _mark(axes, samples[flagged], "white")
            style.colour_bar(image, axes, f"{what} {named}".rstrip())
            style.panel(axes, letter, what)
        for axes in (track, *others):
            axes.set(xlabel="m", ylabel="")
        track.set_ylabel("m")
        numbers = samples[[*([LOG] if LOG in samples else []), "x1", "x2", "measured", "flagged",
                           "score"]]  # fmt: skip
        return style.save(drawing, folder, "picture", numbers)


def _tracks(samples: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Part samples by the names of their logs."""
    if LOG not in samples:
        return {"": samples}
    return {str(name): part for name, part in samples.groupby(LOG, sort=False)}


def _draw_tracks(axes: "Axes", samples: pd.DataFrame) -> None:
    """Draw the track of each log; several are told apart by colour and line."""
    tracks = _tracks(samples)
    for number, (name, part) in enumerate(tracks.items()):
        colour, line, width = "0.75", "-", 0.6
        if len(tracks) > 1:
            colour, width = COLOURS[number % len(COLOURS)], 2.6
            line = LINES[number // len(COLOURS) % len(LINES)]
        axes.plot(part["x1"], part["x2"], color=colour, ls=line, lw=width, zorder=1,
                  label=style.inert(name))  # fmt: skip
    if len(tracks) > 1:
        axes.legend(fontsize=6, loc="best", framealpha=0.8)


def _mark(axes: "Axes", flagged: pd.DataFrame, colour: str) -> None:
    """Mark flagged samples."""
    axes.plot(flagged["x1"], flagged["x2"], "x", color=colour, ms=5, mew=1.2, zorder=3)
