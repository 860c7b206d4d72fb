"""A track ahead, in the terminal."""

import numpy as np
from rich.console import Console

from infoplan.draw.table_layout import TextColumn, print_table
from infoplan.lookahead import Track
from infoplan.survey.track_files import Planned
from infoplan.wording import figure


def print_track(track: Track, planned: Planned, unit: str, console: Console) -> None:
    """Print the closing table: how long the track is, and what it is good for.

    Parameters
    ----------
    track, planned
        As planned, and as written.
    unit
        Of the survey's values.
    console
        Where to.
    """
    length = float(planned.distance[-1])
    now, then = float(np.nanmean(track.std_before)), float(np.nanmean(track.std_after))
    columns = [
        TextColumn(title, right=True)
        for title in ("length", "duration", "samples", "waypoints", "mean deviation now",
                      "expected", "flagged places met")
    ]  # fmt: skip
    fall = f"{figure(then)} {unit} ({100 * (then / now - 1):+.0f} %)"
    row = [
        f"{figure(length)} m", duration(length / planned.speed), str(len(planned.poses) - 1),
        str(len(planned.waypoints) - 1), f"{figure(now)} {unit}".rstrip(), fall,
        f"{int(planned.revisited.sum())} of {len(planned.revisited)}",
    ]  # fmt: skip
    print_table(console, "", columns, [row], named=0)


def duration(seconds: float) -> str:
    """Write a time as hours, minutes and seconds, the smaller ones where they count."""
    whole = round(seconds)
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
