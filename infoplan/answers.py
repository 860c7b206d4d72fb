"""What planners, detectors, models and faults answer, checked: they may be the user's own."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.detect import Judgement
from infoplan.errors import RunError
from infoplan.fault import Corrupted, Sensed
from infoplan.plan import Situation

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def checked_actions(actions: Any, situation: Situation, name: str) -> Integers:
    """Return a planner's actions, if that is what they are, shape (n,).

    None are right only where no action stays in the workspace.

    Raises
    ------
    RunError
        If they are not.
    """
    try:
        plan = np.asarray(actions)
    except (TypeError, ValueError):
        plan = np.array(None)  # lists of different lengths, for example
    if plan.ndim != 1 or (len(plan) and plan.dtype.kind not in "iu"):
        given = " ".join(repr(actions).split())
        raise RunError(
            f"the planner {name} gave {given}: it must return a list of actions, whole numbers"
        )
    if len(plan) and not (plan.min() >= 0 and plan.max() < len(situation.steering)):
        raise RunError(
            f"the planner {name} gave the actions {plan.tolist()}: each must be an index into "
            f"situation.steering, from 0 to {len(situation.steering) - 1}"
        )
    if not len(plan) and (left := situation.valid_actions()):
        raise RunError(
            f"the planner {name} gave no action where {left} stay in the workspace: it may return "
            "none only where situation.valid_actions() is empty"
        )
    return plan.astype(np.int64)


def checked_drive(situation: Situation, actions: Integers, name: str) -> Floats:
    """Drive a plan, shape (samples, 3).

    Raises
    ------
    RunError
        If it is empty or leaves the workspace.
    """
    if not len(actions):
        raise RunError(
            "no action stays in the workspace, whatever the heading: make terrain.extent larger, "
            "terrain.obstacles smaller or the robot's actions shorter"
        )
    trajectory = situation.drive(actions)
    if not situation.stays_inside(trajectory):
        raise RunError(
            f"the planner {name} gave the actions {actions.tolist()}, which leave the workspace or "
            "touch an obstacle: "
            "it must choose among situation.valid_actions(pose), action by action"
        )
    return trajectory


def checked_verdict(verdict: Any, n: int, name: str) -> Judgement:
    """Return a detector's flags and scores, if that is what they are.

    Raises
    ------
    RunError
        If they are not.
    """
    try:
        flagged, score = (np.asarray(part) for part in verdict)
    except (TypeError, ValueError) as error:
        raise RunError(
            f"the detector {name} gave no pair of arrays: it must return (flagged, score)"
        ) from error
    if flagged.shape != (n,) or score.shape != (n,):
        raise RunError(
            f"the detector {name} gave flags of shape {flagged.shape} and scores of shape "
            f"{score.shape}: both must have one entry for each of the {n} samples"
        )
    if flagged.dtype != bool or score.dtype.kind not in "fiu":
        raise RunError(
            f"the detector {name} gave flags of type {flagged.dtype} and scores of type "
            f"{score.dtype}: flags must be true or false, scores numbers"
        )
    return flagged, score.astype(np.float64)


def checked_corruption(said: Any, sensed: Sensed, name: str) -> Corrupted:
    """Return what a fault has made of a batch, if that is what it is.

    Raises
    ------
    RunError
        If it is not, or what it calls sound is not what the sensor said.
    """
    n = len(sensed)
    if not isinstance(said, Corrupted):
        raise RunError(f"the fault {name} gave {type(said).__name__}: it must return a Corrupted")
    measured, labels = np.asarray(said.measured), np.asarray(said.is_outlier)
    if measured.shape != (n,) or labels.shape != (n,):
        raise RunError(
            f"the fault {name} gave measurements of shape {measured.shape} and labels of shape "
            f"{labels.shape}: both must have one entry for each of the {n} samples"
        )
    if measured.dtype.kind not in "fiu" or labels.dtype != bool:
        raise RunError(
            f"the fault {name} gave measurements of type {measured.dtype} and labels of type "
            f"{labels.dtype}: measurements must be numbers, labels true or false"
        )
    if not np.array_equal(measured[~labels], sensed.measured[~labels]):
        raise RunError(
            f"the fault {name} calls samples sound that it has changed: is_outlier must be true "
            "where measured is not sensed.measured"
        )
    return Corrupted(measured.astype(np.float64), labels, said.state)


def checked_prediction(prediction: Any, n: int, name: str) -> tuple[Floats, Floats]:
    """Return a model's mean and standard deviation, if that is what they are.

    Raises
    ------
    RunError
        If they are not.
    """
    try:
        mean, std = (np.asarray(part, dtype=np.float64) for part in prediction)
    except (TypeError, ValueError) as error:
        raise RunError(
            f"the model {name} predicts no pair of arrays: predict must return (mean, std)"
        ) from error
    if mean.shape != (n,) or std.shape != (n,):
        raise RunError(
            f"the model {name} predicts means of shape {mean.shape} and deviations of shape "
            f"{std.shape}: both must have one entry for each of the {n} positions"
        )
    if not (np.isfinite(mean).all() and np.isfinite(std).all() and (std > 0.0).all()):
        raise RunError(
            f"the model {name} predicts something else than finite means and positive deviations: "
            "look at its data and its numerical precision"
        )
    return mean, std


def checked_covariance(covariance: Any, n: int, name: str) -> Floats:
    """Return the covariance that a model tells, if that is what it is, shape (n, n).

    Raises
    ------
    RunError
        If it is not.
    """
    try:
        found = np.asarray(covariance, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (n, n) or not (np.isfinite(found).all() and (np.diag(found) > 0.0).all()):
        raise RunError(
            f"the model {name} tells no covariance: covariance must return {n} rows and columns of "
            "finite numbers with positive variances"
        )
    return found


def number_of(owner: Any, name: str) -> float:
    """Return a number that a model tells of itself; NaN if it does not."""
    return float(getattr(owner, name, np.nan))
