"""A collapsed model: its smaller lengthscale lies below the distance of two successive samples.

It takes what it is told for noise, and between the tracks predicts the pilot's mean.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from infoplan.config import MissionConfig, is_survey

ROUNDING = 1e-9
"""Share of the distance by which a lengthscale at that very floor may lie below it."""


def spacing_of(config: MissionConfig, pilot: NDArray[np.float64]) -> float:
    """Give the distance of two successive samples of a mission, workspace units.

    Parameters
    ----------
    config
        Its options: the robot's speed is that distance, but for a survey.
    pilot
        Positions of the pilot's measurements, shape (n, 2); of a survey those tell it.
    """
    return spacing_along(pilot) if is_survey(config.terrain.name) else config.robot.speed


def spacing_along(x: NDArray[np.float64]) -> float:
    """Give the usual distance of two successive samples of a track that somebody else drove.

    Parameters
    ----------
    x
        Their positions in order, shape (n, 2).

    Returns
    -------
    float
        The median over those that differ, in the unit of `x`; 0 if none does.
    """
    steps = np.hypot(*np.diff(x, axis=0).T)
    moved = steps[steps > 0]
    return float(np.median(moved)) if len(moved) else 0.0


def has_collapsed(
    lengthscales: Sequence[float], pilot: NDArray[np.float64], spacing: float
) -> bool | None:
    """Tell whether a model has collapsed.

    Parameters
    ----------
    lengthscales
        Along x1 and x2, scaled units; NaN if the kernel has none.
    pilot
        Positions of the pilot's measurements, whose bounding box is two scaled units wide, shape
        (n, 2), workspace units.
    spacing
        Distance of two successive samples, workspace units.

    Returns
    -------
    bool or None
        None if the kernel has no such lengthscales.
    """
    smaller = float(np.min(0.5 * np.asarray(lengthscales) * np.ptp(pilot, axis=0)))
    return None if np.isnan(smaller) else smaller < spacing * (1.0 - ROUNDING)


def counted_ends(ends: Sequence[bool | None]) -> tuple[int, int]:
    """Count the missions that have ended collapsed, and those of which it is known."""
    known = [end for end in ends if end is not None]
    return sum(known), len(known)


def share_text(count: int, known: int) -> str:
    """Write how many missions of a run have ended collapsed: ``3 of 10``; a dash if unknown."""
    return f"{count} of {known}" if known else "-"


def collapse_sentence(ends: Sequence[bool | None]) -> str:
    """Say how many missions have ended so, and what helps.

    Parameters
    ----------
    ends
        Whether the model of each mission has collapsed at its end; None: not known.

    Returns
    -------
    str
        A sentence without its full stop; empty if none has.
    """
    count, known = counted_ends(ends)
    if not count:
        return ""
    missions = f"{count} of {known} missions end" if known > 1 else "the mission ends"
    whose = "their model has" if count > 1 else "its model has"
    return (
        f"{missions} with a lengthscale below the distance of two samples: {whose} collapsed; try "
        "model.restarts=3 (gp, student_t, vecchia), or see docs/collapse.md"
    )
