"""A run's `science` in today's terms, and in those of the version that could first fly it."""

from collections.abc import Mapping
from typing import Any

from infoplan.config import METHODS
from infoplan.methods import stored_choice

ADDED_LATER = {
    "model.kernel": "squared_exponential",
    "model.min_lengthscale": 0.0,
    "model.lengthscale_prior": None,
    "model.noise_prior": None,
    "detector.judge_pilot": False,
    "fault.draw": "spike",
    "model.restarts": 0,
    "model.noise_start": "carried",
    "model.optimizer_state": "carried",
    "planner.reward": "std",
    "planner.kappa": 2.0,
    "planner.rollout_step": "action",
    "planner.average": "driven",
    "planner.border": "struck",
    "terrain.obstacles": [],
}
"""Options of groups that runs of earlier versions have not stored, and what they flew with.

With this value they are not stored today either, so that the run keeps its name.
"""

FIRST_FAULT = "spike"
"""The one fault of version 0.1: its options are stored as that did, ``outliers`` without a name."""


def as_stored(meant: Mapping[str, Any]) -> dict[str, Any]:
    """Write what version 0.1 could fly as it did, so that a run keeps its name.

    Parameters
    ----------
    meant
        A run's `science` in today's terms; the inverse of `as_meant`.
    """
    told = {name: dict(part) if isinstance(part, Mapping) else part for name, part in meant.items()}
    for name, value in ADDED_LATER.items():
        group, option = name.split(".")
        if told[group].get(option, ...) == value:
            del told[group][option]
    science: dict[str, Any] = {}
    for name, part in told.items():
        if name != "fault":
            science[name] = part
        if name == "sensor":
            options = told["fault"]
            first = options["name"] == FIRST_FAULT and options.pop("name")
            science["outliers" if first else "fault"] = options
    return science


def as_meant(science: Mapping[str, Any]) -> dict[str, Any]:
    """Say in today's terms what a run's `science` says in those of the version that flew it.

    Parameters
    ----------
    science
        What ``runs/<run>.yaml`` or a footer holds.

    Returns
    -------
    dict
        The same with options that were added later and groups by their present names.
    """
    meant = dict(science)
    if "outliers" in meant:
        meant["fault"] = {"name": FIRST_FAULT, **meant.pop("outliers")}
    for name, value in ADDED_LATER.items():
        group, option = name.split(".")
        choice = METHODS[group].get(stored_choice(meant[group])) if group in METHODS else None
        if group not in METHODS or hasattr(choice, option):
            meant[group] = {option: value, **meant[group]}
    return meant
