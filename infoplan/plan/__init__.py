"""Where to drive next: reward maps, and Monte Carlo tree search by UCB or Pareto UCB."""

from infoplan.plan.pareto import pareto_optimal
from infoplan.plan.reward_maps import count_flags, normalise, smooth
from infoplan.plan.tree_search import Tree, most_visited_actions, pareto_ucb, search, ucb

__all__ = [
    "Tree",
    "count_flags",
    "most_visited_actions",
    "normalise",
    "pareto_optimal",
    "pareto_ucb",
    "search",
    "smooth",
    "ucb",
]
