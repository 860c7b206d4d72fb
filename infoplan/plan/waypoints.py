"""From waypoints to a track: the car's own actions that lead past them."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.compiled import kernel
from infoplan.plan.reward_maps import nearest_index
from infoplan.robot import inside, step
from infoplan.walls import Walls, crosses

if TYPE_CHECKING:
    from infoplan.plan.situation import Situation

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]


def follow(
    situation: "Situation", waypoints: Floats, actions: int
) -> tuple[NDArray[np.int64], float]:
    """Drive past waypoints in turn.

    Each action is the one whose samples come nearest to the next waypoint, of those that stay in
    the workspace and off obstacles. A waypoint is passed within half an action's length; after the
    last one the plan ends.

    Parameters
    ----------
    situation
        For the car, the workspace and the reward.
    waypoints
        Shape (n, 2), workspace units.
    actions
        The most that are driven.

    Returns
    -------
    plan : ndarray of int64
        None only where no action is left at once.
    gain : float
        Sum of the reward at the nodes that it passes, each once.
    """
    xmin, xmax, ymin, ymax = map(float, situation.extent)
    plan = np.empty(actions, dtype=np.int64)
    driven, gain = _follow(
        situation.pose.astype(np.float64), np.ascontiguousarray(waypoints, dtype=np.float64),
        np.ascontiguousarray(situation.reward_map, dtype=np.float64), (xmin, xmax, ymin, ymax),
        float(situation.speed), int(situation.samples_per_action), situation.steering,
        situation.obstacles.walls, plan,
    )  # fmt: skip
    return plan[:driven], gain


@kernel()
def _follow(
    pose: Floats,
    waypoints: Floats,
    reward: Floats,
    extent: Extent,
    speed: float,
    samples: int,
    steering: Floats,
    walls: Walls,
    plan: NDArray[np.int64],
) -> tuple[int, float]:
    """Fill the plan; return the number of actions and the sum of the reward."""
    seen = np.zeros(reward.shape, dtype=np.bool_)
    gain, target = 0.0, 0
    reach = 0.5 * speed * samples
    track = np.empty((samples, 3))
    for driven in range(plan.shape[0]):
        if target == waypoints.shape[0]:
            return driven, gain
        best, nearest = -1, math.inf
        for action in range(steering.shape[0]):
            if drive_free(pose, steering[action], speed, extent, walls, track):
                distance = _distance(track, waypoints[target])
                if distance < nearest:
                    best, nearest = action, distance
        if best < 0:
            return driven, gain
        drive_free(pose, steering[best], speed, extent, walls, track)
        for i in range(samples):
            row = nearest_index(track[i, 1], extent[2], extent[3], reward.shape[0])
            column = nearest_index(track[i, 0], extent[0], extent[1], reward.shape[1])
            if not seen[row, column]:
                gain += reward[row, column]
            seen[row, column] = True
        pose = track[-1].copy()
        plan[driven] = best
        while target < waypoints.shape[0] and _distance(track, waypoints[target]) <= reach:
            target += 1
    return plan.shape[0], gain


@kernel()
def drive_free(
    pose: Floats, u: float, speed: float, extent: Extent, walls: Walls, track: Floats
) -> bool:
    """Drive one action; tell whether it stays in the workspace and off obstacles.

    Parameters
    ----------
    pose : ndarray, shape (3,)
        Where it starts.
    u : float
        Turn a sample, radians.
    speed : float
        Distance a sample, workspace units.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax`` of the workspace.
    walls : Walls
        Edges of the obstacles.
    track : ndarray, shape (samples, 3)
        Overwritten with the poses at its samples, up to the first that is not free.

    Returns
    -------
    bool
    """
    x, y, theta = pose[0], pose[1], pose[2]
    for i in range(track.shape[0]):
        before_x, before_y = x, y
        x, y, theta = step(x, y, theta, u, speed)
        if not inside(x, y, extent) or crosses(before_x, before_y, x, y, walls):
            return False
        track[i, 0], track[i, 1], track[i, 2] = x, y, theta
    return True


@kernel()
def _distance(track: Floats, place: Floats) -> float:
    """Return the least distance of a track's samples from a place."""
    nearest = math.inf
    for i in range(track.shape[0]):
        nearest = min(nearest, math.hypot(track[i, 0] - place[0], track[i, 1] - place[1]))
    return nearest
