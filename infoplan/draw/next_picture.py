"""A track ahead as a picture: over the deviation as it is, and as it is expected to become."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.draw import style
from infoplan.draw.place_layout import beyond, end_of_deviation, picture_height, with_unit
from infoplan.lookahead import Track
from infoplan.palette import PURPLE, REVISITED, RIM, VERMILLION
from infoplan.survey.area import Area

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, PANEL, AROUND = 7.0, 2.55, 1.15
"""Of the picture, of a panel, and what titles and the legend take, inches."""

AHEAD, ZONE = VERMILLION, PURPLE
"""Colours of the track ahead and of zones."""


def draw_track(
    track: Track,
    area: Area,
    surveyed: style.Floats,
    kept: style.Floats,
    folder: Path,
    place: str,
    unit: str,
) -> list[Path]:
    """Draw a track ahead.

    Parameters
    ----------
    track, area
        As planned.
    surveyed
        Where the survey's samples lie, shape (n, 2).
    kept
        Values of those in the model: the deviation's colours end at theirs.
    folder
        Where ``picture.png`` and the track, as CSV, land.
    place, unit
        The survey's name, and the unit of its values.

    Returns
    -------
    list of Path
        Of the files, the PNG first.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    extent = area.extent
    most = end_of_deviation(track.std_before, kept)
    with style.journal():
        drawing = style.new_figure(WIDTH, picture_height(extent, PANEL, AROUND))
        panels = drawing.subplots(1, 2, sharex=True, sharey=True)
        for axes, letter, what, std in (
            (panels[0], "a", f"{style.inert(place)}: deviation now", track.std_before),
            (panels[1], "b", "expected after the track", track.std_after),
        ):
            image = style.show_map(
                axes, std, extent, cmap=style.DEVIATION, vmin=0.0, vmax=most, smooth=False
            )
            style.frame_workspace(axes, extent)
            _draw_area(axes, area)
            axes.plot(*surveyed.T, color="white", lw=0.8, alpha=0.7, label="surveyed")
            axes.plot(*track.poses[:, :2].T, color=AHEAD, lw=1.2, label="track ahead")
            axes.plot(*track.poses[0, :2], "o", color=AHEAD, ms=4, label="start")
            axes.plot(*track.poses[-1, :2], "s", color=AHEAD, ms=4, label="end")
            _mark_flags(axes, track)
            axes.set(xlabel="m", ylabel="m" if letter == "a" else "")
            style.panel(axes, letter, what)
        style.colour_bar(image, panels[1], with_unit("standard deviation", unit),
                         extend=beyond(track.std_before, 0.0, most))  # fmt: skip
        drawing.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4,
            frameon=True, facecolor=style.FAINT, framealpha=1.0,
        )  # fmt: skip
        numbers = pd.DataFrame(track.poses, columns=["x1", "x2", "heading"])
        numbers["deviation"] = track.deviation
        return style.save(drawing, folder, "picture", numbers, in_print=False)


def _mark_flags(axes: "Axes", track: Track) -> None:
    """Mark what is flagged; what the track meets again has a frame, as on the survey's page."""
    if len(track.flagged):
        flags = pd.DataFrame(track.flagged, columns=["x1", "x2"])
        style.mark(axes, flags, "flagged", label="flagged")
    met = track.flagged[track.revisited]
    if len(met):
        axes.plot(*met.T, "s", mfc="none", mec=RIM, ms=8, mew=2.4, zorder=3)
        axes.plot(*met.T, "s", mfc="none", mec=REVISITED, ms=8, mew=1.2, zorder=3,
                  label="flagged, met")  # fmt: skip


def _draw_area(axes: "Axes", area: Area) -> None:
    """Draw the border and the zones, and make room for them."""
    axes.fill(*area.border.T, fill=False, edgecolor=style.INK, lw=0.8)
    for number, zone in enumerate(area.zones):
        axes.fill(*zone.T, facecolor="none", edgecolor=ZONE, hatch="///", lw=0.8,
                  label="no-go zone" if number == 0 else None)  # fmt: skip
    width, height = np.ptp(area.border, axis=0)
    xmin, xmax, ymin, ymax = area.extent
    axes.set(
        xlim=(xmin - 0.03 * width, xmax + 0.03 * width),
        ylim=(ymin - 0.03 * height, ymax + 0.03 * height),
    )
