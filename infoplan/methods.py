"""Planners, detectors and models by their options: built-in by name, the user's by dotted path."""

import hashlib
import inspect
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path
from types import CodeType
from typing import Any

from infoplan.config import (
    METHODS,
    MissionConfig,
    OwnDetectorConfig,
    OwnModelConfig,
    OwnPlannerConfig,
    PyodConfig,
)
from infoplan.errors import RunError, UsageError
from infoplan.own import find_source, load, resolve_options
from infoplan.wording import harmless

OWN = (OwnPlannerConfig, OwnDetectorConfig, OwnModelConfig)

OF_THE_MISSION = {
    "planner": ("name", "execute_actions", "smoothing", "noisy_std"),
    "detector": ("name", "scope"),
    "model": ("name", "pilot_iterations", "iterations"),
}
"""Options of a method that the mission itself reads; the others are the method's arguments."""

TAKES = {
    "planner": ("situation", "rng"),
    "detector": ("samples", "model", "rng"),
    "model": ("x_pilot", "y_pilot"),
}
"""What a method of each group is called with, besides its options."""


def find(group: str, options: Any) -> Callable[..., Any]:
    """Look a method up and bind its options.

    Parameters
    ----------
    group
        ``planner``, ``detector`` or ``model``.
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
        function = _load(group, options)
        return partial(function, **_own_options(group, options, function))
    arguments = {
        item.name: getattr(options, item.name)
        for item in fields(options)
        if item.name not in OF_THE_MISSION[group]
    }
    return partial(_built_in(group)[options.name], **arguments)


def method_label(options: Any) -> str:
    """Name of a planner, detector or model in tables and names of runs.

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
            function = _load(group, options)
            arguments = _own_options(group, options, function)
            setattr(completed, group, replace(options, options=arguments))
    if isinstance(config.detector, PyodConfig):
        from infoplan.detect.any_pyod import build

        build(config.detector.model, config.detector.contamination, config.detector.params, 0)
    conditioned = config.detector.name == "gp_residual" and isinstance(config.model, OwnModelConfig)
    if conditioned and not hasattr(_load("model", config.model), "weights_and_inverse"):
        raise UsageError(
            "detector=gp_residual needs a model with a method weights_and_inverse, which "
            f"{method_label(config.model)} has not: use another detector, or model=gp"
        )
    return completed


def stored_methods(config: MissionConfig) -> dict[str, dict[str, Any]]:
    """Give planner, detector and model as they stand in a run's YAML, and decide its hash.

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
            described[group]["sha256"] = _digest(_load(group, options))
    return described


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
    name = values["name"]
    if "function" in values:
        name = "own"
    elif name.startswith("pyod_"):
        name = "pyod"
    if name not in METHODS[group]:
        raise KeyError(f"{group}={name}")
    schema = METHODS[group][name]
    options = {key: value for key, value in values.items() if key != "sha256"} | {"name": name}
    if absent := {item.name for item in fields(schema)} - set(options):
        raise KeyError(f"{group}.{min(absent)}")
    return type(schema)(**options)


def admit(
    config: MissionConfig,
    science: Mapping[str, Any],
    named: Collection[str],
    trust: bool,
    tell: Callable[[str], object],
) -> None:
    """Let functions that a stored run names be imported, or refuse; none is imported here.

    Parameters
    ----------
    config, science
        The run's configuration, as a record and as it is stored. Only its detector and model
        count: a stored mission's planner is never asked again.
    named
        Groups whose function the command line itself names.
    trust
        Whether the others may be imported, if their files are those that were flown with.
    tell
        Is given a line for each function that will be imported.

    Raises
    ------
    UsageError
        Names the function, and what to do.
    """
    for group in ("detector", "model"):
        options = getattr(config, group)
        if not isinstance(options, OWN):
            continue
        path = str(options.function)
        option, file = f"{group}.function={path}", find_source(path)
        if group not in named and not trust:
            raise UsageError(
                harmless(
                    f"the stored run's {group} is the function {path} ({file or 'not found here'}),"
                    f" which would be imported and run: if you trust it, give {option} or "
                    "trust=true"
                )
            )
        stored = science[group].get("sha256")
        if group not in named and stored is not None:
            found = hashlib.sha256(file.read_bytes()).hexdigest() if file else None
            if found != stored:
                raise UsageError(
                    harmless(
                        f"the stored run's {group} {path} is not what it was flown with: "
                        + (f"{file} has the SHA-256 {found}" if file else "its file is not here")
                        + f", the run says {stored}; {option} takes what is here"
                    )
                )
        tell(harmless(f"importing {path} from {file or 'Python itself'}"))


@contextmanager
def culprit_named(config: MissionConfig, doing: str) -> Iterator[None]:
    """Turn what goes wrong in the user's code, or in PyOD, into a `RunError` that says where.

    Parameters
    ----------
    config
        The mission's.
    doing
        What was going on, for the message.
    """
    try:
        yield
    except (UsageError, RunError):
        raise
    except Exception as error:
        calls = [(frame.f_code, line) for frame, line in traceback.walk_tb(error.__traceback__)]
        group = _culprit(config, [code for code, _ in calls])
        if group is None:
            raise
        options = getattr(config, group)
        file, line = next(
            (code.co_filename, line)
            for code, line in reversed(calls)
            if _is_of(group, options, code.co_filename)
        )
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RunError(
            f"the {group} {method_label(options)} failed {doing}: {reason} "
            f"({Path(file).name}, line {line})"
        ) from error


def _built_in(group: str) -> dict[str, Callable[..., Any]]:
    """Methods of a group by name, imported only now: that takes a while."""
    if group == "planner":
        from infoplan.plan import PLANNERS

        return PLANNERS
    if group == "detector":
        from infoplan.detect import DETECTORS

        return DETECTORS
    from infoplan.model import MODELS

    return MODELS


def _culprit(config: MissionConfig, codes: list[CodeType]) -> str | None:
    """Find the group whose method was called, by the outermost call that is one's own.

    Several methods may be in one file: it alone tells only where no method is seen in its calls,
    as with a decorator that fails.
    """
    for by_file in (False, True):
        for code in codes:
            for group in METHODS:
                options = getattr(config, group)
                if _is_of(group, options, code.co_filename) and (
                    by_file or _is_part(code.co_qualname, group, options)
                ):
                    return group
    return None


def _is_part(name: str, group: str, options: Any) -> bool:
    """Tell whether a qualified name in an own method's file is that method's or in it.

    True of a method that has no name of its own, such as an instance, and of all that PyOD has.
    """
    if not isinstance(options, OWN):
        return True
    method = _load(group, options)
    if not hasattr(method, "__qualname__"):
        return True
    # Of a class also those that it derives from: their methods are its own.
    parts = inspect.getmro(method) if inspect.isclass(method) else (method,)
    return any(f"{name}.".startswith(f"{part.__qualname__}.") for part in parts)


def _is_of(group: str, options: Any, filename: str) -> bool:
    """Tell whether a file defines an own method, or belongs to PyOD where that is the detector."""
    if isinstance(options, OWN):
        return filename == _file(_load(group, options))
    return isinstance(options, PyodConfig) and "pyod" in Path(filename).parts


def _load(group: str, options: Any) -> Callable[..., Any]:
    """Import an own method and check that it may be one of its group."""
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


def _file(function: Callable[..., Any]) -> str | None:
    """File of the module that defines a function or class."""
    return getattr(inspect.getmodule(function), "__file__", None)


def _digest(function: Callable[..., Any]) -> str | None:
    """SHA-256 of the file that defines a function or class; None if it has no file."""
    file = _file(function)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else None
