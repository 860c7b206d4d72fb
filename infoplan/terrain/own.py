"""A terrain that a function of the user's own makes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.own import load, resolve_options
from infoplan.terrain.grids import Grid, check_shape
from infoplan.wording import harmless

LONGEST = 300
"""Characters of an exception that are shown."""


def make(path: str, given: dict[str, Any]) -> Grid:
    """Call a function and take what it returns as a map.

    Parameters
    ----------
    path
        ``module.function``. It returns a two-dimensional array, the first row the y minimum, or a
        pair of it and the elevations' unit.
    given
        Options, the function's keyword-only parameters.

    Returns
    -------
    Grid

    Raises
    ------
    UsageError
        If there is no such function, an option does not fit it, it fails, or returns no map.
    """
    function = load(path, "terrain.function")
    options = resolve_options(function, given, "terrain.options")
    try:
        made = function(**options)
        elevation, unit = made if isinstance(made, tuple) and len(made) == 2 else (made, None)
        array = _as_array(elevation)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the function is the user's: anything may happen in it
        raise UsageError(
            f"terrain.function={path} failed, {type(error).__name__}: {_reason(error)}"
        ) from error
    if unit is not None and not isinstance(unit, str):
        raise UsageError(
            f"terrain.function={path} returns a {type(unit).__name__} as the unit: return the "
            "elevations, or elevations and unit"
        )
    if array.dtype.kind not in "iuf":
        raise UsageError(
            f"terrain.function={path} returns elevations of type {harmless(array.dtype)}: they "
            "must be real numbers, in an array of two dimensions"
        )
    check_shape(array.shape, f"what {path} returns")
    with np.errstate(over="ignore"):  # what a double cannot hold becomes infinite
        return Grid(array.astype(np.float64), unit)


def _as_array(elevation: Any) -> NDArray[Any]:
    """Make an array of what a function returns; masked elevations are missing ones."""
    if isinstance(elevation, np.ma.MaskedArray) and elevation.dtype.kind in "iuf":
        return np.ma.filled(elevation.astype(np.float64), np.nan)
    return np.asarray(elevation)


def _reason(error: BaseException) -> str:
    """Say in a line what an exception says, if it says anything sensible."""
    try:
        reason = " ".join(str(error).split())
    except Exception:  # the exception is the user's, too
        return "its text cannot be read"
    return harmless(reason if len(reason) <= LONGEST else f"{reason[:LONGEST]}...")
