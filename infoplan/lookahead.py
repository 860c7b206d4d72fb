"""Where to go next for longer than a plan: plan, believe that it was driven, and plan on."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import checked_actions, checked_drive, checked_prediction
from infoplan.belief import TURNS, Belief
from infoplan.config import MissionConfig
from infoplan.methods import check_covariance, find, method_label
from infoplan.plan import Situation, count_flags, normalise, smooth
from infoplan.planner_reward import deviation_and_reward
from infoplan.randomness import generator
from infoplan.robot import drive, steering_angles, turn_on_the_spot
from infoplan.threads import one_thread

Floats = NDArray[np.float64]
Planner = Callable[[Situation, np.random.Generator], Any]

DEPTH = 4
"""So many actions ahead is a way looked for where a plan leaves no room to go on."""


@dataclass(frozen=True, eq=False)
class Track:
    """A track ahead.

    Attributes
    ----------
    poses
        x1, x2, heading at the start and at each sample, shape (n + 1, 3), workspace units.
    mean, deviation
        Predicted at each of them, shape (n + 1,), the values' unit: the deviation as it is
        expected when the plan that leads there is made.
    std_before, std_after
        Standard deviation at the nodes of the query grid, shape (rows, columns): now, and as
        expected when all has been driven; NaN where the track may not go.
    flagged
        Where flagged samples lie, shape (m, 2).
    revisited
        Which of them a sample of the track comes near to, within the distance of two samples.
    """

    poses: Floats
    mean: Floats
    deviation: Floats
    std_before: Floats
    std_after: Floats
    flagged: Floats
    revisited: NDArray[np.bool_]


@one_thread()
def look_ahead(
    belief: Belief,
    config: MissionConfig,
    pose: Floats,
    samples: int,
    *,
    plans: int = 1,
    any_heading: bool = False,
) -> Track:
    """Plan a track of many samples, without any new measurement.

    A planner plans a few actions. They are believed to be driven, with measurements as the model
    predicts them (the kriging believer; Ginsbourger et al., 2010): so the deviation shrinks where
    the track has been, mean and hyperparameters stay, and the next plan goes elsewhere. A flagged
    sample attracts until a sample of the track comes near. Planners are given the reward less its
    least value, which a track of a given length gathers in any case. Of a plan so much is driven
    that at its end a full circle is free, to the left or to the right: so the track can always go
    on, and never turns on the spot.

    Parameters
    ----------
    belief
        All that is known. Its extent and obstacles bound the track; its model learns what is
        believed.
    config
        Planner and robot, and the model's options.
    pose
        Where it starts, x1, x2, heading, off all obstacles.
    samples
        Length of the track.
    plans
        How often the planner is asked each time, if it draws at random: the plan is driven whose
        nodes have most of reward and outlier density (`gain`).
    any_heading
        Whether it may start with another heading, if from that one there is no way.

    Returns
    -------
    Track
        Of the start alone, where there is no way from it; else shorter only where at last no
        action is left.

    Raises
    ------
    UsageError
        If a planner of the user's own cannot be had, or the reward does not go with the model.
    RunError
        If planner or model answer what they should not.
    """
    check_covariance(config)
    planner, label = find("planner", config.planner), method_label(config.planner)
    shape = (config.grid[0], config.grid[1])
    free = ~belief.obstacles.contain(belief.nodes)
    nodes, mean, before = belief.nodes[free], belief.mean[free], belief.std[free]
    flagged = belief.readings.x[belief.flagged]
    revisited = np.zeros(len(flagged), dtype=bool)
    deviation, poses = before, pose[None]
    predicted = [_predict(belief.model, pose[None, :2], config)]
    number = 0
    while len(poses) <= samples:
        number += 1
        std, reward = deviation_and_reward(config, belief.model, nodes, mean, deviation)
        counts = count_flags(flagged[~revisited], belief.extent, shape)
        density = smooth(counts, config.planner.smoothing, belief.extent)
        situation = Situation(
            pose=poses[-1],
            std=_on_grid(std, free, shape),
            mean=_on_grid(mean, free, shape),
            reward_map=_on_grid(reward - reward.min(), free, shape),
            outlier_density=np.where(free.reshape(shape), density, 0.0),
            extent=belief.extent,
            speed=config.robot.speed,
            samples_per_action=config.robot.samples_per_action,
            steering=steering_angles(config.robot.max_steering, config.robot.steering_angles),
            visited=np.concatenate([belief.readings.x, poses[:, :2]]),
            n_pilot=len(belief.readings) + 1,
            epoch=number,
            budget=len(belief.readings) + 1 + samples,
            obstacles=belief.obstacles,
        )
        rng = generator(belief.seed, "planner", number)
        left = samples + 1 - len(poses)
        turns = TURNS if any_heading and number == 1 else 1
        driven = _first_way(planner, situation, rng, left, turns, plans, config, label)
        if driven is None:
            break
        start, piece = driven
        told, uncertain = _predict(belief.model, piece[:, :2], config)
        belief.model.append(piece[:, :2], told)
        deviation = _predict(belief.model, nodes, config)[1]
        predicted.append((told, uncertain))
        poses = np.concatenate([poses[:-1], start[None], piece])
        revisited |= near(flagged, piece[:, :2], config.robot.speed)
    return Track(
        poses,
        np.concatenate([mean for mean, _ in predicted]),
        np.concatenate([std for _, std in predicted]),
        _on_grid(before, free, shape, np.nan),
        _on_grid(deviation, free, shape, np.nan),
        flagged,
        revisited,
    )


def near(x: Floats, others: Floats, reach: float) -> NDArray[np.bool_]:
    """Tell which places, shape (n, 2), one of others, shape (m, 2), is within a reach of."""
    if not len(x):
        return np.zeros(0, dtype=bool)
    off = np.hypot(x[:, None, 0] - others[:, 0], x[:, None, 1] - others[:, 1])
    return np.asarray((off <= reach).any(axis=1))


def _first_way(
    planner: Planner,
    situation: Situation,
    rng: np.random.Generator,
    left: int,
    turns: int,
    plans: int,
    config: MissionConfig,
    label: str,
) -> tuple[Floats, Floats] | None:
    """Find the first of some headings with a way; returns the pose with it, and the best way."""
    for _ in range(turns):
        ways = []
        for _ in range(plans):
            actions = checked_actions(planner(situation, rng), situation, label)
            way = _drivable(situation, actions[: config.planner.execute_actions], left, label)
            ways += [] if way is None else [way]
        if not ways and (out := _way_out(situation, left)) is not None:
            ways = [out]
        if ways:
            return situation.pose, max(ways, key=lambda way: gain(situation, way))
        situation = replace(situation, pose=turn_on_the_spot(situation.pose))
    return None


def gain(situation: Situation, poses: Floats) -> float:
    """Reward and outlier density at the nodes that some poses pass, each node once, a sample.

    Both maps have a maximum of 1, as `infoplan.plan.puct` takes them.
    """
    passed = count_flags(poses[:, :2], situation.extent, situation.std.shape) > 0
    worth = normalise(situation.reward_map) + normalise(situation.outlier_density)
    return float(worth[passed].sum()) / len(poses)


def _drivable(
    situation: Situation, actions: NDArray[np.int64], left: int, label: str
) -> Floats | None:
    """Drive so much of a plan that the track can go on, or is at its end; None: not even a bit."""
    if not len(actions):
        return None
    piece = checked_drive(situation, actions, label)
    if len(piece) >= left:
        return piece[:left]
    along = situation.samples_per_action
    ends = range(len(piece), 0, -along)
    return next((piece[:end] for end in ends if can_circle(situation, piece[end - 1])), None)


def can_circle(situation: Situation, pose: Floats) -> bool:
    """Tell whether a full circle of the hardest turn is free, to the left or to the right."""
    for hardest in (situation.steering[:1], situation.steering[-1:]):
        if not hardest[0]:
            continue
        samples = round(2.0 * np.pi / abs(hardest[0]))
        circle = drive(pose, [0], hardest, situation.speed, samples)
        if situation.stays_inside(circle, pose):
            return True
    return False


def _way_out(situation: Situation, left: int) -> Floats | None:
    """Find the shortest way after which the track can go on, the richest of those; None: none."""
    ways: list[list[int]] = [[]]
    for depth in range(1, DEPTH + 1):
        ways = [[*way, action] for way in ways for action in _valid(situation, way)]
        done = depth * situation.samples_per_action >= left
        good = [way for way in ways if done or can_circle(situation, situation.drive(way)[-1])]
        if good:
            best = max(good, key=lambda w: situation.reward(situation.std, situation.drive(w)))
            return situation.drive(best)[:left]
    return None


def _valid(situation: Situation, way: list[int]) -> list[int]:
    """Actions that are free after some others."""
    return situation.valid_actions(situation.drive(way)[-1] if way else None)


def _predict(model: Any, x: Floats, config: MissionConfig) -> tuple[Floats, Floats]:
    return checked_prediction(model.predict(x), len(x), method_label(config.model))


def _on_grid(
    values: Floats, free: NDArray[np.bool_], shape: tuple[int, int], other: float = 0.0
) -> Floats:
    """Put the values of the nodes that are free on the whole grid."""
    grid = np.full(len(free), other)
    grid[free] = values
    return grid.reshape(shape)
