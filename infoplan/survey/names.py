"""What the columns of a log are, by their names."""

import re
from collections.abc import Mapping, Sequence

from infoplan.errors import UsageError
from infoplan.units import METRES, unit_name
from infoplan.wording import harmless, suggest

ROLES = ("lat", "lon", "x", "y", "value", "time", "date")
"""What a column can be: position in degrees or metres, what was measured, when."""

WORDS = {
    "lat": ("lat", "latitude"),
    "lon": ("lon", "lng", "long", "longitude"),
    "x": ("x", "x1", "east", "easting"),
    "y": ("y", "x2", "north", "northing"),
    "time": ("time", "timestamp", "datetime", "utc", "epoch"),
    "date": ("date", "day"),
}
"""Words by which a name tells its role, small letters."""

VALUES = (
    ("value", "depth", "z", "measured"),
    ("elevation", "elev", "ele", "height", "altitude", "alt"),
)
"""Likewise of what was measured; those of a later line only where there is none of an earlier."""

UNITS = frozenset({"deg", "degree", "degrees", "s", "sec", "seconds", "ms", "cm", "mm", "km"})
"""Units that may end a name, besides lengths (`METRES`)."""

BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*")


def split_name(name: str) -> tuple[list[str], str]:
    """Part the name of a column into its words and its unit.

    Parameters
    ----------
    name
        Such as ``Depth_in_Feet``, ``depth [m]``, ``GPSLatitude``.

    Returns
    -------
    words : list of str
        Small letters.
    unit : str
        As `unit_name` tells it; empty if there is none.
    """
    unit = ""
    if found := BRACKETS.fullmatch(name):
        name, unit = found[1], unit_name(found[2])
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    words = re.findall(r"[a-z0-9]+", apart.lower())
    if not unit and len(words) > 1:
        last = words[-1]
        if unit_name(last) in METRES or last in UNITS:
            unit = unit_name(last)
            words = words[:-2] if words[-2] == "in" and len(words) > 2 else words[:-1]
    return words, unit


def roles_of(names: Sequence[str], given: Mapping[str, str], what: str) -> dict[str, str]:
    """Find the column of each role.

    Parameters
    ----------
    names
        Of all columns.
    given
        Columns that the user has named, by role; the others are recognised.
    what
        What the log is called in a message.

    Returns
    -------
    dict
        Names of columns by role: ``lat`` and ``lon``, or ``x`` and ``y``; ``value``; ``time`` and
        ``date`` where they are there.

    Raises
    ------
    UsageError
        If a role that is needed has no column, or could have several.
    """
    _check_given(names, given, what)
    found = dict(given)
    free = [name for name in names if name not in given.values()]
    for role, words in WORDS.items():
        pair = {"lat": "xy", "lon": "xy", "x": ("lat", "lon"), "y": ("lat", "lon")}.get(role, ())
        if role not in given and not any(other in given for other in pair):
            fitting = [name for name in free if set(split_name(name)[0]) & set(words)]
            if name := _only(fitting, role, what):
                found[role] = name
    degrees, metres = {"lat", "lon"} <= found.keys(), {"x", "y"} <= found.keys()
    if not (degrees or metres):
        raise UsageError(
            f"{what} has no columns of positions that are recognised among {_listed(names)}: name "
            "them lat and lon, or x and y, or say which they are: columns={x: ..., y: ...}"
        )
    for role in ("x", "y") if degrees else ("lat", "lon"):
        found.pop(role, None)
    if "value" not in found:
        found["value"] = _value(names, found, what)
    return found


def _value(names: Sequence[str], found: Mapping[str, str], what: str) -> str:
    """Find what was measured: by its name, or as the only column that is left."""
    left = [name for name in names if name not in found.values()]
    for words in VALUES:
        fitting = [name for name in left if set(split_name(name)[0]) & set(words)]
        if name := _only(fitting, "value", what):
            return name
    if len(left) == 1:
        return left[0]
    raise UsageError(
        f"{what} has no column of values that is recognised among {_listed(names)}: name it depth, "
        "z or value, or say which it is: columns={value: ...}"
    )


def _only(fitting: list[str], role: str, what: str) -> str | None:
    """Take the one column that fits a role; of several the one whose name is no more than it."""
    plain = [name for name in fitting if len(split_name(name)[0]) == 1]
    if len(fitting) > 1 and len(plain) == 1:
        return plain[0]
    if len(fitting) > 1:
        raise UsageError(
            f"{what} has several columns that could be {role}, {_listed(fitting)}: say which it "
            f"is: columns={{{role}: {harmless(fitting[0])}}}"
        )
    return fitting[0] if fitting else None


def _check_given(names: Sequence[str], given: Mapping[str, str], what: str) -> None:
    for role, name in given.items():
        if role not in ROLES:
            raise UsageError(
                f"columns={{{harmless(role)}: ...}} is not possible{suggest(role, ROLES)}: a "
                f"column is one of {', '.join(ROLES)}"
            )
        if name not in names:
            raise UsageError(
                f"columns={{{role}: {harmless(name)}}} is no column of {what}"
                f"{suggest(str(name), names)}: it has {_listed(names)}"
            )


def _listed(names: Sequence[str]) -> str:
    """Write some names of columns, not too many."""
    shown = ", ".join(harmless(name) for name in names[:12])
    return f"{shown} and {len(names) - 12} more" if len(names) > 12 else shown
