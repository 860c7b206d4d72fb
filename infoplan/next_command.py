"""What ``infoplan next`` does: where to go now, after a survey."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from infoplan.config import SurveyedConfig
from infoplan.culprit import culprit_named
from infoplan.draw.console import INDENT, say, wide_console
from infoplan.draw.next_picture import draw_track
from infoplan.draw.next_table import print_track
from infoplan.errors import UsageError
from infoplan.extent import query_grid
from infoplan.hydra_front.compose import compose
from infoplan.hydra_front.reconfigure import AHEAD, names_opened, reconfigure
from infoplan.lookahead import look_ahead
from infoplan.methods import method_label
from infoplan.robot import wrap
from infoplan.samples import Samples
from infoplan.study.recall import find_survey, recall, surveyed_samples
from infoplan.survey.area import Area, hull
from infoplan.survey.places import Plane, read_place, read_polygons
from infoplan.survey.track_files import (
    MOST_ITEMS,
    Planned,
    choose_waypoints,
    compass,
    write_track,
)
from infoplan.survey.vehicle import STEPS_ACROSS, steered
from infoplan.trust import admit
from infoplan.wording import counted, figure

Floats = NDArray[np.float64]

FARTHEST = 100_000.0
"""From the survey's end may a polygon reach, metres."""

MOST_SAMPLES = 20_000
"""Of a track."""

LOOKED_AT = 81
"""So many places along a side are looked at for the largest circle."""

TOLERANCE = 0.25
"""Straight lines between waypoints lie so many steps from the track, at most."""


@dataclass(frozen=True)
class Trip:
    """What the command line says about the way.

    Attributes
    ----------
    budget
        Length, metres.
    start
        ``LAT,LON`` or metres; None: where the survey ended.
    heading
        Degrees clockwise from north; None: as the survey ended, or any other.
    inside, avoid
        A polygon to stay in (None: the hull of the survey), polygons to keep out of, as of
        `infoplan.survey.places.read_polygons`.
    turning_radius
        Metres.
    speed
        Metres a second.
    step
        Distance of two samples, metres; None: as in the survey.
    plans
        As of `look_ahead`.
    altitude
        Of a mission's waypoints above home, metres.
    """

    budget: float
    start: str | None
    heading: float | None
    inside: str | None
    avoid: str | None
    turning_radius: float
    speed: float
    step: float | None
    plans: int
    altitude: float


def plan_next(
    results_dir: Path, named: str, trip: Trip, trust: bool, overrides: Sequence[str]
) -> int:
    """Run ``infoplan next``.

    Parameters
    ----------
    results_dir
        The folder of the tables; the track lands in its ``surveys/<run>/next``.
    named
        The survey.
    trip
        The way.
    trust
        As of `infoplan.trust.admit`.
    overrides
        As of `reconfigure`: the planner.

    Returns
    -------
    int
        0.
    """
    console = wide_console()
    names = names_opened(overrides, AHEAD)
    compose(overrides)  # what is wrong there is told whatever the survey
    source = find_survey(results_dir, named)
    admit(source.config, source.science, (), trust, lambda line: say(console, line))
    samples = surveyed_samples(results_dir, source)
    place = source.config.terrain
    plane = Plane(place.crs, (place.origin[0], place.origin[1]))
    usual = source.config.robot.speed
    area = _area(trip, samples, plane, usual)
    pose = _start(trip, samples, plane, area)
    room = _room(trip, area)
    step = min(usual, room / STEPS_ACROSS) if trip.step is None else trip.step
    robot = steered(trip.turning_radius, step, room)
    count = _samples(trip, step, robot.samples_per_action)
    grid, cell = _grid(area, math.prod(source.config.grid))
    base = replace(
        source.config,
        robot=robot,
        grid=grid,
        terrain=SurveyedConfig(name=place.name, extent=list(area.extent)),
    )
    config = reconfigure(base, overrides, AHEAD)
    if "planner.smoothing" not in names:
        config.planner.smoothing = max(source.config.planner.smoothing, cell)
    belief = recall(source, samples, area.extent, grid, area.obstacles)
    with culprit_named(config, "on the way ahead"):
        track = look_ahead(
            belief, config, pose, count, plans=trip.plans, any_heading=trip.heading is None
        )
    if len(track.poses) == 1:
        raise UsageError(
            "there is no room to move from the start, with actions of "
            f"{figure(robot.samples_per_action * step)} m: start elsewhere or with another "
            "heading=, make turning_radius= smaller, the polygon larger or the no-go zones smaller"
        )
    waypoints, tolerance = choose_waypoints(track.poses[:, :2], area, TOLERANCE * step)
    within = area.holds(track.flagged)
    planned = Planned(
        place.name, track.poses, track.mean, track.deviation, trip.speed, waypoints, trip.altitude,
        track.flagged[within], track.revisited[within], area, plane,
    )  # fmt: skip
    folder = results_dir / "surveys" / source.name / "next"
    files = write_track(folder, planned)
    picture = draw_track(
        track, area, samples.x, samples.measured[~samples.flagged], folder, place.name,
        place.unit or "",
    )[0]  # fmt: skip
    say(
        console,
        f"{source.name}: {method_label(config.planner)} from {_told(track.poses[0], plane)}, "
        f"samples {figure(step)} m apart, actions of {figure(robot.samples_per_action * step)} m, "
        f"turning radius {trip.turning_radius:g} m, {trip.speed:g} m/s",
    )
    if len(track.poses) <= count:
        say(console, f"the track ends after {len(track.poses) - 1} of {count} samples: no way on")
    print_track(track, planned, place.unit or "", console)
    say(
        console,
        f"waypoints: straight lines between them lie within {figure(tolerance) or 0} m of the track"
        + _too_many(len(waypoints)),
    )
    if plane.crs is None:
        say(
            console,
            "no GPX and no mission: they are in degrees, and the log is in metres of its own plane "
            "(crs= of infoplan survey places it)",
        )
    say(console, f"{folder}:")
    written = ", ".join(path.name for path in (*files, picture))
    say(console, f"{INDENT}{written}", indent=INDENT)
    return 0


def _area(trip: Trip, samples: Samples, plane: Plane, margin: float) -> Area:
    """Find where the track may go: a polygon less its holes and the no-go zones."""
    zones = []
    if trip.inside is None:
        border = hull(samples.x, margin)
    else:
        polygons = read_polygons(trip.inside, plane, "inside")
        if len(polygons) != 1:
            raise UsageError(
                f"inside= has {len(polygons)} polygons: give the one that the track stays in"
            )
        border, *zones = polygons[0]
        off = float(np.hypot(*(border - samples.x[-1]).T).max())
        if off > FARTHEST:
            raise UsageError(
                f"inside= reaches {_far(off)} from where the survey ended, and may reach "
                f"{_far(FARTHEST)}: lists have LAT,LON or metres, GeoJSON the longitude first"
            )
    if trip.avoid is not None:
        # What a zone has holes in is kept out of as a whole: no way leads into them.
        zones += [rings[0] for rings in read_polygons(trip.avoid, plane, "avoid")]
    return Area(border, tuple(zones))


def _start(trip: Trip, samples: Samples, plane: Plane, area: Area) -> Floats:
    """Find where the track starts, and its heading; it must be in the area."""
    last, heading = samples.x[-1], float(samples.heading[-1])
    if trip.heading is not None:
        heading = wrap(math.radians(90.0 - trip.heading))
    x, what = last, "the survey ended at"
    if trip.start is not None:
        x, what = read_place(trip.start, plane, "from"), f"from={trip.start} is"
    if not area.holds(x[None])[0]:
        off = float(area.clearance(x[None])[0])
        where = f"{what} {_place(x, plane)}, " if trip.start is None else f"{what} "
        if area.encloses(x[None])[0]:
            raise UsageError(f"{where}in a no-go zone: give from= off all zones, in LAT,LON")
        polygon = "the hull of the survey's track" if trip.inside is None else "inside="
        raise UsageError(
            f"{where}{_far(off)} outside of {polygon}: give from= within it, or another inside= "
            f"({'LAT,LON' if plane.crs else 'x,y in metres'} in lists, longitude first in GeoJSON)"
        )
    return np.append(x, heading)


def _room(trip: Trip, area: Area) -> float:
    """Radius of the largest circle that is free, metres; the vehicle must be able to turn in it."""
    nodes = query_grid(area.extent, (LOOKED_AT, LOOKED_AT))
    within = area.holds(nodes)
    room = float(area.clearance(nodes[within]).max()) if within.any() else 0.0
    width, height = np.ptp(area.border, axis=0)
    coarse = 0.5 * math.hypot(width, height) / (LOOKED_AT - 1)
    where = "the hull of the survey's track" if trip.inside is None else "the polygon"
    if trip.turning_radius > room + coarse:
        raise UsageError(
            f"turning_radius={trip.turning_radius:g} does not fit: the largest circle in {where}, "
            f"off all zones, has a radius of {figure(room)} m: make it smaller, or give a larger "
            "inside="
        )
    if trip.step is not None and trip.step > room:
        raise UsageError(
            f"step={trip.step:g} is too long: the largest circle in {where}, off all zones, has a "
            f"radius of {figure(room)} m"
        )
    return max(room, 0.5 * coarse)


def _samples(trip: Trip, step: float, along: int) -> int:
    """Count the samples of a track within its budget, which must have one action at least."""
    count = math.floor(trip.budget / step + 1e-9)
    if count < along:
        raise UsageError(
            f"budget={trip.budget:g} is too small: one action is {figure(along * step)} m, of "
            f"{counted(along, 'sample')}, with turning_radius={trip.turning_radius:g}"
        )
    if count > MOST_SAMPLES:
        raise UsageError(
            f"budget={trip.budget:g} is too large: a track has at most {MOST_SAMPLES} samples, "
            f"{figure(MOST_SAMPLES * step)} m with samples {figure(step)} m apart: make it "
            "smaller, or step= larger"
        )
    return count


def _grid(area: Area, nodes: int) -> tuple[list[int], float]:
    """Spread about so many nodes over an area; returns rows and columns, and their distance."""
    xmin, xmax, ymin, ymax = area.extent
    cell = math.sqrt((xmax - xmin) * (ymax - ymin) / nodes)
    return [max(2, round(side / cell) + 1) for side in (ymax - ymin, xmax - xmin)], cell


def _told(pose: Floats, plane: Plane) -> str:
    """Tell a pose."""
    return f"{_place(pose[:2], plane)}, heading {compass(pose[2:])[0]:.0f} degrees"


def _place(x: Floats, plane: Plane) -> str:
    """Tell a position, in degrees where there are any."""
    if plane.crs is None:
        easting, northing = plane.metres(x[None])[0]
        return f"({easting:.1f}, {northing:.1f}) m"
    (lat,), (lon,) = plane.degrees(x[None])
    return f"({lat:.6f}, {lon:.6f})"


def _far(metres: float) -> str:
    return f"{figure(metres)} m" if metres < 1e4 else f"{figure(metres / 1e3)} km"


def _too_many(waypoints: int) -> str:
    if waypoints <= MOST_ITEMS:
        return ""
    return f"; more than the {MOST_ITEMS} that most autopilots take: upload them in parts"
