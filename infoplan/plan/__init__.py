"""Where to drive next: reward maps, Monte Carlo tree search by UCB or Pareto UCB, baselines."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from infoplan.plan.lawnmower import lawnmower
from infoplan.plan.pareto import pareto_optimal
from infoplan.plan.planners import greedy, puct, random_walk, uct, weighted
from infoplan.plan.reward_maps import count_flags, normalise, smooth
from infoplan.plan.situation import Situation
from infoplan.plan.tree_search import Tree, most_visited_actions, pareto_ucb, search, ucb

PLANNERS: dict[str, Callable[..., NDArray[np.int64]]] = {
    "uct": uct,
    "puct": puct,
    "weighted": weighted,
    "greedy": greedy,
    "lawnmower": lawnmower,
    "random": random_walk,
}

__all__ = [
    "PLANNERS",
    "Situation",
    "Tree",
    "count_flags",
    "greedy",
    "lawnmower",
    "most_visited_actions",
    "normalise",
    "pareto_optimal",
    "pareto_ucb",
    "puct",
    "random_walk",
    "search",
    "smooth",
    "ucb",
    "uct",
    "weighted",
]
