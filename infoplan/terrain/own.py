"""A terrain that a function of the user's own makes."""

from typing import Any

import numpy as np

from infoplan.errors import UsageError
from infoplan.own import load, resolve_options
from infoplan.terrain.grids import Grid, check_shape


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
        array = np.asarray(elevation)
    except Exception as error:  # the function is the user's: anything may happen in it
        reason = " ".join(str(error).split())
        raise UsageError(
            f"terrain.function={path} failed, {type(error).__name__}: {reason}"
        ) from error
    if unit is not None and not isinstance(unit, str):
        raise UsageError(
            f"terrain.function={path} returns a {type(unit).__name__} as the unit: return the "
            "elevations, or elevations and unit"
        )
    if array.dtype.kind not in "iuf":
        raise UsageError(
            f"terrain.function={path} returns elevations of type {array.dtype}: they must be "
            "real numbers"
        )
    check_shape(array.shape, f"what {path} returns")
    return Grid(array.astype(np.float64), unit)
