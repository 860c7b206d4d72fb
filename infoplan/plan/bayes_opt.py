"""Bayesian optimisation: the best place by an acquisition function, then the way there."""

import numpy as np
from numpy.typing import NDArray

from infoplan.extent import query_grid
from infoplan.plan.situation import Situation
from infoplan.plan.waypoints import follow


def bayes_opt(
    situation: Situation,
    rng: np.random.Generator,
    *,
    actions: int = 6,
    distance_penalty: float = 0.0,
) -> NDArray[np.int64]:
    """Drive to the node of the largest reward (Marchant and Ramos, IROS 2012).

    The reward is the acquisition function, by default mean plus kappa deviations. Nodes in
    obstacles, and those within half an action's length, are no candidates. What is on the way
    does not count.

    Parameters
    ----------
    situation
        As for any planner.
    rng
        Draws among equals.
    actions
        The most that are driven, arrived or not.
    distance_penalty
        Taken from the reward for each workspace unit of the straight way, the reward's unit.

    Returns
    -------
    ndarray of int64
    """
    rows, columns = situation.reward_map.shape
    nodes = query_grid(situation.extent, (rows, columns))
    distance = np.hypot(*(nodes - situation.pose[:2]).T)
    worth = situation.reward_map.ravel() - distance_penalty * distance
    reached = distance <= 0.5 * situation.speed * situation.samples_per_action
    worth = np.where(reached | situation.obstacles.contain(nodes), -np.inf, worth)
    best = np.flatnonzero(worth == worth.max())
    plan, _ = follow(situation, nodes[[best[int(rng.random() * len(best))]]], actions)
    return plan
