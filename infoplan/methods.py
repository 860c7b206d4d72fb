"""Planners, detectors, models, faults by their options: built-in ones, the user's by their path."""

import hashlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from infoplan.config import (
    METHODS,
    OF_COVARIANCE,
    CmaesConfig,
    GatheringConfig,
    MissionConfig,
    OwnDetectorConfig,
    OwnFaultConfig,
    OwnModelConfig,
    OwnPlannerConfig,
    PyodConfig,
)
from infoplan.errors import UsageError
from infoplan.own import load, resolve_options

OWN = (OwnPlannerConfig, OwnDetectorConfig, OwnModelConfig, OwnFaultConfig)

OF_THE_MISSION = {
    "planner": ("name", "execute_actions", "smoothing", "reward", "kappa", "noisy_std"),
    "detector": ("name", "scope", "judge_pilot"),
    "model": ("name", "pilot_iterations", "iterations"),
    "fault": ("name",),
}
"""Options of a method that the mission itself reads; the others are the method's arguments."""

TAKES = {
    "planner": ("situation", "rng"),
    "detector": ("samples", "model", "rng"),
    "model": ("x_pilot", "y_pilot"),
    "fault": ("sensed", "state", "rho", "rng"),
}
"""What a method of each group is called with, besides its options."""


def find(group: str, options: Any) -> Callable[..., Any]:
    """Look a method up and bind its options.

    Parameters
    ----------
    group
        A key of `infoplan.config.METHODS`.
    options
        Its dataclass, out of `infoplan.config.METHODS`.

    Returns
    -------
    callable
        Takes what `TAKES` says.

    Raises
    ------
    UsageError
        If the user's own method cannot be had, or has no such options.
    """
    if isinstance(options, OWN):
        function = load_own(group, options)
        return partial(function, **_own_options(group, options, function))
    arguments = {
        item.name: getattr(options, item.name)
        for item in fields(options)
        if item.name not in OF_THE_MISSION[group]
    }
    return partial(_built_in(group)[options.name], **arguments)


def method_label(options: Any) -> str:
    """Name of a planner, detector, model or fault in tables and names of runs.

    The name of the choice; for a detector of PyOD ``pyod_`` and its class, for a method of the
    user's the name of the function.
    """
    if isinstance(options, OWN):
        return str(options.function).rpartition(".")[2]
    if isinstance(options, PyodConfig):
        return f"pyod_{options.model.lower()}"
    return str(options.name)


def complete(config: MissionConfig) -> MissionConfig:
    """Check what cannot be seen in the options alone, and fill in the defaults of own methods.

    Parameters
    ----------
    config
        Valid (`infoplan.config.validate`).

    Returns
    -------
    MissionConfig
        A copy whose own methods have all their options.

    Raises
    ------
    UsageError
        If an own method cannot be had or called, a detector of PyOD cannot be built, or the
        detector does not go with the model.
    """
    completed = replace(config)
    for group in METHODS:
        options = getattr(config, group)
        if isinstance(options, OWN):
            function = load_own(group, options)
            arguments = _own_options(group, options, function)
            setattr(completed, group, replace(options, options=arguments))
    if isinstance(config.detector, PyodConfig):
        from infoplan.detect.any_pyod import build

        build(config.detector.model, config.detector.contamination, config.detector.params, 0)
    conditioned = config.detector.name == "gp_residual" and isinstance(config.model, OwnModelConfig)
    if conditioned and not hasattr(load_own("model", config.model), "weights_and_inverse"):
        raise UsageError(
            "detector=gp_residual needs a model with a method weights_and_inverse, which "
            f"{method_label(config.model)} has not: use another detector, or model=gp"
        )
    check_covariance(config)
    if isinstance(config.planner, CmaesConfig) and not find_spec("cma"):
        raise UsageError(
            "planner=cmaes needs the package cma: pip install 'infoplan[cmaes]', or use another "
            "planner"
        )
    return completed


def check_covariance(config: MissionConfig) -> None:
    """Refuse a reward of the covariance with a model that does not tell it.

    Raises
    ------
    UsageError
        If the model's class has no method ``covariance``, or cannot be had.
    """
    planner, model = config.planner, config.model
    if not isinstance(planner, GatheringConfig) or planner.reward not in OF_COVARIANCE:
        return
    own = isinstance(model, OwnModelConfig)
    made_by = load_own("model", model) if own else _built_in("model")[model.name]
    if not hasattr(made_by, "covariance"):
        raise UsageError(
            f"planner.reward={planner.reward} needs a model with a method covariance, which "
            f"{method_label(model)} has not: use planner.reward=std, or model=gp"
        )


def stored_methods(config: MissionConfig) -> dict[str, dict[str, Any]]:
    """Give planner, detector, model and fault as they stand in a run's YAML, and decide its hash.

    Parameters
    ----------
    config
        From `complete`.

    Returns
    -------
    dict of dict
        Their options by group; ``name`` is the `method_label`. Of an own method also the SHA-256
        of the file that defines it, so that a changed method is another run.
    """
    described = {}
    for group in METHODS:
        options = getattr(config, group)
        described[group] = asdict(options) | {"name": method_label(options)}
        if isinstance(options, OWN):
            described[group]["sha256"] = _digest(load_own(group, options))
    return described


def stored_choice(values: Mapping[str, Any]) -> str:
    """Name the choice of its group that a method of a run's YAML is, a key of `METHODS`.

    Parameters
    ----------
    values
        What `stored_methods` gave for its group.
    """
    name = str(values["name"])
    if "function" in values:
        return "own"
    return "pyod" if name.startswith("pyod_") else name


def method_from_stored(group: str, values: Mapping[str, Any]) -> Any:
    """Read a group of a run's YAML back into its dataclass.

    Parameters
    ----------
    group
        ``planner``, ``detector`` or ``model``.
    values
        What `stored_methods` gave for it.

    Returns
    -------
    dataclass

    Raises
    ------
    KeyError, TypeError
        If an option is missing or unknown.
    """
    name = stored_choice(values)
    if name not in METHODS[group]:
        raise KeyError(f"{group}={name}")
    schema = METHODS[group][name]
    options = {key: value for key, value in values.items() if key != "sha256"} | {"name": name}
    if absent := {item.name for item in fields(schema)} - set(options):
        raise KeyError(f"{group}.{min(absent)}")
    return type(schema)(**options)


def _built_in(group: str) -> dict[str, Callable[..., Any]]:
    """Methods of a group by name, imported only now: that takes a while."""
    if group == "planner":
        from infoplan.plan import PLANNERS

        return PLANNERS
    if group == "detector":
        from infoplan.detect import DETECTORS

        return DETECTORS
    if group == "fault":
        from infoplan.fault import FAULTS

        return FAULTS
    from infoplan.model import MODELS

    return MODELS


def load_own(group: str, options: Any) -> Callable[..., Any]:
    """Import an own method and check that it may be one of its group.

    Raises
    ------
    UsageError
        If no function is named, it cannot be imported, or it is called like a built-in one.
    """
    name = f"{group}.function"
    if not options.function:
        kind = "Class" if group == "model" else "function"
        raise UsageError(f"{group}=own needs {name}: write it as {name}=module.{kind}")
    function = load(options.function, name)
    if method_label(options) in METHODS[group]:
        raise UsageError(
            f"{name}={options.function} is called like a {group} of infoplan's: give it another "
            "name, by which tables can tell them apart"
        )
    return function


def _own_options(group: str, options: Any, function: Callable[..., Any]) -> dict[str, Any]:
    """Resolve the options of an own method, and check that it can be called with them."""
    resolved = resolve_options(function, options.options, f"{group}.options")
    try:
        inspect.signature(function).bind(*TAKES[group], **resolved)
    except TypeError as error:
        raise UsageError(
            f"{group}.function={options.function} cannot be called as a {group} ({error}): "
            f"it takes ({', '.join(TAKES[group])}, *, options ...)"
        ) from error
    return resolved


def source_file(function: Callable[..., Any]) -> str | None:
    """File of the module that defines a function or class; None if it has none."""
    return getattr(inspect.getmodule(function), "__file__", None)


def _digest(function: Callable[..., Any]) -> str | None:
    """SHA-256 of the file that defines a function or class; None if it has no file."""
    file = source_file(function)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else None
