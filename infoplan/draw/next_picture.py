"""A track ahead as a picture: over the deviation as it is, and as it is expected to become."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.draw import style
from infoplan.lookahead import Track
from infoplan.survey.area import Area

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, TALLEST, FLATTEST = 7.0, 8.0, 2.6
"""Of the picture, inches; its height follows the area's, within these."""

AHEAD, FLAG, ZONE = "#D55E00", "white", "#CC79A7"
"""Colours of the track ahead, of what is flagged, and of zones."""


def draw_track(
    track: Track, area: Area, surveyed: style.Floats, folder: Path, place: str, unit: str
) -> list[Path]:
    """Draw a track ahead.

    Parameters
    ----------
    track, area
        As planned.
    surveyed
        Where the survey's samples lie, shape (n, 2).
    folder
        Where ``picture.png``, the same as PDF, and the track as CSV land.
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
    ratio = (extent[3] - extent[2]) / (extent[1] - extent[0])
    height = min(max(ratio * WIDTH / 2.8 + 0.9, FLATTEST), TALLEST)
    named = f"({style.inert(unit, style.LONGEST_UNIT)})" if unit else ""
    most = float(np.nanmax(track.std_before))
    with style.journal():
        drawing = style.new_figure(WIDTH, height)
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
            axes.plot(*surveyed.T, color="white", lw=0.5, alpha=0.6)
            axes.plot(*track.flagged[~track.revisited].T, "x", color=FLAG, ms=4, mew=1.0)
            axes.plot(*track.flagged[track.revisited].T, "x", color=AHEAD, ms=4, mew=1.0)
            axes.plot(*track.poses[:, :2].T, color=AHEAD, lw=1.2)
            axes.plot(*track.poses[0, :2], "o", color=AHEAD, ms=4)
            axes.plot(*track.poses[-1, :2], "s", color=AHEAD, ms=4)
            axes.set(xlabel="m", ylabel="m" if letter == "a" else "")
            style.panel(axes, letter, what)
        style.colour_bar(image, panels[1], f"standard deviation {named}".rstrip())
        numbers = pd.DataFrame(track.poses, columns=["x1", "x2", "heading"])
        numbers["deviation"] = track.deviation
        return style.save(drawing, folder, "picture", numbers)


def _draw_area(axes: "Axes", area: Area) -> None:
    """Draw the border and the zones, and make room for them."""
    axes.fill(*area.border.T, fill=False, edgecolor="black", lw=0.8)
    for zone in area.zones:
        axes.fill(*zone.T, facecolor="none", edgecolor=ZONE, hatch="///", lw=0.8)
    width, height = np.ptp(area.border, axis=0)
    xmin, xmax, ymin, ymax = area.extent
    axes.set(
        xlim=(xmin - 0.03 * width, xmax + 0.03 * width),
        ylim=(ymin - 0.03 * height, ymax + 0.03 * height),
    )
