"""The paper's tree search in plain Python, slow and step by step: the tests' independent truth.

It shares no code with the planner. Every uniform choice takes one draw, as the planner's does.
"""

import math
from dataclasses import dataclass, field


@dataclass
class Settings:
    reward_maps: list  # nested lists [objective][row][column]
    extent: tuple
    speed: float
    samples_per_action: int
    steering: list
    iterations: int
    rollouts: int
    exploration: float
    pareto: bool
    rollout_step: str = "action"
    average: str = "driven"
    border: str = "struck"


@dataclass(eq=False)
class Node:
    pose: tuple
    parent: "Node | None"
    action: int
    untried: list
    rewards: list  # one sum an objective
    is_terminal: bool = False
    visits: int = 0
    children: dict = field(default_factory=dict)  # action -> Node


class LeavesWorkspaceError(Exception):
    pass


def choose(candidates, rng):
    candidates = list(candidates)
    return candidates[int(rng.random() * len(candidates))]


def move_then_turn(pose, u, speed):
    x, y, theta = pose
    theta_after = (theta + u) % (2 * math.pi)
    if theta_after == 2 * math.pi:
        theta_after = 0.0
    return (x + speed * math.cos(theta), y + speed * math.sin(theta), theta_after)


def nearest(value, low, high, nodes):
    position = (value - low) * (nodes - 1) / (high - low)
    return max(0, min(nodes - 1, math.floor(position + 0.5)))


def take(settings, pose, u, samples):
    """Drive some samples: the end pose and the summed reward of each objective."""
    xmin, xmax, ymin, ymax = settings.extent
    sums = [0.0 for _ in settings.reward_maps]
    for _ in range(samples):
        pose = move_then_turn(pose, u, settings.speed)
        x, y, _heading = pose
        if x < xmin or x > xmax or y < ymin or y > ymax:
            raise LeavesWorkspaceError(pose)
        for objective, grid in enumerate(settings.reward_maps):
            row = nearest(y, ymin, ymax, len(grid))
            column = nearest(x, xmin, xmax, len(grid[0]))
            sums[objective] += grid[row][column]
    return pose, sums


def is_dominated(vector, others):
    return any(
        all(o >= v for o, v in zip(other, vector, strict=True))
        and any(o > v for o, v in zip(other, vector, strict=True))
        for other in others
    )


def best_child(settings, node, rng):
    objectives = len(settings.reward_maps)
    children = [node.children[action] for action in sorted(node.children)]
    means = [[total / child.visits for total in child.rewards] for child in children]
    constants = [
        settings.exploration * max(mean[objective] for mean in means)
        for objective in range(objectives)
    ]
    if not settings.pareto:
        values = [
            mean[0] + constants[0] * math.sqrt(2 * math.log(node.visits) / child.visits)
            for mean, child in zip(means, children, strict=True)
        ]
        best = [
            child for child, value in zip(children, values, strict=True) if value == max(values)
        ]
        return choose(best, rng)
    vectors = [
        [
            m + c * math.sqrt((4 * math.log(node.visits) + math.log(objectives)) / (2 * n))
            for m, c in zip(mean, constants, strict=True)
        ]
        for mean, n in zip(means, [child.visits for child in children], strict=True)
    ]
    front = [
        child
        for child, vector in zip(children, vectors, strict=True)
        if not is_dominated(vector, vectors)
    ]
    return choose(front, rng)


def new_node(settings, pose, parent, action):
    untried = list(range(len(settings.steering)))
    return Node(pose, parent, action, untried, [0.0 for _ in settings.reward_maps])


def one_iteration(settings, root, rng, created):
    node, rewards = root, None
    nothing = [0.0 for _ in settings.reward_maps]
    length = settings.samples_per_action
    step = {"action": length, "sample": 1}[settings.rollout_step]
    while rewards is None:
        if node.untried:
            action = choose(node.untried, rng)
            node.untried.remove(action)
            try:
                pose, rewards = take(settings, node.pose, settings.steering[action], length)
            except LeavesWorkspaceError as over:
                if settings.border == "visit":
                    rewards = nothing
                elif settings.border == "terminal":
                    outside = new_node(settings, over.args[0], node, action)
                    outside.untried, outside.is_terminal = [], True
                    node.children[action] = outside
                    created.append(outside)
                    node, rewards = outside, nothing
                continue
            node.children[action] = new_node(settings, pose, node, action)
            node = node.children[action]
            created.append(node)
            driven = length
            for _ in range(settings.rollouts):
                try:
                    pose, more = take(settings, pose, 0.0, step)
                except LeavesWorkspaceError:
                    break
                rewards = [a + b for a, b in zip(rewards, more, strict=True)]
                driven += step
            planned = length + settings.rollouts * step
            samples = {"driven": driven, "planned": planned}[settings.average]
            rewards = [total / (samples / length) for total in rewards]
        elif node.children:
            node = best_child(settings, node, rng)
        else:
            rewards = nothing
    while node is not None:
        node.visits += 1
        node.rewards = [a + b for a, b in zip(node.rewards, rewards, strict=True)]
        node = node.parent


def search(settings, pose, rng):
    """Return the nodes in order of creation, the root first."""
    root = new_node(settings, tuple(pose), None, -1)
    created = [root]
    for _ in range(settings.iterations):
        one_iteration(settings, root, rng, created)
    return created


def most_visited_actions(root, rng):
    actions, node = [], root
    while any(not child.is_terminal for child in node.children.values()):
        children = [node.children[action] for action in sorted(node.children)]
        children = [child for child in children if not child.is_terminal]
        most = max(child.visits for child in children)
        node = choose([child for child in children if child.visits == most], rng)
        actions.append(node.action)
    return actions
