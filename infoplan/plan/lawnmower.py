"""Boustrophedon coverage with the car's own actions: a planner that looks at no measurement."""

import math

import numpy as np
from numpy.typing import NDArray

from infoplan.plan.situation import Situation

Floats = NDArray[np.float64]


def lawnmower(
    situation: Situation,
    rng: np.random.Generator,
    *,
    actions: int = 6,
    spacing: float = 5.0,
    lookahead: int = 3,
) -> NDArray[np.int64]:
    """Follow parallel tracks up and down the workspace, then tracks across these, and so on.

    The tracks start in the lower left corner, which the car heads for from the end of the pilot
    path. It cannot drive them exactly: it takes the actions whose samples stay nearest to the path.
    How far along the path it is follows from where it has been. The path leaves out what lies in
    obstacles.

    Parameters
    ----------
    situation
        As for any planner.
    rng
        Not drawn from.
    actions
        Length of the plan.
    spacing
        Largest distance between tracks, workspace units.
    lookahead
        Each action is the first of the best sequence of this many.

    Returns
    -------
    ndarray of int64
    """
    step, window = situation.speed, 2 * situation.samples_per_action
    start = situation.visited[situation.n_pilot - 1]
    path = coverage_path(start, situation.extent, spacing, step, 2.0 * step * situation.budget)
    path = path[~situation.obstacles.contain(path)]
    progress = advance(path, 0, situation.visited[situation.n_pilot :], window)
    pose, plan = situation.pose, np.empty(0, dtype=np.int64)
    while len(plan) < actions:
        ahead = np.arange(lookahead * situation.samples_per_action) + progress + 1
        target = path[np.minimum(ahead, len(path) - 1)]
        action = nearest_action(situation, pose, target, lookahead)
        if action is None:
            break
        plan = np.append(plan, action)
        poses = situation.drive([action], pose)
        pose, progress = poses[-1], advance(path, progress, poses[:, :2], window)
    return plan


def coverage_path(
    start: Floats,
    extent: tuple[float, float, float, float],
    spacing: float,
    step: float,
    length: float,
) -> Floats:
    """Points along a path that covers the workspace again and again.

    Tracks along x from the lowest to the highest, then along y from the corner where these end, and
    so on, each half a spacing (at most a quarter of the workspace) off the borders at its ends.

    Parameters
    ----------
    start
        Where the path begins, shape (2,).
    extent
        xmin, xmax, ymin, ymax of the workspace.
    spacing
        Largest distance between tracks, workspace units.
    step
        Distance between points along the path, workspace units.
    length
        The path is at least as long, workspace units.

    Returns
    -------
    ndarray, shape (n, 2)
    """
    low, size = np.array(extent[0::2]), np.subtract(extent[1::2], extent[0::2])
    counts = [math.ceil(side / spacing) for side in size]
    inset = np.minimum(spacing / 2, size / 4)
    ends = np.array([low + inset, low + size - inset])
    corners = [np.asarray(start, dtype=np.float64)]
    along, at_far_end, driven = 0, [False, False], 0.0
    while driven < length:
        across = 1 - along
        for passed in range(counts[across]):
            number = counts[across] - 1 - passed if at_far_end[across] else passed
            track = low[across] + (number + 0.5) * size[across] / counts[across]
            for far in (at_far_end[along], not at_far_end[along]):
                corner = np.empty(2)
                corner[along], corner[across] = ends[int(far), along], track
                driven += float(np.hypot(*(corner - corners[-1])))
                corners.append(corner)
            at_far_end[along] = not at_far_end[along]
            if driven >= length:
                break
        at_far_end[across] = not at_far_end[across]
        along = across
    points = np.array(corners)
    distance = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    # A single track may be far longer than what is needed of it.
    even = np.arange(0.0, min(distance[-1], length + step), step)
    return np.column_stack([np.interp(even, distance, points[:, a]) for a in (0, 1)])


def advance(path: Floats, progress: int, positions: Floats, window: int) -> int:
    """Follow positions along a path, never back.

    Parameters
    ----------
    path
        Its points, shape (n, 2).
    progress
        Index of the point reached so far.
    positions
        Where the car was since, shape (m, 2).
    window
        From each position to the next, the nearest of so many points is the one reached.

    Returns
    -------
    int
        Index of the point reached.
    """
    for position in positions:
        ahead = path[progress : progress + window] - position
        progress += int(np.argmin(np.einsum("ij,ij->i", ahead, ahead)))
    return progress


def nearest_action(
    situation: Situation, pose: Floats, target: Floats, lookahead: int
) -> int | None:
    """Find the first action of the sequence whose samples lie nearest to their targets.

    Parameters
    ----------
    situation
        For the car and the workspace.
    pose
        Where the sequence starts, shape (3,).
    target
        A position for each sample, shape (lookahead * samples_per_action, 2).
    lookahead
        Length of the sequences. Where all of that length leave the workspace, the longest that stay
        inside count.

    Returns
    -------
    int or None
        The action of the least sum of squared distances; None if no action stays inside.
    """
    length = situation.samples_per_action
    best: list[tuple[float, int | None]] = [(np.inf, None)] * (lookahead + 1)

    def search(pose: Floats, depth: int, cost: float, first: int | None) -> None:
        if cost >= best[lookahead][0]:
            return
        best[depth] = min(best[depth], (cost, first), key=lambda found: found[0])
        if depth == lookahead:
            return
        for action in range(len(situation.steering)):
            poses = situation.drive([action], pose)
            if situation.stays_inside(poses, pose):
                off = poses[:, :2] - target[depth * length : (depth + 1) * length]
                added = cost + float(np.sum(off**2))
                search(poses[-1], depth + 1, added, action if first is None else first)

    search(pose, 0, 0.0, None)
    return next((action for _, action in reversed(best) if action is not None), None)
