"""Waypoints optimised by the covariance matrix adaptation evolution strategy, CMA-ES."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.plan.situation import Situation
from infoplan.plan.waypoints import follow


def cmaes(
    situation: Situation,
    rng: np.random.Generator,
    *,
    waypoints: int = 4,
    actions: int = 8,
    spread: float = 0.25,
    evaluations: int = 300,
) -> NDArray[np.int64]:
    """Move waypoints until the track past them gathers most (Hansen, 2006, by the package cma).

    A track is what the car's own actions make of the waypoints; it is worth the reward at the nodes
    of the query grid that it passes, each once. The search starts with waypoints straight ahead.

    Parameters
    ----------
    situation
        As for any planner.
    rng
        Draws the strategy's steps.
    waypoints
        Their number.
    actions
        The most that are driven.
    spread
        First standard deviation of the waypoints, as a share of the workspace's sides.
    evaluations
        Tracks that are tried, at least; the last generation is finished.

    Returns
    -------
    ndarray of int64
        The best track that was tried.
    """
    import cma

    low = np.array(situation.extent[::2], dtype=np.float64)
    sides = np.array(situation.extent[1::2], dtype=np.float64) - low
    length = actions * situation.samples_per_action * situation.speed
    ahead = np.linspace(0, length, waypoints + 1)[1:, None]
    way = np.array([np.cos(situation.pose[2]), np.sin(situation.pose[2])])
    first = np.clip((situation.pose[:2] + ahead * way - low) / sides, 0.0, 1.0)
    best, most = follow(situation, low + first * sides, actions)

    def draw(*shape: int) -> Any:
        return rng.standard_normal(shape)

    # Without a seed of its own it leaves the global generator as it is.
    options = {"bounds": [0.0, 1.0], "randn": draw, "seed": np.nan, "verbose": -9,
               "verb_log": 0, "verb_disp": 0}  # fmt: skip
    strategy = cma.CMAEvolutionStrategy(first.ravel(), spread, options)
    tried = 1
    while tried < evaluations and not strategy.stop():
        generation = strategy.ask()
        worth = []
        for place in generation:
            plan, gain = follow(situation, low + place.reshape(-1, 2) * sides, actions)
            worth.append(-gain)
            if gain > most:
                best, most = plan, gain
        strategy.tell(generation, worth)
        tried += len(generation)
    return best
