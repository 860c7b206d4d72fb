"""From degrees to metres on a plane, and back."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.wording import harmless

Floats = NDArray[np.float64]

POLES = (-80.0, 84.0)
"""Latitudes between which there are UTM zones."""


def utm_zone(lat: Floats, lon: Floats, what: str) -> str:
    """Name the UTM zone, WGS 84, of the middle of some places, as ``EPSG:32619``.

    Raises
    ------
    UsageError
        If they lie too near to a pole.
    """
    turn = np.exp(1j * np.radians(lon)).mean()  # a log may cross 180 degrees
    middle_lat, middle_lon = float(lat.mean()), math.degrees(np.angle(turn))
    if not POLES[0] <= middle_lat <= POLES[1]:
        raise UsageError(
            f"{what} lies at latitude {middle_lat:.4g}, where there is no UTM zone: give a polar "
            "projection, crs=EPSG:3413 in the north or crs=EPSG:3031 in the south"
        )
    zone = int((middle_lon + 180.0) // 6.0) % 60 + 1
    return f"EPSG:{(32600 if middle_lat >= 0 else 32700) + zone}"


def checked_crs(crs: str) -> str:
    """Check that a coordinate reference system is a plane in metres; return its short name.

    Raises
    ------
    UsageError
        If it is not.
    """
    pyproj = _pyproj()
    try:
        known = pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError as error:
        raise UsageError(
            f"crs={harmless(crs)} is not known: give a projection like EPSG:32619 (UTM zone 19 "
            "north)"
        ) from error
    units = {axis.unit_name for axis in known.axis_info[:2]}
    if not known.is_projected or units != {"metre"}:
        raise UsageError(
            f"crs={harmless(crs)} is {known.name}, no plane in metres: give a projection like "
            "EPSG:32619 (UTM zone 19 north)"
        )
    authority = known.to_authority()
    return ":".join(authority) if authority else str(known.to_wkt())


def to_metres(lat: Floats, lon: Floats, crs: str, what: str) -> Floats:
    """Project degrees, WGS 84; returns easting and northing, shape (n, 2).

    Raises
    ------
    UsageError
        If a place cannot be projected.
    """
    transformer = _pyproj().Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    x = np.column_stack(transformer.transform(lon, lat))
    if not np.isfinite(x).all():
        raise UsageError(
            f"{what} has places that {harmless(crs)} does not reach: leave crs= out, and the local "
            "UTM zone is taken"
        )
    return x


def to_degrees(x: Floats, crs: str) -> tuple[Floats, Floats]:
    """Do the reverse of `to_metres`; returns latitudes and longitudes."""
    transformer = _pyproj().Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    lon, lat = transformer.transform(x[:, 0], x[:, 1])
    return lat, lon


def between(x: Floats, crs: str, plane: str, what: str) -> Floats:
    """Put places of another coordinate reference system, x or longitude first, on a plane.

    Raises
    ------
    UsageError
        If the system is not known, or a place cannot be projected.
    """
    pyproj = _pyproj()
    try:
        transformer = pyproj.Transformer.from_crs(crs, plane, always_xy=True)
    except pyproj.exceptions.CRSError as error:
        raise UsageError(
            f"{what} names the coordinate system {harmless(crs)}, which is not known: export it in "
            "WGS 84 (EPSG:4326)"
        ) from error
    found = np.column_stack(transformer.transform(x[:, 0], x[:, 1]))
    if not np.isfinite(found).all():
        raise UsageError(f"{what} has places that {harmless(plane)} does not reach")
    return found


def _pyproj() -> Any:
    try:
        import pyproj
        import pyproj.exceptions
    except ImportError as error:
        raise UsageError(
            "degrees and crs= need pyproj, which is not installed: pip install 'infoplan[survey]', "
            "or give columns x and y in metres, without crs="
        ) from error
    return pyproj
