"""Where to drive next: reward maps, Monte Carlo tree search by UCB or Pareto UCB, baselines."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from infoplan.plan.bayes_opt import bayes_opt
from infoplan.plan.cmaes import cmaes
from infoplan.plan.lawnmower import lawnmower
from infoplan.plan.pareto import pareto_optimal
from infoplan.plan.planners import greedy, puct, random_walk, uct, weighted
from infoplan.plan.reward_maps import count_flags, normalise, smooth
from infoplan.plan.rig_tree import rig_tree
from infoplan.plan.situation import Situation
from infoplan.plan.tree_search import Tree, most_visited_actions, pareto_ucb, search, ucb

PLANNERS: dict[str, Callable[..., NDArray[np.int64]]] = {
    "uct": uct,
    "puct": puct,
    "weighted": weighted,
    "greedy": greedy,
    "bayes_opt": bayes_opt,
    "rig_tree": rig_tree,
    "cmaes": cmaes,
    "lawnmower": lawnmower,
    "random": random_walk,
}

__all__ = [
    "PLANNERS",
    "Situation",
    "Tree",
    "bayes_opt",
    "cmaes",
    "count_flags",
    "greedy",
    "lawnmower",
    "most_visited_actions",
    "normalise",
    "pareto_optimal",
    "pareto_ucb",
    "puct",
    "random_walk",
    "rig_tree",
    "search",
    "smooth",
    "ucb",
    "uct",
    "weighted",
]
