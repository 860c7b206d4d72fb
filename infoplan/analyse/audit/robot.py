"""Checks of where the robot went: Bezier pilot, steps, actions, turns on the spot, workspace."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from infoplan.analyse.audit.stored import ROUNDING, FaultError, Floats, StoredMission, demand
from infoplan.wording import counted


def check_pilot(mission: StoredMission) -> str:
    """Check that the pilot samples lie on the Bezier curve, even in its parameter."""
    n = mission.n_pilot
    xmin, xmax, ymin, ymax = mission.extent
    fractions = np.asarray(mission.option("pilot.control_points"), dtype=np.float64)
    points = np.array([xmin, ymin]) + fractions * np.array([xmax - xmin, ymax - ymin])
    curve = BPoly(points[:, None, :], [0.0, 1.0])
    expected = curve(np.linspace(0.0, 1.0, n))
    away = np.hypot(*(mission.x[:n] - expected).T)
    demand(
        away <= mission.length_tolerance,
        lambda i: f"{mission.place(i)} is {away[i]:.3g} off the Bezier curve",
    )
    tangent = curve.derivative()(1.0)
    if np.hypot(*tangent) > mission.length_tolerance:
        turn = _wrapped(mission.samples["heading"][n - 1] - math.atan2(tangent[1], tangent[0]))
        if not abs(turn) <= ROUNDING:
            raise FaultError(f"{mission.place(n - 1)} heads {turn:.3g} rad off the curve's end")
    return f"{n} samples within {away.max():.1g} of a curve of degree {len(points) - 1}"


def _driven(mission: StoredMission) -> tuple[Floats, NDArray[np.int64]]:
    """Work out the direction in which each sample after the pilot was driven to.

    Returns
    -------
    direction : ndarray, shape (n - n_pilot,)
        Heading before the move, turns on the spot included, radians.
    spot_turns : ndarray of int, shape (n - n_pilot,)
        Turns of pi/8 before the move, modulo 16; 0 but at the first sample of an epoch.
    """
    start = mission.n_pilot - 1
    heading = mission.samples["heading"].to_numpy()[start:-1]
    step = np.diff(mission.x[start:], axis=0)
    first = np.diff(mission.epoch[start:]) != 0
    eighths = (np.arctan2(step[:, 1], step[:, 0]) - heading) / (np.pi / 8)
    spot_turns = np.where(first, np.round(eighths).astype(np.int64) % 16, 0)
    return heading + spot_turns * np.pi / 8, spot_turns


def check_steps(mission: StoredMission) -> str:
    """Check that each sample is one step along the heading before it (Euler, move then turn)."""
    start, speed = mission.n_pilot, float(mission.option("robot.speed"))
    direction, _ = _driven(mission)
    expected = mission.x[start - 1 : -1] + speed * np.column_stack(
        [np.cos(direction), np.sin(direction)]
    )
    away = np.hypot(*(mission.x[start:] - expected).T)
    demand(
        away <= mission.length_tolerance,
        lambda i: (
            f"{mission.place(start + i)} is {away[i]:.3g} off one step of {speed:g} "
            "along the heading before it"
        ),
    )
    return f"{len(away)} steps of {speed:g} within {away.max():.1g}"


def check_actions(mission: StoredMission) -> str:
    """Check that turns are steering angles, constant within an action; epochs are whole actions."""
    start, length = mission.n_pilot, int(mission.option("robot.samples_per_action"))
    limit = mission.option("planner.execute_actions")
    steering = _steering(mission)
    direction, _ = _driven(mission)
    turn = _wrapped(mission.samples["heading"].to_numpy()[start:] - direction)
    off = np.abs(turn[:, None] - steering).min(axis=1)
    demand(
        off <= ROUNDING,
        lambda i: f"{mission.place(start + i)} turns by {turn[i]:.6g}, which is no steering angle",
    )
    actions, last = 0, int(mission.epoch[-1])
    for e in range(1, last + 1):
        batch = np.flatnonzero(mission.epoch == e)
        if e < last and len(batch) % length:
            raise FaultError(f"epoch {e} has {len(batch)} samples, no whole actions of {length}")
        count = math.ceil(len(batch) / length)
        if limit is not None and count > int(limit):
            raise FaultError(f"epoch {e} drives {count} actions, execute_actions={limit}")
        for i in batch.tolist():
            begin = batch[0] + (i - batch[0]) // length * length
            if not abs(turn[i - start] - turn[begin - start]) <= ROUNDING:
                raise FaultError(
                    f"{mission.place(i)} turns by {turn[i - start]:.6g}, its action at first by "
                    f"{turn[begin - start]:.6g}"
                )
        actions += count
    return f"{actions} actions of {length} samples in {last} epochs"


def check_spot_turns(mission: StoredMission) -> str:
    """Check that the car turns on the spot only where no action stays in the workspace."""
    _, spot_turns = _driven(mission)
    heading = mission.samples["heading"].to_numpy()
    turned = np.flatnonzero(spot_turns)
    for i in turned:
        before = mission.n_pilot + int(i) - 1
        count = int(spot_turns[i])
        ways = (range(count), range(0, count - 16, -1))
        # The direction of the turn is not laid down: one of both ways must have been blocked.
        if not any(
            all(_is_blocked(mission, before, heading[before] + k * np.pi / 8) for k in way)
            for way in ways
        ):
            raise FaultError(
                f"{mission.place(before + 1)} follows a turn on the spot by {count} pi/8, though "
                "an action was left"
            )
    return f"{len(turned)} epochs begin with a turn on the spot"


def _is_blocked(mission: StoredMission, sample: int, heading: float) -> bool:
    """Tell whether no action from a sample's position stays inside and off obstacles."""
    speed = float(mission.option("robot.speed"))
    xmin, xmax, ymin, ymax = mission.extent
    inset, obstacles = mission.length_tolerance, _obstacles(mission)
    for u in _steering(mission):
        angles = heading + u * np.arange(int(mission.option("robot.samples_per_action")))
        x = mission.x[sample, 0] + np.cumsum(speed * np.cos(angles))
        y = mission.x[sample, 1] + np.cumsum(speed * np.sin(angles))
        in_x = (x >= xmin + inset) & (x <= xmax - inset)
        track = np.vstack([mission.x[sample], np.column_stack([x, y])])
        if np.all(in_x & (y >= ymin + inset) & (y <= ymax - inset)) and not any(
            _meet(track, obstacle) for obstacle in obstacles
        ):
            return False
    return True


def check_workspace(mission: StoredMission) -> str:
    """Check that samples lie in the workspace and off obstacles, headings in [0, 2 pi)."""
    xmin, xmax, ymin, ymax = mission.extent
    low, high = np.array([xmin, ymin]), np.array([xmax, ymax])
    outside = np.maximum(low - mission.x, mission.x - high).max(axis=1)
    demand(
        outside <= mission.length_tolerance,
        lambda i: f"{mission.place(i)} lies {outside[i]:.3g} outside the workspace",
    )
    heading = mission.samples["heading"].to_numpy()
    demand(
        (heading >= 0.0) & (heading < 2.0 * np.pi),
        lambda i: f"{mission.place(i)} has the heading {heading[i]:.6g}, not in [0, 2 pi)",
    )
    inside = f"{len(heading)} samples in [{xmin:g}, {xmax:g}] x [{ymin:g}, {ymax:g}]"
    return inside + _check_obstacles(mission)


def _check_obstacles(mission: StoredMission) -> str:
    """Check that no step, the pilot's included, enters an obstacle."""
    obstacles = _obstacles(mission)
    for obstacle in obstacles:
        if not _meet(mission.x, obstacle):
            continue
        for i in range(len(mission.x) - 1):
            if _meet(mission.x[i : i + 2], obstacle):
                raise FaultError(f"{mission.place(i + 1)} is in an obstacle, or behind one")
    return f", off {counted(len(obstacles), 'obstacle')}" if obstacles else ""


def _obstacles(mission: StoredMission) -> list[Any]:
    """Polygons of the no-go zones, as matplotlib's paths."""
    from matplotlib.path import Path

    polygons = mission.option("terrain.obstacles")
    return [Path(np.array([*polygon, polygon[0]]), closed=True) for polygon in polygons]


def _meet(track: Floats, obstacle: Any) -> bool:
    """Tell whether a track enters an obstacle."""
    from matplotlib.path import Path

    # As filled, a track that drives around an obstacle would meet it.
    entered = Path(track).intersects_path(obstacle, filled=False)
    return bool(entered or obstacle.contains_point(track[0]))


def _steering(mission: StoredMission) -> Floats:
    """Return the turns a sample of the actions, even in [-max, max]; one alone is straight."""
    count = int(mission.option("robot.steering_angles"))
    largest = float(mission.option("robot.max_steering"))
    return np.linspace(-largest, largest, count) if count > 1 else np.zeros(1)


def _wrapped(angle: Any) -> Any:
    """Angle in [-pi, pi), radians."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
