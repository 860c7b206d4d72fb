"""A track ahead as the files that plotters, maps and autopilots read."""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from infoplan.files import writing
from infoplan.survey.area import Area
from infoplan.survey.places import Plane
from infoplan.survey.thinning import thinned
from infoplan.wording import harmless

Floats = NDArray[np.float64]

GPX = "http://www.topografix.com/GPX/1/1"

MOST_ITEMS = 700
"""Of a mission, its home among them: about so many do autopilots take."""

WIDENED = 6
"""So many times is a tolerance doubled for a mission to become short enough."""

NARROWED = 20
"""So many times is it halved for the straight lines to keep clear of what the track keeps off."""

MAV_CMD_NAV_WAYPOINT, ABSOLUTE, RELATIVE = 16, 0, 3
"""Of MAVLink: the command, and frames whose altitude is above the sea, or above home."""


@dataclass(frozen=True, eq=False)
class Planned:
    """A track ahead and what belongs to it.

    Attributes
    ----------
    name
        Of the survey.
    poses
        x1, x2, heading at the start and at each sample, shape (n + 1, 3), workspace units.
    mean, deviation
        Expected there, the values' unit, shape (n + 1,).
    speed
        Metres a second.
    waypoints
        Numbers of the positions that a vehicle is steered by, the start first.
    altitude
        Of the waypoints above home, metres.
    flagged, revisited
        Where flagged samples lie, shape (m, 2), and which of them the track comes near to.
    area
        Where it may go.
    plane
        Where its metres lie.
    """

    name: str
    poses: Floats
    mean: Floats
    deviation: Floats
    speed: float
    waypoints: NDArray[np.int64]
    altitude: float
    flagged: Floats
    revisited: NDArray[np.bool_]
    area: Area
    plane: Plane

    @property
    def x(self) -> Floats:
        """Positions, shape (n + 1, 2), workspace units."""
        return self.poses[:, :2]

    @property
    def distance(self) -> Floats:
        """Way to each of them, metres."""
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.x, axis=0).T)))


def choose_waypoints(x: Floats, area: Area, tolerance: float) -> tuple[NDArray[np.int64], float]:
    """Thin a track to waypoints between which straight lines keep to the area, too.

    Parameters
    ----------
    x
        Positions, the start first, shape (n, 2).
    area
        Where the lines must stay.
    tolerance
        How far they may lie from the track, metres: more where there would be too many waypoints,
        less where a line would leave the area.

    Returns
    -------
    waypoints : ndarray of int64
        Numbers of positions.
    tolerance : float
        The one taken.
    """

    def is_free(chosen: NDArray[np.int64]) -> bool:
        return area.obstacles.meet(x[chosen]) is None

    best, taken = np.arange(len(x)), 0.0
    for halved in range(NARROWED + 1):
        if is_free(chosen := thinned(x, tolerance / 2.0**halved)):
            best, taken = chosen, tolerance / 2.0**halved
            break
    for doubled in range(1, WIDENED + 1):
        if len(best) <= MOST_ITEMS:
            break
        if is_free(chosen := thinned(x, tolerance * 2.0**doubled)):
            best, taken = chosen, tolerance * 2.0**doubled
    return best, taken


def write_track(folder: Path, planned: Planned) -> list[Path]:
    """Write a track as ``next.csv`` and ``next.geojson``, in degrees also as GPX and mission.

    Parameters
    ----------
    folder
        Where; it is made.
    planned
        The track.

    Returns
    -------
    list of Path
        Of the files. Those of an earlier track that are not written any more are gone.

    Raises
    ------
    RunError
        If one cannot be written.
    """
    texts: dict[str, str | None] = {"csv": csv_text(planned), "geojson": geojson_text(planned)}
    in_degrees = planned.plane.crs is not None
    texts["gpx"] = gpx_text(planned) if in_degrees else None
    texts["waypoints"] = mission_text(planned) if in_degrees else None
    written = []
    for ending, text in texts.items():
        path = folder / f"next.{ending}"
        unfinished = path.with_name(f".{path.name}")
        with writing(path):
            folder.mkdir(parents=True, exist_ok=True)
            if text is None:
                path.unlink(missing_ok=True)
                continue
            unfinished.write_text(text, encoding="utf-8", newline="\n")
            unfinished.replace(path)
        written.append(path)
    return written


def compass(heading: Floats) -> Floats:
    """Degrees clockwise from the plane's north, of headings in radians from its east."""
    return np.asarray(np.mod(90.0 - np.degrees(heading), 360.0))


def csv_text(planned: Planned) -> str:
    """Write each position of a track as a row of CSV, the start first."""
    metres, distance = planned.plane.metres(planned.x), planned.distance
    columns: dict[str, Iterable[str]] = {
        "sample": map(str, range(len(distance))),
        "distance_m": (f"{value:.3f}" for value in distance),
        "time_s": (f"{value:.2f}" for value in distance / planned.speed),
    }
    if planned.plane.crs is not None:
        lat, lon = planned.plane.degrees(planned.x)
        columns |= {"lat": map(_degrees, lat), "lon": map(_degrees, lon)}
    chosen = np.isin(np.arange(len(distance)), planned.waypoints)
    columns |= {
        "x_m": (f"{value:.3f}" for value in metres[:, 0]),
        "y_m": (f"{value:.3f}" for value in metres[:, 1]),
        "heading_deg": (f"{value:.2f}" for value in compass(planned.poses[:, 2])),
        "mean": (f"{value:.6g}" for value in planned.mean),
        "deviation": (f"{value:.6g}" for value in planned.deviation),
        "waypoint": (str(bool(value)).lower() for value in chosen),
    }
    stream = io.StringIO()
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*columns.values(), strict=True))
    return stream.getvalue()


def gpx_text(planned: Planned) -> str:
    """Write a track as GPX 1.1: a route of its waypoints, and a track of all positions."""
    lat, lon = planned.plane.degrees(planned.x)
    root = ElementTree.Element("gpx", {"xmlns": GPX, "version": "1.1", "creator": "infoplan"})
    name = harmless(planned.name)
    route = ElementTree.SubElement(root, "rte")
    ElementTree.SubElement(route, "name").text = f"{name} next"
    for number, i in enumerate(planned.waypoints):
        point = ElementTree.SubElement(route, "rtept", _position(lat[i], lon[i]))
        ElementTree.SubElement(point, "name").text = str(number) if number else "start"
    track = ElementTree.SubElement(root, "trk")
    ElementTree.SubElement(track, "name").text = f"{name} next"
    segment = ElementTree.SubElement(track, "trkseg")
    for here in zip(lat, lon, strict=True):
        ElementTree.SubElement(segment, "trkpt", _position(*here))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def geojson_text(planned: Planned) -> str:
    """Write a track as GeoJSON: the line, its waypoints, the area, the zones and what is flagged.

    Longitude and latitude, WGS 84; in a plane of the log's own, which GeoJSON does not know, x and
    y in metres.
    """
    plane = planned.plane

    def places(x: Floats) -> list[list[float]]:
        if plane.crs is None:
            return [[round(float(v), 3) for v in pair] for pair in plane.metres(x)]
        lat, lon = plane.degrees(x)
        return [[round(float(a), 9), round(float(b), 9)] for a, b in zip(lon, lat, strict=True)]

    def ring(corners: Floats) -> list[list[list[float]]]:
        return [[*places(corners), *places(corners[:1])]]

    length = float(planned.distance[-1])
    told = {"length_m": round(length, 3), "duration_s": round(length / planned.speed, 2)}
    features = [
        _feature("track", "LineString", places(planned.x), told),
        _feature("waypoints", "MultiPoint", places(planned.x[planned.waypoints])),
        _feature("area", "Polygon", ring(planned.area.border)),
        *(_feature("no-go zone", "Polygon", ring(zone)) for zone in planned.area.zones),
    ]
    for place, met in zip(places(planned.flagged), planned.revisited, strict=True):
        features.append(_feature("flagged", "Point", place, {"revisited": bool(met)}))
    document = {"type": "FeatureCollection", "features": features}
    return json.dumps(document, allow_nan=False) + "\n"


def mission_text(planned: Planned) -> str:
    """Write the waypoints as a mission of ArduPilot, the text format QGC WPL 110.

    A line an item, parted by tabs: number, whether current, frame, command, four parameters,
    latitude, longitude, altitude, whether to go on. Item 0 is home, where the track starts.
    """
    lat, lon = planned.plane.degrees(planned.x[planned.waypoints])
    lines = ["QGC WPL 110"]
    for number, here in enumerate(zip(lat, lon, strict=True)):
        frame, altitude = (RELATIVE, planned.altitude) if number else (ABSOLUTE, 0.0)
        fields = [number, int(number == 0), frame, MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0,
                  *map(_degrees, here), f"{altitude:.3f}", 1]  # fmt: skip
        lines.append("\t".join(map(str, fields)))
    return "\n".join(lines) + "\n"


def _degrees(value: float) -> str:
    """Write degrees to a tenth of a millimetre."""
    return f"{value:.9f}"


def _position(lat: float, lon: float) -> dict[str, str]:
    return {"lat": _degrees(lat), "lon": _degrees(lon)}


def _feature(
    kind: str, shape: str, coordinates: Sequence[Any], told: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": {"kind": kind, **(told or {})}, "geometry": geometry}
