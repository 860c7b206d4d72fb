"""Monte Carlo tree search with UCB (UCT) or Pareto UCB (PUCT), the tree as a record of arrays.

Randomness: every uniform choice takes exactly one ``rng.random()``, a ``u`` that picks number
``int(u * n)`` of the ``n`` candidates in the order of their actions, even if there is one only.
The choices are: an untried action (also one that is then struck), a child at each level of the
descent, and a child at each level of the most visited path.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.compiled import kernel
from infoplan.obstacles import NOWHERE, Obstacles
from infoplan.plan.pareto import mark_pareto_optimal
from infoplan.plan.reward_maps import nearest_index
from infoplan.robot import inside, step
from infoplan.walls import Walls, crosses

ROOT = 0
NO_NODE = -1
UNTRIED = -1
STRUCK = -2

BORDERS = ("struck", "visit", "terminal")
"""What becomes of an action that leaves the workspace, see `search`."""

_VISIT, _TERMINAL = 1, 2


class Tree(NamedTuple):
    """A search tree of n nodes, A actions a node and D objectives; node 0 is the root.

    Parameters
    ----------
    pose : ndarray, shape (n, 3)
        ``x1, x2, heading`` of a node: at the end of the action that leads to it.
    parent : ndarray of int64, shape (n,)
        Parent's index; -1 at the root. A parent comes before its children.
    action : ndarray of int64, shape (n,)
        The action that leads to the node, an index into the steering angles; -1 at the root.
    child : ndarray of int64, shape (n, A)
        The child of each action; -1 if the action is untried, -2 if it is struck because it
        leaves the workspace or touches an obstacle.
    terminal : ndarray of bool, shape (n,)
        Whether the action that leads to the node leaves the workspace or touches an obstacle: only
        with ``border="terminal"``. Nothing goes on from there.
    visits : ndarray of int64, shape (n,)
        Iterations that passed through the node.
    reward : ndarray, shape (n, D)
        Sum over the visits of the rewards backed up.
    size : ndarray of int64, shape (1,)
        Number of nodes in use; the arrays of a finished tree are cut to it.
    """

    pose: NDArray[np.float64]
    parent: NDArray[np.int64]
    action: NDArray[np.int64]
    child: NDArray[np.int64]
    terminal: NDArray[np.bool_]
    visits: NDArray[np.int64]
    reward: NDArray[np.float64]
    size: NDArray[np.int64]


class _Problem(NamedTuple):
    """What stays the same in all iterations of a search; see `search` for the fields."""

    reward_maps: NDArray[np.float64]
    extent: tuple[float, float, float, float]
    speed: float
    samples_per_action: int
    steering: NDArray[np.float64]
    rollouts: int
    rollout_samples: int
    exploration: float
    pareto: bool
    planned: bool
    border: int
    walls: Walls


class _Scratch(NamedTuple):
    """Buffers that an iteration overwrites, so that it need not allocate.

    children (A,): the children of a node; bounds (A, D): their upper confidence bounds; optimal
    (A,): which of them are Pareto optimal; gain (D,): reward of one action; reward (D,): reward
    of the iteration.
    """

    children: NDArray[np.int64]
    bounds: NDArray[np.float64]
    optimal: NDArray[np.bool_]
    gain: NDArray[np.float64]
    reward: NDArray[np.float64]


def search(
    pose: ArrayLike,
    reward_maps: ArrayLike,
    extent: tuple[float, float, float, float],
    *,
    speed: float,
    samples_per_action: int,
    steering: ArrayLike,
    iterations: int,
    rollouts: int,
    exploration: float,
    pareto: bool,
    rng: np.random.Generator,
    rollout_step: str = "action",
    average: str = "driven",
    border: str = "struck",
    obstacles: Obstacles = NOWHERE,
) -> Tree:
    """Grow a search tree from the robot's pose (paper's Pareto Monte Carlo tree search).

    Parameters
    ----------
    pose : array_like, shape (3,)
        The robot's ``x1, x2, heading``, inside the workspace.
    reward_maps : array_like, shape (D, rows, cols)
        One map an objective, none negative; the outer nodes lie on the workspace's borders.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax`` of the workspace.
    speed : float
        Distance a sample, workspace units.
    samples_per_action : int
        Samples along one action.
    steering : array_like, shape (A,)
        Turn a sample of each action, radians.
    iterations : int
        Number of iterations.
    rollouts : int
        Straight steps that a simulation drives at most, up to the border.
    exploration : float
        The constant C of the bounds, as a multiple of the largest mean reward among the children.
    pareto : bool
        Select by Pareto UCB (PUCT), else by UCB (UCT), which is for one objective.
    rng : numpy.random.Generator
        The planner's stream; it advances by one draw a choice.
    rollout_step : {"action", "sample"}
        Length of such a step: a whole action, or the way from one sample to the next.
    average : {"driven", "planned"}
        What the summed reward of an expansion and its simulation is divided by: the actions that
        were driven, or those that would have been without a border. A step of one sample is a
        part of an action.
    border : {"struck", "visit", "terminal"}
        What an action that leaves the workspace or touches an obstacle costs. ``struck``: nothing,
        it is no action there and another one is drawn. ``visit``: it is struck, too, but the
        iteration is spent, a visit without reward of the node and all above. ``terminal``: it
        leads to a node without reward where nothing goes on, which may be selected again and
        again, and is in no plan.
    obstacles : Obstacles
        What no action may touch; the pose lies in none.

    Returns
    -------
    Tree
        The tree after `iterations` visits of the root.

    Raises
    ------
    ValueError
        If UCB is asked for several objectives, or the pose lies outside the workspace.
    """
    maps = np.ascontiguousarray(reward_maps, dtype=np.float64)
    if not pareto and maps.shape[0] != 1:
        raise ValueError(f"UCB takes one reward map, not {maps.shape[0]}; use pareto=True.")
    x, y, theta = (float(value) for value in np.asarray(pose, dtype=np.float64))
    xmin, xmax, ymin, ymax = (float(bound) for bound in extent)
    if not inside(x, y, (xmin, xmax, ymin, ymax)):
        raise ValueError(f"The search starts at ({x}, {y}), outside the workspace {extent}.")
    problem = _Problem(
        maps,
        (xmin, xmax, ymin, ymax),
        float(speed),
        int(samples_per_action),
        np.ascontiguousarray(steering, dtype=np.float64),
        int(rollouts),
        int(samples_per_action) if rollout_step == "action" else 1,
        float(exploration),
        bool(pareto),
        average == "planned",
        BORDERS.index(border),
        obstacles.walls,
    )
    return _grow((x, y, theta), problem, int(iterations), rng)


def most_visited_actions(tree: Tree, rng: np.random.Generator) -> NDArray[np.int64]:
    """Read the plan off a tree: from the root always the most visited child, down to a leaf.

    Parameters
    ----------
    tree : Tree
        A finished search.
    rng : numpy.random.Generator
        The planner's stream: ties are drawn uniformly, one draw a level.

    Returns
    -------
    ndarray of int64, shape (k,)
        Indices into the steering angles; empty if the root is a dead end.
    """
    actions = []
    children = _drivable_children(tree, ROOT)
    while len(children):
        visits = tree.visits[children]
        most = children[visits == visits.max()]
        node = most[_pick(len(most), rng)]
        actions.append(tree.action[node])
        children = _drivable_children(tree, node)
    return np.array(actions, dtype=np.int64)


def _drivable_children(tree: Tree, node: int) -> NDArray[np.int64]:
    """Return the children of a node to which the robot may drive."""
    children = tree.child[node][tree.child[node] > ROOT]
    return children[~tree.terminal[children]]


@kernel()
def ucb(mean: float, scale: float, parent_visits: int, visits: int) -> float:
    """Upper confidence bound of a child (paper's UCB equation).

    Parameters
    ----------
    mean : float
        The child's mean reward.
    scale : float
        The constant C, of the rewards' scale.
    parent_visits, visits : int
        Visits of the parent and of the child, each at least 1.

    Returns
    -------
    float
        ``mean + C sqrt(2 ln Np / Nj)``.
    """
    return mean + scale * math.sqrt(2.0 * math.log(parent_visits) / visits)


@kernel()
def pareto_ucb(
    mean: float, scale: float, parent_visits: int, visits: int, objectives: int
) -> float:
    """Upper confidence bound of a child in one of its objectives (paper's Pareto UCB equation).

    Parameters
    ----------
    mean : float
        The child's mean reward in this objective.
    scale : float
        The constant C of this objective.
    parent_visits, visits : int
        Visits of the parent and of the child, each at least 1.
    objectives : int
        Number of objectives D.

    Returns
    -------
    float
        ``mean + C sqrt((4 ln Np + ln D) / (2 Nj))``; equal to UCB if D is 1.
    """
    return mean + scale * math.sqrt(
        (4.0 * math.log(parent_visits) + math.log(objectives)) / (2.0 * visits)
    )


@kernel()
def _grow(
    pose: tuple[float, float, float],
    problem: _Problem,
    iterations: int,
    rng: np.random.Generator,
) -> Tree:
    """Iterate the four steps of Monte Carlo tree search."""
    actions, objectives = problem.steering.shape[0], problem.reward_maps.shape[0]
    tree = _plant(pose, iterations + 1, actions, objectives)
    scratch = _Scratch(
        np.empty(actions, dtype=np.int64),
        np.empty((actions, objectives)),
        np.empty(actions, dtype=np.bool_),
        np.empty(objectives),
        np.empty(objectives),
    )
    for _ in range(iterations):
        node, leaf, goes_on = ROOT, NO_NODE, False
        # Expanding may strike the last untried actions of a node: then select on from there.
        while leaf == NO_NODE and not _is_dead_end(tree, node):
            node = select(tree, node, problem, rng, scratch)
            leaf, goes_on = expand(tree, node, problem, rng, scratch)
        if goes_on:
            simulate(tree, leaf, problem, scratch)
        else:
            scratch.reward[:] = 0.0
        back_propagate(tree, node if leaf == NO_NODE else leaf, scratch)
    return _cut(tree)


@kernel()
def select(
    tree: Tree, node: int, problem: _Problem, rng: np.random.Generator, scratch: _Scratch
) -> int:
    """Descend by the tree policy (paper's Selection).

    Stops at a node with an untried action, or at a dead end.
    """
    while True:
        count = 0
        for action in range(tree.child.shape[1]):
            if tree.child[node, action] == UNTRIED:
                return node
            if tree.child[node, action] != STRUCK:
                scratch.children[count] = tree.child[node, action]
                count += 1
        if count == 0:
            return node
        _bound(tree, node, count, problem, scratch)
        # With one objective the Pareto optimal set is the largest bound and its exact ties.
        mark_pareto_optimal(scratch.bounds[:count], scratch.optimal)
        candidates = 0
        for i in range(count):
            if scratch.optimal[i]:
                scratch.children[candidates] = scratch.children[i]
                candidates += 1
        node = scratch.children[_pick(candidates, rng)]


@kernel()
def expand(
    tree: Tree, node: int, problem: _Problem, rng: np.random.Generator, scratch: _Scratch
) -> tuple[int, bool]:
    """Drive a random untried action (paper's Expansion).

    Returns the node whose visit the iteration is, and whether it is a new one from which a
    simulation goes on; -1 if no action is left. Actions that leave the workspace are struck on the
    way, or end it, as ``problem.border`` says. The action's reward is left in ``scratch.reward``.
    """
    while True:
        untried = 0
        for action in range(tree.child.shape[1]):
            untried += tree.child[node, action] == UNTRIED
        if untried == 0:
            return NO_NODE, False
        skip = _pick(untried, rng)
        action = 0
        while skip > 0 or tree.child[node, action] != UNTRIED:
            skip -= tree.child[node, action] == UNTRIED
            action += 1
        start = (tree.pose[node, 0], tree.pose[node, 1], tree.pose[node, 2])
        length, turn = problem.samples_per_action, problem.steering[action]
        end, stays = _drive(start, turn, length, problem, scratch.reward)
        if stays:
            return _add_child(tree, node, action, end), True
        if problem.border == _TERMINAL:
            new = _add_child(tree, node, action, end)
            tree.terminal[new] = True
            tree.child[new] = STRUCK
            return new, False
        tree.child[node, action] = STRUCK
        if problem.border == _VISIT:
            return node, False


@kernel()
def simulate(tree: Tree, leaf: int, problem: _Problem, scratch: _Scratch) -> None:
    """Drive straight on from a new leaf, at most up to the border (paper's Simulation).

    ``scratch.reward`` goes from the sum of the expansion to the mean over all actions.
    """
    pose = (tree.pose[leaf, 0], tree.pose[leaf, 1], tree.pose[leaf, 2])
    ahead = 0
    for _ in range(problem.rollouts):
        pose, stays = _drive(pose, 0.0, problem.rollout_samples, problem, scratch.gain)
        if not stays:
            break
        ahead += problem.rollout_samples
        for d in range(scratch.reward.shape[0]):
            scratch.reward[d] += scratch.gain[d]
    if problem.planned:
        ahead = problem.rollouts * problem.rollout_samples
    actions = (problem.samples_per_action + ahead) / problem.samples_per_action
    for d in range(scratch.reward.shape[0]):
        scratch.reward[d] /= actions


@kernel()
def back_propagate(tree: Tree, node: int, scratch: _Scratch) -> None:
    """Add a visit and the reward to every node up to the root (paper's Back-propagation)."""
    while node != NO_NODE:
        tree.visits[node] += 1
        for d in range(scratch.reward.shape[0]):
            tree.reward[node, d] += scratch.reward[d]
        node = tree.parent[node]


@kernel()
def _bound(tree: Tree, node: int, count: int, problem: _Problem, scratch: _Scratch) -> None:
    """Put the upper confidence bounds of a node's first `count` children in scratch."""
    objectives = problem.reward_maps.shape[0]
    for d in range(objectives):
        largest = -math.inf
        for i in range(count):
            child = scratch.children[i]
            scratch.bounds[i, d] = tree.reward[child, d] / tree.visits[child]
            largest = max(largest, scratch.bounds[i, d])
        scale = problem.exploration * largest
        for i in range(count):
            mean, visits = scratch.bounds[i, d], tree.visits[scratch.children[i]]
            if problem.pareto:
                bound = pareto_ucb(mean, scale, tree.visits[node], visits, objectives)
            else:
                bound = ucb(mean, scale, tree.visits[node], visits)
            scratch.bounds[i, d] = bound


@kernel()
def _drive(
    pose: tuple[float, float, float],
    u: float,
    samples: int,
    problem: _Problem,
    gain: NDArray[np.float64],
) -> tuple[tuple[float, float, float], bool]:
    """Drive some samples and sum their rewards into `gain`; also tell whether all stay inside."""
    x, y, theta = pose
    objectives, rows, cols = problem.reward_maps.shape
    xmin, xmax, ymin, ymax = problem.extent
    gain[:] = 0.0
    for _ in range(samples):
        before_x, before_y = x, y
        x, y, theta = step(x, y, theta, u, problem.speed)
        if not inside(x, y, problem.extent) or crosses(before_x, before_y, x, y, problem.walls):
            return (x, y, theta), False
        row = nearest_index(y, ymin, ymax, rows)
        col = nearest_index(x, xmin, xmax, cols)
        for d in range(objectives):
            gain[d] += problem.reward_maps[d, row, col]
    return (x, y, theta), True


@kernel()
def _pick(count: int, rng: np.random.Generator) -> int:
    """Choose one of `count` candidates uniformly, by one draw."""
    return int(rng.random() * count)


@kernel()
def _is_dead_end(tree: Tree, node: int) -> bool:
    """Tell whether every action of a node is struck."""
    # Struck is the lowest mark of all.
    return tree.child[node].max() == STRUCK


@kernel()
def _plant(pose: tuple[float, float, float], capacity: int, actions: int, objectives: int) -> Tree:
    """Return a tree of the root alone, with room for `capacity` nodes."""
    tree = Tree(
        np.empty((capacity, 3)),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity, dtype=np.int64),
        np.full((capacity, actions), UNTRIED, dtype=np.int64),
        np.zeros(capacity, dtype=np.bool_),
        np.zeros(capacity, dtype=np.int64),
        np.zeros((capacity, objectives)),
        np.ones(1, dtype=np.int64),
    )
    tree.pose[ROOT, 0], tree.pose[ROOT, 1], tree.pose[ROOT, 2] = pose
    tree.parent[ROOT] = NO_NODE
    tree.action[ROOT] = -1
    return tree


@kernel()
def _add_child(tree: Tree, node: int, action: int, pose: tuple[float, float, float]) -> int:
    """Append a node and return its index."""
    new = tree.size[0]
    tree.pose[new, 0], tree.pose[new, 1], tree.pose[new, 2] = pose
    tree.parent[new] = node
    tree.action[new] = action
    tree.child[node, action] = new
    tree.size[0] += 1
    return new


@kernel()
def _cut(tree: Tree) -> Tree:
    """Return a tree without its unused rows."""
    n = tree.size[0]
    return Tree(
        tree.pose[:n],
        tree.parent[:n],
        tree.action[:n],
        tree.child[:n],
        tree.terminal[:n],
        tree.visits[:n],
        tree.reward[:n],
        tree.size,
    )
