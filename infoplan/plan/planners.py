"""Planners: the paper's two, and what they are compared with.

A planner is a function of the situation, of the epoch's random generator and of its options as
keywords. It returns the actions to drive, indices into the steering angles; none if no action stays
in the workspace: then the robot turns on the spot and the planner is asked again.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from infoplan.plan.reward_maps import normalise
from infoplan.plan.situation import Situation
from infoplan.plan.tree_search import most_visited_actions, search

Actions = NDArray[np.int64]
Floats = NDArray[np.float64]


def uct(
    situation: Situation,
    rng: np.random.Generator,
    *,
    iterations: int = 500,
    rollouts: int = 5,
    rollout_step: str = "action",
    exploration: float = 0.3,
    average: str = "driven",
    border: str = "struck",
) -> Actions:
    """Plan by tree search with the upper confidence bound; reward: the planner's own.

    Parameters
    ----------
    situation, rng
        As for any planner.
    iterations, rollouts, rollout_step, exploration, average, border
        As `infoplan.plan.search` takes them.

    Returns
    -------
    ndarray of int64
        The most visited path of the tree.
    """
    rewards = normalise(situation.reward_map)[np.newaxis]
    options = (iterations, rollouts, rollout_step, exploration, average, border)
    return _most_visited(situation, rng, rewards, *options)


def puct(
    situation: Situation,
    rng: np.random.Generator,
    *,
    iterations: int = 500,
    rollouts: int = 5,
    rollout_step: str = "action",
    exploration: float = 0.3,
    average: str = "driven",
    border: str = "struck",
) -> Actions:
    """Plan by Pareto tree search (the paper's method); rewards: its own, outlier density.

    Parameters and result as for `uct`.
    """
    rewards = np.stack([normalise(situation.reward_map), normalise(situation.outlier_density)])
    options = (iterations, rollouts, rollout_step, exploration, average, border)
    return _most_visited(situation, rng, rewards, *options)


def weighted(
    situation: Situation,
    rng: np.random.Generator,
    *,
    iterations: int = 500,
    rollouts: int = 5,
    rollout_step: str = "action",
    exploration: float = 0.3,
    average: str = "driven",
    border: str = "struck",
    weight: float = 0.5,
) -> Actions:
    """Plan as `uct`, on a weighted sum of the two rewards of `puct`, each with maximum 1.

    Parameters
    ----------
    situation, rng, iterations, rollouts, rollout_step, exploration, average, border
        As for `uct`.
    weight
        Of the outlier density, from 0 (`uct` itself) to 1; the other reward has the rest.

    Returns
    -------
    ndarray of int64
        The most visited path of the tree.
    """
    density = normalise(situation.outlier_density)
    rewards = (1.0 - weight) * normalise(situation.reward_map) + weight * density
    options = (iterations, rollouts, rollout_step, exploration, average, border)
    return _most_visited(situation, rng, rewards[np.newaxis], *options)


def greedy(situation: Situation, rng: np.random.Generator, *, actions: int = 6) -> Actions:
    """Take the action of the largest summed reward, then the best one from there, and so on.

    It looks one action ahead and no further. Like the tree search it counts a node as often as it
    passes, and it sees the reward as it is before the plan is driven.

    Parameters
    ----------
    situation, rng
        As for any planner; equal actions are drawn from.
    actions
        Length of the plan, shorter where it leads into a dead end.

    Returns
    -------
    ndarray of int64
    """

    def best(pose: Floats, valid: list[int]) -> int:
        gains = [situation.reward(situation.reward_map, situation.drive([a], pose)) for a in valid]
        return _pick([a for a, gain in zip(valid, gains, strict=True) if gain == max(gains)], rng)

    return _one_by_one(situation, actions, best)


def random_walk(situation: Situation, rng: np.random.Generator, *, actions: int = 6) -> Actions:
    """Draw each action from those that stay in the workspace.

    Parameters and result as for `greedy`.
    """
    return _one_by_one(situation, actions, lambda pose, valid: _pick(valid, rng))


def _most_visited(
    situation: Situation,
    rng: np.random.Generator,
    rewards: Floats,
    iterations: int,
    rollouts: int,
    rollout_step: str,
    exploration: float,
    average: str,
    border: str,
) -> Actions:
    """Search with as many objectives as there are reward maps."""
    tree = search(
        situation.pose,
        rewards,
        situation.extent,
        speed=situation.speed,
        samples_per_action=situation.samples_per_action,
        steering=situation.steering,
        iterations=iterations,
        rollouts=rollouts,
        rollout_step=rollout_step,
        exploration=exploration,
        average=average,
        border=border,
        pareto=len(rewards) > 1,
        rng=rng,
        obstacles=situation.obstacles,
    )
    return most_visited_actions(tree, rng)


def _one_by_one(
    situation: Situation, actions: int, choose: Callable[[Floats, list[int]], int]
) -> Actions:
    """Chain actions, each chosen among those that stay inside from the end of the one before."""
    pose = situation.pose
    plan: list[int] = []
    while len(plan) < actions and (valid := situation.valid_actions(pose)):
        plan.append(choose(pose, valid))
        pose = situation.drive(plan[-1:], pose)[-1]
    return np.array(plan, dtype=np.int64)


def _pick(candidates: list[int], rng: np.random.Generator) -> int:
    return candidates[int(rng.random() * len(candidates))]
