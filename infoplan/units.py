"""Units of elevations: their names, and from one to another."""

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.wording import harmless

METRES = {"m": 1.0, "ft": 0.3048, "us-ft": 1200 / 3937}
"""Units that are converted into each other, and their lengths in metres."""

SPELLINGS = {
    **dict.fromkeys(["m", "metre", "metres", "meter", "meters"], "m"),
    **dict.fromkeys(["ft", "foot", "feet", "international foot"], "ft"),
    **dict.fromkeys(
        ["us-ft", "ft-us", "ftus", "us survey foot", "us survey feet", "foot_us"], "us-ft"
    ),
}


def unit_name(text: str) -> str:
    """Return the short name of a unit that has several; any other stays as it is."""
    return SPELLINGS.get(text.strip().lower(), text.strip())


def in_unit(
    elevation: NDArray[np.float64], own: str | None, wanted: str | None, what: str
) -> tuple[NDArray[np.float64], str]:
    """Give a map's elevations in the unit that is asked for.

    Parameters
    ----------
    elevation
        Any shape.
    own
        The map's unit, None where it says none: then nothing is converted.
    wanted
        The unit asked for; None: the map's own, metres if it says none.
    what
        What the map is called in a message.

    Returns
    -------
    elevation : ndarray
    unit : str

    Raises
    ------
    UsageError
        If one of two different units is not in `METRES`.
    """
    stated = None if own is None else unit_name(own)
    unit = unit_name(wanted) if wanted is not None else stated or "m"
    if stated in (None, unit):
        return elevation, unit
    if stated not in METRES or unit not in METRES:
        raise UsageError(
            f"terrain.unit={harmless(wanted)} does not fit {what}, which is in "
            f"{harmless(stated)}: leave it out, only "
            f"{', '.join(METRES)} are converted into each other"
        )
    return elevation * (METRES[stated] / METRES[unit]), unit
