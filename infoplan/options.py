"""What an option is: a dataclass field that knows its type, default, bounds and unit.

A configuration is a dataclass of options and of further such dataclasses. What is said of options
anywhere, in checks, help, messages and the YAML files, comes from what `option` records.
"""

import copy
import math
from collections.abc import Iterator
from dataclasses import field, fields, is_dataclass, replace
from typing import Any

from infoplan.errors import UsageError
from infoplan.own import fits

LARGEST_INTEGER = 2**63 - 1
"""What a column of a table can hold."""


def option(
    default: Any,
    doc: str,
    *,
    unit: str = "",
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    choices: tuple[str, ...] = (),
    length: int | None = None,
    science: bool = True,
) -> Any:
    """Declare an option: a dataclass field whose metadata say what values are allowed.

    Parameters
    ----------
    default
        The default value; a list or mapping is copied for each instance.
    doc
        One line for a person.
    unit
        Unit of the value, empty where it has none.
    at_least, above, at_most, below
        Bounds of a number, or of every number in a list.
    choices
        The strings allowed, alone or in a list; for a number, the strings allowed besides.
    length
        Number of entries that a list must have.
    science
        Whether it decides a mission's numbers; False for where a map is found.
    """
    bounds = {"at least": at_least, "above": above, "at most": at_most, "below": below}
    metadata = {
        "doc": doc,
        "unit": unit,
        "bounds": {name: bound for name, bound in bounds.items() if bound is not None},
        "choices": choices,
        "length": length,
        "science": science,
    }
    if isinstance(default, list | dict):
        return field(default_factory=lambda: copy.deepcopy(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def walk(config: object, prefix: str = "") -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Walk over all options of a configuration.

    Yields
    ------
    name : str
        Dotted name, as on the command line.
    value
        Its value.
    metadata : dict
        What `option` recorded, and the ``type``.
    """
    assert is_dataclass(config)
    for item in fields(config):
        value = getattr(config, item.name)
        if is_dataclass(value):
            yield from walk(value, f"{prefix}{item.name}.")
        else:
            yield prefix + item.name, value, {"type": item.type, **item.metadata}


def with_values(choice: Any, **values: Any) -> Any:
    """Copy a choice's options with some of other values, those that it has."""
    own = {item.name for item in fields(choice)}
    return replace(choice, **{name: value for name, value in values.items() if name in own})


def check_options(config: object, prefix: str = "") -> None:
    """Check every option against its own choices and bounds.

    Raises
    ------
    UsageError
        Names the first option that is wrong and what it may be.
    """
    for name, value, metadata in walk(config, prefix):
        _check_option(name, value, metadata)


def requirement(metadata: dict[str, Any]) -> str:
    """Say what values an option takes and what it is, from the metadata that `walk` yields."""
    return f"{allowed_values(metadata)} ({metadata['doc']})"


def allowed_values(metadata: dict[str, Any]) -> str:
    """Say what values an option takes, from the metadata that `walk` yields."""
    kind = str(getattr(metadata["type"], "__name__", metadata["type"]))
    words = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "text"}
    if metadata["choices"]:
        listed = "a list of " if "list" in str(metadata["type"]) else ""
        described = listed + _either(metadata["choices"])
        described += " or a whole number" if metadata["bounds"] else ""
    elif "dict" in str(metadata["type"]):
        described = "a mapping like {name: value}"
    elif "list" in str(metadata["type"]):
        length = metadata["length"]
        described = f"a list of {length} numbers" if length else "a list"
    else:
        described = words.get(kind.split(" | ")[0], "a number or a list")
    if "None" in str(metadata["type"]):
        described += " or null"
    if metadata["bounds"]:
        described += f", {_bounds(metadata)}"
    unit = f" in {metadata['unit']}" if metadata["unit"] else ""
    return f"{described}{unit}"


def plain_number(value: float) -> str:
    """Write a number shortly, but so that it is that very number when it is read again."""
    short = f"{value:g}"
    return short if float(short) == value else repr(float(value))


def _check_option(name: str, value: Any, metadata: dict[str, Any]) -> None:
    choices = metadata["choices"]
    for number in _numbers(value):
        if isinstance(number, float) and not math.isfinite(number):
            raise UsageError(f"{name}={value} must be finite")
        if abs(number) > LARGEST_INTEGER and isinstance(number, int):
            raise UsageError(f"{name}={value} is too large: a whole number has at most 18 digits")
    if not fits(value, metadata["type"]):
        raise UsageError(f"{name}={value} is not possible: {name} must be {requirement(metadata)}")
    if value is None:
        return
    if choices and isinstance(value, list):
        if not value or len(set(value)) < len(value) or not set(value) <= set(choices):
            raise UsageError(
                f"{name}={value} is not possible: use one or several of {', '.join(choices)}, "
                f"each once ({metadata['doc']})"
            )
        return
    if isinstance(value, str):
        if choices and value not in choices:
            besides = " or a whole number" if metadata["bounds"] else " or a number"
            also = besides if metadata["type"] is Any else ""
            if set(value.split(",")) <= set(choices):
                also += " (add -m to run several)"
            raise UsageError(f"{name}={value} is not a choice: use {_either(choices)}{also}")
        return
    length = metadata["length"]
    if length is not None and len(value) != length:
        raise UsageError(f"{name}={value} must have {length} entries ({metadata['doc']})")
    for number in _numbers(value):
        for relation, bound in metadata["bounds"].items():
            if not _holds(number, relation, bound):
                raise UsageError(
                    f"{name}={value} is out of bounds: it must be {_bounds(metadata)} "
                    f"({metadata['doc']})"
                )


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, list):
        for entry in value:
            yield from _numbers(entry)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


def _holds(number: float, relation: str, bound: float) -> bool:
    return {
        "at least": number >= bound,
        "above": number > bound,
        "at most": number <= bound,
        "below": number < bound,
    }[relation]


def _bounds(metadata: dict[str, Any]) -> str:
    return " and ".join(
        f"{relation} {plain_number(bound)}" for relation, bound in metadata["bounds"].items()
    )


def _either(choices: tuple[str, ...]) -> str:
    return " or ".join([", ".join(choices[:-1]), choices[-1]] if len(choices) > 1 else choices)
