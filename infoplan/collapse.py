"""What learning has made of a model: whether it has collapsed, whether it was still on the way.

A collapsed model's smaller lengthscale lies below the distance of two successive samples. It takes
what it is told for noise, and between the tracks predicts the pilot's mean.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from infoplan.config import GpConfig, MissionConfig, ModelConfig, StudentTConfig, is_survey

ROUNDING = 1e-9
"""Share of the distance by which a lengthscale at that very floor may lie below it."""

NEAR_LIMIT = 0.5
"""Share of Adam's learning rate from which on steps count as near it."""

LAST_EPOCHS = 10
"""So many epochs tell whether hyperparameters are still moving at the end."""

GAIN = 100.0
"""Nats that a refit gains where the hyperparameters were far from the optimum."""


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
    missions = _missions_end(count, known)
    whose = "their model has" if count > 1 else "its model has"
    return (
        f"{missions} with a lengthscale below the distance of two samples: {whose} collapsed; try "
        "model.restarts=3 (gp, student_t, vecchia), or see docs/collapse.md"
    )


def rate_of(model: ModelConfig) -> float | None:
    """Give the learning rate that limits how far an iteration moves a hyperparameter's logarithm.

    Returns
    -------
    float or None
        None where nothing does: under L-BFGS or restarts, or in models that start anew in every
        epoch or are the user's own.
    """
    if not isinstance(model, GpConfig | StudentTConfig):
        return None
    if model.optimizer != "adam" or model.restarts:
        return None
    return model.learning_rate


def is_rate_limited(
    before: Mapping[str, float], after: Mapping[str, float], iterations: int, rate: float | None
) -> bool | None:
    """Tell whether an epoch's iterations have moved a hyperparameter about as far as they can.

    Parameters
    ----------
    before, after
        Hyperparameters by name; `noise_std` is learned as its square.
    iterations
        How many they were.
    rate
        From `rate_of`.

    Returns
    -------
    bool or None
        Whether the mean step of a logarithm was at least half of the rate; None without a rate or
        an iteration.
    """
    if rate is None or not iterations:
        return None
    names = list(after)
    ratio = [float(after[name]) / float(before[name]) for name in names]
    powers = [2.0 if name == "noise_std" else 1.0 for name in names]
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = np.abs(np.log(ratio)) * powers
    return bool(np.max(moved) >= NEAR_LIMIT * rate * iterations)


def was_moving(epochs: Sequence[bool | None]) -> bool | None:
    """Tell whether at least half of a mission's last epochs were at the limit of the learning rate.

    Parameters
    ----------
    epochs
        Of each epoch, in order, whether it was; None: not known.
    """
    known = [epoch for epoch in epochs if epoch is not None][-LAST_EPOCHS:]
    return 2 * sum(known) >= len(known) if known else None


def moving_sentence(ends: Sequence[bool | None], explain: bool = True) -> str:
    """Say how many missions have ended while their hyperparameters were on the way.

    Parameters
    ----------
    ends
        Of each mission, from `was_moving`.
    explain
        Whether to lead to ``infoplan explain``, which takes no survey.

    Returns
    -------
    str
        A sentence without its full stop; empty if none has.
    """
    count, known = counted_ends(ends)
    if not count:
        return ""
    return (
        f"{_missions_end(count, known)} with hyperparameters that still move about as fast as "
        "model.learning_rate lets them: learning is not finished"
        + (", and infoplan explain tells what that costs" if explain else "")
    )


def _missions_end(count: int, known: int) -> str:
    return f"{count} of {known} missions end" if known > 1 else "the mission ends"
