"""Rapidly-exploring information gathering, RIG-tree (Hollinger and Sukhatme, IJRR 2014)."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.compiled import kernel
from infoplan.plan.reward_maps import nearest_index
from infoplan.plan.waypoints import drive_free
from infoplan.walls import Walls

if TYPE_CHECKING:
    from infoplan.plan.situation import Situation

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Extent = tuple[float, float, float, float]

NODES_A_SAMPLE = 8
"""The tree has room for so many nodes a random place."""

SAME_HEADING = math.pi / 4
"""Nodes of one place compare only if they head the same way, to so many radians."""


def rig_tree(
    situation: "Situation",
    rng: np.random.Generator,
    *,
    samples: int = 300,
    actions: int = 8,
    near: float = 4.0,
    prune: float = 1.0,
) -> Integers:
    """Grow a tree of actions towards random places, and take the branch that gathers most.

    For each random place the nearest node that has budget left is extended by the action that ends
    nearest to it; then all nodes near that end are extended to it alike. A node is cut at once if
    another of the same place and heading gathers as much for as little (their Algorithm 1, with the
    car's actions to steer by). A branch gathers the reward at the nodes of the query grid that it
    passes, each once.

    Parameters
    ----------
    situation
        As for any planner.
    rng
        Draws the places.
    samples
        Random places.
    actions
        Budget of a branch.
    near
        Nodes so far around a new end are extended to it, too, workspace units.
    prune
        Nodes so far apart are of one place, workspace units.

    Returns
    -------
    ndarray of int64
    """
    xmin, xmax, ymin, ymax = map(float, situation.extent)
    plan = np.empty(actions, dtype=np.int64)
    length = _plan(
        situation.pose.astype(np.float64),
        np.ascontiguousarray(situation.reward_map, dtype=np.float64), (xmin, xmax, ymin, ymax),
        float(situation.speed), int(situation.samples_per_action), situation.steering,
        situation.obstacles.walls, samples, near, prune, plan, rng,
    )  # fmt: skip
    return plan[:length]


@kernel()
def _plan(
    pose: Floats,
    reward: Floats,
    extent: Extent,
    speed: float,
    along: int,
    steering: Floats,
    walls: Walls,
    samples: int,
    near: float,
    prune: float,
    plan: Integers,
    rng: np.random.Generator,
) -> int:
    """Fill the plan, and return its length."""
    capacity, turns = samples * NODES_A_SAMPLE + 1, steering.shape[0]
    poses = np.empty((capacity, 3))
    parent = np.full(capacity, -1, dtype=np.int64)
    action = np.empty(capacity, dtype=np.int64)
    cost = np.zeros(capacity, dtype=np.int64)
    gain = np.zeros(capacity)
    tried = np.zeros((capacity, turns), dtype=np.bool_)
    passed = np.empty((capacity, along), dtype=np.int64)
    seen = np.full(reward.size, -1, dtype=np.int64)
    worth = reward.ravel()
    poses[0] = pose
    size, attempt = 1, 0
    track = np.empty((along, 3))
    for _ in range(samples):
        x = extent[0] + rng.random() * (extent[1] - extent[0])
        y = extent[2] + rng.random() * (extent[3] - extent[2])
        nearest = _nearest_open(poses[:size], cost, plan.shape[0], x, y)
        if nearest < 0:
            break
        # First the nearest node, towards the place; then all near its end, towards that.
        number, old = nearest, size
        for candidate in range(-1, old):
            if candidate >= 0:
                number = candidate
                off = math.hypot(poses[number, 0] - x, poses[number, 1] - y)
                if number == nearest or off > near or cost[number] >= plan.shape[0]:
                    continue
            best, least = -1, math.inf
            for a in range(turns):
                if drive_free(poses[number], steering[a], speed, extent, walls, track):
                    off = math.hypot(track[-1, 0] - x, track[-1, 1] - y)
                    if off < least:
                        best, least = a, off
            if best >= 0:
                drive_free(poses[number], steering[best], speed, extent, walls, track)
            if candidate < 0 and best >= 0:
                x, y = track[-1, 0], track[-1, 1]
            elif candidate < 0:
                break
            if best < 0 or tried[number, best] or size == capacity:
                continue
            tried[number, best] = True
            attempt += 1
            _mark(number, parent, passed, seen, attempt)
            poses[size] = track[-1]
            parent[size], action[size] = number, best
            cost[size], gain[size] = cost[number] + 1, gain[number]
            for i in range(along):
                row = nearest_index(track[i, 1], extent[2], extent[3], reward.shape[0])
                column = nearest_index(track[i, 0], extent[0], extent[1], reward.shape[1])
                place = row * reward.shape[1] + column
                passed[size, i] = place
                if seen[place] != attempt:
                    gain[size] += worth[place]
                seen[place] = attempt
            if not _is_beaten(size, poses, cost, gain, prune):
                size += 1
    end = int(np.argmax(gain[:size]))
    if end == 0 and size > 1:
        end = 1  # nothing to gather anywhere: on, all the same
    length = cost[end]
    while end > 0:
        plan[cost[end] - 1] = action[end]
        end = parent[end]
    return length


@kernel()
def _nearest_open(poses: Floats, cost: Integers, budget: int, x: float, y: float) -> int:
    """Return the node nearest to a place, of those that have budget left; -1 if none has."""
    best, least = -1, math.inf
    for i in range(poses.shape[0]):
        off = math.hypot(poses[i, 0] - x, poses[i, 1] - y)
        if cost[i] < budget and off < least:
            best, least = i, off
    return best


@kernel()
def _mark(node: int, parent: Integers, passed: Integers, seen: Integers, attempt: int) -> None:
    """Mark the places that the branch up to a node has passed."""
    while node > 0:
        for place in passed[node]:
            seen[place] = attempt
        node = parent[node]


@kernel()
def _is_beaten(new: int, poses: Floats, cost: Integers, gain: Floats, prune: float) -> bool:
    """Tell whether an older node of its place and heading gathers as much for as little."""
    for i in range(1, new):
        if cost[i] <= cost[new] and gain[i] >= gain[new]:
            off = math.hypot(poses[i, 0] - poses[new, 0], poses[i, 1] - poses[new, 1])
            turn = abs(poses[i, 2] - poses[new, 2])
            if off <= prune and min(turn, 2.0 * math.pi - turn) <= SAME_HEADING:
                return True
    return False
