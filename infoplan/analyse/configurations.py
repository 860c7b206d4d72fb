"""The configurations of stored runs: options by dotted names, and those in which runs differ."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from infoplan.config import METHODS, MissionConfig
from infoplan.method_identity import REPLAY
from infoplan.methods import OF_THE_MISSION
from infoplan.study.terms import as_meant

Options = dict[str, Any]
"""A configuration with dotted names."""

SWEPT = ("planner.name", "detector.name", "detector.scope", "model.name", "fault.name", "rho")
"""The options that tell a study's runs apart."""

SHOWN = (*SWEPT, "terrain.name", REPLAY, *(f"{group}.function" for group in METHODS))
"""Parts of a configuration that a run's labels tell."""


def stored_options(science: Mapping[str, Any]) -> Options:
    """Give the configuration of a stored run dotted names, those of today."""
    return flatten(as_meant(science))


def flatten(configuration: Mapping[str, Any], prefix: str = "") -> Options:
    """Give a nested configuration dotted names."""
    flat: Options = {}
    for name, value in configuration.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def option_text(value: Any) -> str:
    """Write an option's value as the command line reads it, to the last digit."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{','.join(map(option_text, value))}]"
    return str(value)


def default_options() -> Options:
    """Return the default configuration, dotted names."""
    from infoplan.study.identity import NUMERICS_VERSION

    return flatten({**asdict(MissionConfig()), "numerics_version": NUMERICS_VERSION})


def defaults_of(flat: Options) -> Options:
    """Options that a run of this planner, detector and model has as they come."""
    chosen = dict(default_options())
    for group, choices in METHODS.items():
        name = str(flat[f"{group}.name"])
        kind = "pyod" if name.startswith("pyod_") else name
        if kind in choices and f"{group}.function" not in flat:
            chosen |= flatten({group: asdict(choices[kind])})
    return chosen


def changed_options(options: Options) -> Options:
    """Options of a run that are not the default ones, the labels of the run left out."""
    default = default_options()
    return {
        name: value
        for name, value in options.items()
        if name in default and name not in SWEPT and value != default[name]
    }


def differing(options: Mapping[str, Options]) -> list[str]:
    """Names of the options in which runs differ, those that their labels tell left out.

    Parameters
    ----------
    options
        Configuration of each run, dotted names.

    Returns
    -------
    list of str
        In the order of the configurations. An option that only one planner, detector, model or
        terrain has is compared among its runs alone.
    """
    values: dict[tuple[str, str], set[str]] = {}
    runs: dict[str, list[Options]] = {}
    for flat in options.values():
        for owner in {_owner(flat, name) for name in flat}:
            runs.setdefault(owner, []).append(flat)
    for flat in options.values():
        for name in flat:
            owner = _owner(flat, name)
            if name not in SHOWN and (name, owner) not in values:
                having = [other for other in runs[owner] if name in other]
                values[name, owner] = {repr(other[name]) for other in having}
    return list(dict.fromkeys(name for (name, _), found in values.items() if len(found) > 1))


def _owner(flat: Options, name: str) -> str:
    """Say which planner, detector, model or terrain an option belongs to; empty: to all runs."""
    group, _, option = name.partition(".")
    if group == "terrain":
        return f"terrain {flat.get('terrain.name')}"
    if group not in METHODS or option in OF_THE_MISSION[group]:
        return ""
    choice = str(flat.get(f"{group}.name"))
    schema = METHODS[group].get(choice)
    # Tree searches share their options.
    kind = type(schema).__name__ if schema else flat.get(f"{group}.function") or choice
    return f"{group} {kind}"
