"""A survey as a picture: track and flags, the mean, and its deviation, on scales in metres."""

from itertools import cycle
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.relief import grid_of, on_grid
from infoplan.draw import style
from infoplan.draw.place_layout import (
    beyond,
    end_of_deviation,
    ends_of_mean,
    picture_height,
    with_unit,
)
from infoplan.palette import ORANGE, PURPLE, SKY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, PANEL, AROUND, LEGEND = style.PAGE, 1.65, 0.65, 0.3
"""Of the picture, of a panel, and what titles and a row of the legend take, inches."""

LOG = "log"
"""Column of the samples that tells the log of each."""

IN_A_ROW = 3
"""Logs in a row of the legend, at most."""

MANY = 60
"""Flagged samples from which on their marks get smaller."""

COLOURS, LINES, MARKERS = (style.FAINT, SKY, PURPLE, ORANGE), ("-", "--", ":"), "os^D"
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
        Where ``picture.png`` and the samples that are drawn, as CSV, land.
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
    with style.journal():
        drawing, numbers = survey_figure(samples, maps, place, unit)
        return style.save(drawing, folder, "picture", numbers, in_print=False)


def survey_figure(
    samples: pd.DataFrame, maps: pd.DataFrame, place: str, unit: str
) -> "tuple[Figure, pd.DataFrame]":
    """Make the picture of `draw_survey`, within `infoplan.draw.style.journal`.

    Parameters
    ----------
    samples, maps, place, unit
        As of `draw_survey`.

    Returns
    -------
    figure : Figure
    numbers : DataFrame
        The samples that are drawn.
    """
    extent = grid_of(maps).extent
    mean, std = on_grid(maps, "mean"), on_grid(maps, "std")
    flagged = samples["flagged"].to_numpy(dtype=bool)
    kept = samples[~flagged]
    values_kept = kept["measured"].to_numpy(dtype=float)
    low, high = ends_of_mean(mean, values_kept)
    most = end_of_deviation(std, values_kept)
    names = list(_tracks(samples))
    rows = ceil(len(names) / IN_A_ROW) if len(names) > 1 else 0
    height = picture_height(extent, PANEL, AROUND + LEGEND * rows)
    drawing = style.new_figure(WIDTH, height)
    track, *others = drawing.subplots(1, 3, sharex=True, sharey=True)
    _draw_tracks(track, samples)
    if rows:
        drawing.legend(loc="outside lower center", ncols=min(IN_A_ROW, len(names)))
    for part, marker in zip(_tracks(kept).values(), cycle(MARKERS), strict=False):
        values = track.scatter(
            part["x1"], part["x2"], c=part["measured"], s=6, cmap=style.ELEVATION, vmin=low,
            vmax=high, zorder=2, marker=marker, linewidths=0,
            rasterized=True,  # a path a sample takes a viewer its time
        )  # fmt: skip
    style.frame_workspace(track, extent)
    style.colour_bar(values, track, with_unit("value", unit))
    style.panel(track, "a", f"{style.inert(place)}: {flagged.sum()} flagged")
    _mark(track, samples[flagged])
    for axes, letter, what, grid, cmap, ends in (
        (others[0], "b", "mean", mean, style.ELEVATION, (low, high)),
        (others[1], "c", "standard deviation", std, style.DEVIATION,
         (float(np.nanmin(std)), most)),
    ):  # fmt: skip
        image = style.show_map(axes, grid, extent, cmap=cmap, vmin=ends[0], vmax=ends[1])
        for part in _tracks(samples).values():
            axes.plot(part["x1"], part["x2"], color="white", lw=0.5, alpha=0.6)
        _mark(axes, samples[flagged])
        style.colour_bar(image, axes, with_unit(what, unit), extend=beyond(grid, *ends))
        style.panel(axes, letter, what)
    for axes in (track, *others):
        axes.set(xlabel="m", ylabel="")
    track.set_ylabel("m")
    numbers = samples[[*([LOG] if LOG in samples else []), "x1", "x2", "measured", "flagged",
                       "score"]]  # fmt: skip
    return drawing, numbers


def _tracks(samples: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Part samples by the names of their logs."""
    if LOG not in samples:
        return {"": samples}
    return {str(name): part for name, part in samples.groupby(LOG, sort=False)}


def _draw_tracks(axes: "Axes", samples: pd.DataFrame) -> None:
    """Draw the track of each log; several are told apart by colour and line."""
    tracks = _tracks(samples)
    for number, (name, part) in enumerate(tracks.items()):
        colour, line, width = style.GRID, "-", 0.6
        if len(tracks) > 1:
            colour, width = COLOURS[number % len(COLOURS)], 2.6
            line = LINES[number // len(COLOURS) % len(LINES)]
        axes.plot(part["x1"], part["x2"], color=colour, ls=line, lw=width, zorder=1,
                  label=style.inert(name))  # fmt: skip


def _mark(axes: "Axes", flagged: pd.DataFrame) -> None:
    """Mark flagged samples; many get smaller marks, that the map is still seen."""
    share = min(1.0, max(0.3, (MANY / max(len(flagged), 1)) ** 0.5))
    style.mark(axes, flagged, "flagged", 5 * share)
