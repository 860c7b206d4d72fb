"""Places that people name: positions and polygons, in degrees or metres, put on a log's plane."""

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.files import read_regular, user_path
from infoplan.survey.projection import between, to_degrees
from infoplan.wording import harmless

Floats = NDArray[np.float64]
Rings = list[Floats]
"""A polygon: its border, then its holes, each shape (k, 2), workspace units."""

MOST_CORNERS = 2000
"""Of a polygon."""

MAX_FILE = 1 << 24
"""Size of a GeoJSON file, in bytes, at most."""

LEAST_AREA = 1e-6
"""Of a polygon, as a share of the square of its longer side."""

DEGREES = "EPSG:4326"
"""Longitude and latitude, WGS 84."""

MOST_LAT, MOST_LON = 90.0, 360.0

FORM = "[[LAT,LON],[LAT,LON],[LAT,LON]], or the path of a GeoJSON file"


@dataclass(frozen=True)
class Plane:
    """Where a log's positions are metres.

    Attributes
    ----------
    crs
        Coordinate reference system, as ``EPSG:32619``; None: a plane of the log's own.
    origin
        Easting and northing where the workspace begins.
    """

    crs: str | None
    origin: tuple[float, float]

    def metres(self, x: Floats) -> Floats:
        """Give easting and northing of places of the workspace, shape (n, 2)."""
        return x + np.array(self.origin)

    def degrees(self, x: Floats) -> tuple[Floats, Floats]:
        """Give latitude and longitude, WGS 84, of places of the workspace; the plane has a crs."""
        assert self.crs is not None
        return to_degrees(self.metres(x), self.crs)


def read_place(text: str, plane: Plane, option: str) -> Floats:
    """Read a position: ``LAT,LON``, or easting and northing.

    Parameters
    ----------
    text
        As typed.
    plane
        The log's.
    option
        What a message calls it.

    Returns
    -------
    ndarray, shape (2,)
        Workspace units.

    Raises
    ------
    UsageError
        If it is none.
    """
    wanted = "LAT,LON, or easting and northing in metres" if plane.crs else "x,y in metres"
    pairs = _pairs([_parsed(f"[{text.strip().strip('[]()')}]")])
    if pairs is None:
        raise UsageError(f"{option}={harmless(text)} is no position: give {wanted}")
    return _on_plane(pairs, plane, option)[0]


def read_polygons(text: str, plane: Plane, option: str) -> list[Rings]:
    """Read polygons: a list of corners, or of such lists, or a GeoJSON file.

    Parameters
    ----------
    text, plane, option
        As of `read_place`.

    Returns
    -------
    list of list of ndarray
        Of each its border, then its holes.

    Raises
    ------
    UsageError
        If they cannot be read, or one has no area or crosses itself.
    """
    if not text.lstrip().startswith("["):
        found = _from_geojson(user_path(text), plane, option)
    else:
        listed = _parsed(text)
        rings = [listed] if _pairs(listed) is not None else listed
        found = [[_on_plane(_ring(ring, text, option), plane, option)] for ring in rings or [None]]
    return [[_checked(ring, option) for ring in polygon] for polygon in found]


def _parsed(text: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return None


def _pairs(listed: Any) -> Floats | None:
    """Make an array of pairs of numbers; None if they are none."""
    try:
        pairs = np.array(listed, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    fits = pairs.ndim == 2 and pairs.shape[1] == 2 and np.isfinite(pairs).all()
    return pairs if fits else None


def _ring(listed: Any, text: str, option: str) -> Floats:
    pairs = _pairs(listed)
    if pairs is None:
        shown = harmless(text if len(text) < 80 else f"{text[:77]}...")
        raise UsageError(f"{option}={shown} is no polygon: give {FORM}")
    return pairs


def _on_plane(pairs: Floats, plane: Plane, option: str) -> Floats:
    """Put pairs as people write them, degrees or metres by their size, on the workspace."""
    if plane.crs is None:
        return pairs - np.array(plane.origin)
    in_degrees = (np.abs(pairs) <= [MOST_LAT, MOST_LON]).all(axis=1)
    if in_degrees.all():
        metres = between(pairs[:, ::-1], DEGREES, plane.crs, option)
    elif in_degrees.any():
        first = pairs[~in_degrees][0]
        raise UsageError(
            f"{option} has places in degrees and others that are none, like "
            f"({first[0]:g}, {first[1]:g}): give all as LAT,LON, or all in metres of {plane.crs}"
        )
    else:
        metres = pairs
    return metres - np.array(plane.origin)


def _from_geojson(path: Path, plane: Plane, option: str) -> list[Rings]:
    """Read the polygons of a GeoJSON file."""
    what = f"{option}={harmless(path)}"
    try:
        document = json.loads(read_regular(path, MAX_FILE))
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise UsageError(f"{what} cannot be read ({reason}): give {FORM}") from error
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{what} is no GeoJSON: give {FORM}") from error
    found = []
    for rings in _polygons_of(document):
        if not isinstance(rings, list) or not rings:
            raise UsageError(f"{what} has a polygon without corners: mend it")
        made = []
        for ring in rings:
            pairs = _pairs([point[:2] if isinstance(point, list) else point for point in ring]
                           if isinstance(ring, list) else None)  # fmt: skip
            if pairs is None:
                raise UsageError(f"{what} has corners that are no pairs of numbers: mend it")
            made.append(_geojson_metres(pairs, document, plane, what) - np.array(plane.origin))
        found.append(made)
    if not found:
        raise UsageError(f"{what} holds no polygon: draw one, and export it as GeoJSON")
    return found


def _polygons_of(part: Any) -> Iterator[Any]:
    """Find the coordinates of all polygons of a GeoJSON object."""
    if not isinstance(part, dict):
        return
    if part.get("type") == "Polygon":
        yield part.get("coordinates")
    elif part.get("type") == "MultiPolygon":
        yield from part.get("coordinates") or []
    else:
        yield from _polygons_of(part.get("geometry"))
        for name in ("features", "geometries"):
            for one in part.get(name) or []:
                yield from _polygons_of(one)


def _geojson_metres(pairs: Floats, document: dict[str, Any], plane: Plane, what: str) -> Floats:
    """Project a ring of a GeoJSON file: longitude first, unless the file names another system."""
    name = _named_crs(document.get("crs"))
    if plane.crs is None:
        if name is not None:
            raise UsageError(
                f"{what} is in {harmless(name)}, and the survey's log in metres of its own plane: "
                "give metres of that plane, and no crs"
            )
        return pairs
    if name is not None and not name.endswith("CRS84"):
        return between(pairs, name, plane.crs, what)
    if (np.abs(pairs) > [MOST_LON, MOST_LAT]).any():
        raise UsageError(
            f"{what} is not in degrees, as GeoJSON is: export it in WGS 84 (EPSG:4326)"
        )
    return between(pairs, DEGREES, plane.crs, what)


def _named_crs(told: Any) -> str | None:
    """Read which coordinate system a file names, as GeoJSON of before RFC 7946 may."""
    properties = told.get("properties") if isinstance(told, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return None if name is None else str(name)


def _checked(ring: Floats, option: str) -> Floats:
    """Return the corners of a ring, none repeated, counter-clockwise, if it is one."""
    apart = np.any(ring != np.roll(ring, 1, axis=0), axis=1)
    corners = ring[apart]
    if len(corners) < 3:
        raise UsageError(f"{option} has a polygon of fewer than three corners: give at least three")
    if len(corners) > MOST_CORNERS:
        raise UsageError(
            f"{option} has a polygon of {len(corners)} corners, more than the {MOST_CORNERS} that "
            "it may have: simplify it"
        )
    signed = signed_area(corners)
    longest = float(np.ptp(corners, axis=0).max())
    if (met := _crossing(corners)) is not None:
        raise UsageError(
            f"{option} has a polygon that crosses itself, between its corners {met[0] + 1} and "
            f"{met[1] + 1}: give the corners in their order along the border"
        )
    if abs(signed) <= LEAST_AREA * longest**2:
        raise UsageError(f"{option} has a polygon without area: its corners lie on a line")
    return corners if signed > 0 else corners[::-1]


def signed_area(corners: Floats) -> float:
    """Area of a polygon by its corners, shape (k, 2); positive if they go counter-clockwise."""
    x, y = (corners - corners[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _crossing(corners: Floats) -> Sequence[int] | None:
    """Find two edges of a ring, by their first corners, that meet and are not neighbours."""
    ends = np.roll(corners, -1, axis=0)
    n = len(corners)
    for i in range(n - 2):
        others = np.arange(i + 2, n if i else n - 1)
        a, b, c, d = corners[i], ends[i], corners[others], ends[others]
        apart = (_side(a, b, c) * _side(a, b, d) > 0) | (_side(c, d, a) * _side(c, d, b) > 0)
        low, high = np.minimum(a, b), np.maximum(a, b)
        far = (np.maximum(c, d) < low).any(axis=1) | (np.minimum(c, d) > high).any(axis=1)
        if len(met := np.flatnonzero(~(apart | far))):
            return i, int(others[met[0]])
    return None


def _side(a: Floats, b: Floats, c: Floats) -> Floats:
    """Tell by the sign on which side of the line from a to b places lie."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
