"""What a mission needs of a machine, in memory and time, estimated before it is flown.

Memory is that of peaks, as measured on missions, and rather low than high: only what certainly
cannot be done is refused.
"""

import math
from dataclasses import dataclass

from infoplan.config import (
    OF_COVARIANCE,
    CmaesConfig,
    MissionConfig,
    RigTreeConfig,
    TreeSearchConfig,
)
from infoplan.errors import UsageError
from infoplan.machine import machine_memory, size
from infoplan.wording import rough

WORKER_BYTES = 250e6
"""Of a worker that has imported what missions need."""

NODE_BYTES = 250
"""Of a node of the query grid: truth, predictions, reward maps, and its row in the tables."""

SAMPLE_BYTES = 400
"""Of a sample, its row in the table and what the detector is shown of it."""

POINT_BYTES = 50
"""Of a sample of the pilot and a control point, while the curve is drawn."""

PAIR_BYTES = {"gp": 8, "student_t": 48, "rcgp": 44, "itgp": 8, "relevance_pursuit": 40}
"""Of a pair of samples in a model in double precision: matrices that are held at a time."""

RESIDUAL_PAIR_BYTES = 24
"""Of two samples that gp_residual compares."""

NODE_PAIR_BYTES = 24
"""Of a pair of nodes, for a reward of their covariance: matrices that are held at a time."""

NODES_A_PLACE = 8
"""Nodes that a RIG-tree has room for, a random place."""

GROUP = 25
"""Nodes that a model of nearest neighbours predicts from the same samples."""

BLOCK = 512
"""Nodes that are predicted at a time."""

PASSES = {"gp": 1, "student_t": 4, "rcgp": 2, "itgp": 2, "relevance_pursuit": 8}
"""Factors of the matrix that an iteration of a model takes, about, as measured at 1000 samples."""

MATRIX_FLOPS, BLOCK_FLOPS = 3e10, 8e9
"""Operations a second of one core, in large matrices and in those of nearest neighbours."""

MISSION_SECONDS = 0.3
"""Of a mission, whatever its size."""

STEP_SECONDS, CHOICE_SECONDS = 1e-8, 2e-9
"""Of a step of the robot in the tree search, and of an action that it looks at."""

PYTHON_STEP_SECONDS = 3e-6
"""Of a step in the planners that have no tree."""


@dataclass(frozen=True)
class Part:
    """A part of a mission's memory: bytes, what it is for, and the options that decide it."""

    size: float
    what: str
    options: str


def parts(config: MissionConfig) -> list[Part]:
    """Estimate the memory of a mission, part by part; of own methods nothing is known.

    Parameters
    ----------
    config
        Its options, valid.
    """
    budget, nodes = float(config.budget), float(config.grid[0]) * config.grid[1]
    planner, model, detector = config.planner, config.model, config.detector
    batch = min(budget, _plan_actions(config) * config.robot.samples_per_action)
    precision = 0.5 if getattr(model, "dtype", "") == "float32" else 1.0
    pairs = PAIR_BYTES.get(model.name, 0) * precision
    judged = budget if detector.scope == "historical" else batch
    # One block of predictions has a row a node and a column a sample.
    predicted = 8 * precision * min(BLOCK, nodes) * budget if pairs else 0.0
    iterations, angles = getattr(planner, "iterations", 0), config.robot.steering_angles
    return [
        Part(nodes * NODE_BYTES, f"the query grid of {rough(nodes)} nodes", f"grid={config.grid}"),
        Part(
            budget * SAMPLE_BYTES + pairs * budget**2 + predicted + _neighbour_bytes(config),
            f"the model of {rough(budget)} samples", f"budget={config.budget}",
        ),
        Part(
            NODE_PAIR_BYTES * nodes**2 if _of_covariance(config) else 0.0,
            f"the covariance of {rough(nodes)} nodes",
            f"grid={config.grid} with planner.reward={getattr(planner, 'reward', '')}",
        ),
        Part(
            _residual_bytes(config, judged),
            f"the detector {detector.name} on {rough(judged)} of {rough(budget)} samples",
            f"budget={config.budget}" + (" or detector.scope=historical" if judged > batch else ""),
        ),
        Part(
            POINT_BYTES * float(config.pilot.samples) * len(config.pilot.control_points),
            f"the pilot path of {rough(config.pilot.samples)} samples",
            f"pilot.samples={config.pilot.samples}",
        ),
        Part(
            float(iterations + 1) * (64 + 8 * angles) if iterations else 0.0,
            f"the search tree of {rough(iterations)} iterations and {rough(angles)} actions",
            f"planner.iterations={iterations}" if iterations > angles
            else f"robot.steering_angles={angles}",
        ),
        Part(
            _branch_bytes(config),
            f"the tree of rig_tree towards {rough(getattr(planner, 'samples', 0))} places",
            f"planner.samples={getattr(planner, 'samples', 0)}",
        ),
        Part(
            100.0 * angles + 50.0 * _plan_actions(config) * config.robot.samples_per_action,
            f"a plan among {rough(angles)} actions",
            f"robot.steering_angles={angles}, robot.samples_per_action="
            f"{config.robot.samples_per_action} or planner.actions",
        ),
    ]  # fmt: skip


def memory_of(config: MissionConfig) -> float:
    """Estimate the bytes that a mission takes at its peak, besides its process' own."""
    return sum(part.size for part in parts(config))


def check_mission(config: MissionConfig) -> None:
    """Refuse a mission that this machine cannot hold.

    Raises
    ------
    UsageError
        With the figure, and the option to lower.
    """
    needed, there = memory_of(config), machine_memory()
    if needed + WORKER_BYTES > there:
        largest = max(parts(config), key=lambda part: part.size)
        raise UsageError(
            f"{largest.options} needs about {size(needed)} of memory, mostly for {largest.what}, "
            f"and this machine gives a process {size(there)}: lower it"
        )


def seconds_of(config: MissionConfig) -> float:
    """Estimate the seconds of a mission from its operations.

    Two or three times too many or too few are usual: what a core can do, and how long the
    planner's paths become, shows only in flight.
    """
    budget, pilot = float(config.budget), float(config.pilot.samples)
    nodes, robot, planner = float(config.grid[0]) * config.grid[1], config.robot, config.planner
    batch = min(_plan_actions(config) * robot.samples_per_action, budget)
    epochs = max((budget - pilot) / batch, 1.0)
    per_epoch = batch if config.model.iterations == "per_sample" else float(config.model.iterations)
    seconds = MISSION_SECONDS
    if config.model.name == "vecchia":
        block, near = config.model.block, config.model.neighbours + config.model.block
        fitted = config.model.pilot_iterations * pilot + epochs * per_epoch * budget / 2
        predicted = epochs * nodes / GROUP * min(config.model.prediction_neighbours, budget) ** 3
        seconds += (fitted / block * near**3 + predicted) / BLOCK_FLOPS
    if config.model.name in PASSES:
        # Of the factors of ever larger matrices the mean is a quarter of the last, of squares a
        # third.
        factors = config.model.pilot_iterations * pilot**3 + epochs * per_epoch * budget**3 / 4
        predicted = epochs * nodes * budget**2 / 3
        seconds += (PASSES[config.model.name] * factors + predicted) / MATRIX_FLOPS
    if _of_covariance(config):
        seconds += epochs * (nodes**2 * budget / 2 + nodes**3) / MATRIX_FLOPS
    along = robot.samples_per_action
    if isinstance(planner, TreeSearchConfig):
        ahead = planner.rollouts * (along if planner.rollout_step == "action" else 1)
        step = (along + ahead) * STEP_SECONDS
        planning = planner.iterations * (step + robot.steering_angles * CHOICE_SECONDS)
    elif isinstance(planner, CmaesConfig):
        step = robot.steering_angles * along * STEP_SECONDS
        planning = planner.evaluations * planner.actions * step
    elif isinstance(planner, RigTreeConfig):
        # Each place looks at all nodes of the tree, of which there are at least as many.
        planning = planner.samples**2 * CHOICE_SECONDS
    else:
        planning = _plan_actions(config) * robot.steering_angles * along * PYTHON_STEP_SECONDS
    return seconds + epochs * planning


def _neighbour_bytes(config: MissionConfig) -> float:
    """Bytes for the numbers of neighbours, of blocks of samples and of groups of nodes."""
    model, nodes = config.model, float(config.grid[0]) * config.grid[1]
    if model.name != "vecchia":
        return 0.0
    blocks = 24.0 * config.budget / model.block * model.neighbours
    return blocks + 8.0 * nodes / GROUP * model.prediction_neighbours


def _residual_bytes(config: MissionConfig, judged: float) -> float:
    """Bytes of the detector that inverts the covariance of what it judges."""
    model = config.model
    if config.detector.name != "gp_residual":
        return 0.0
    if model.name != "vecchia":
        return RESIDUAL_PAIR_BYTES * judged * config.budget
    # Only samples that share a block or its neighbours have to do with each other.
    pairs = (model.neighbours + model.block) ** 2 / model.block
    return RESIDUAL_PAIR_BYTES * judged * min(pairs, config.budget)


def _of_covariance(config: MissionConfig) -> bool:
    """Whether the planner's reward is made of the covariance of all nodes."""
    return getattr(config.planner, "reward", "") in OF_COVARIANCE


def _branch_bytes(config: MissionConfig) -> float:
    """Bytes of the nodes of a RIG-tree, with the places that each action passes."""
    if not isinstance(config.planner, RigTreeConfig):
        return 0.0
    node = 60.0 + 8.0 * config.robot.samples_per_action + config.robot.steering_angles
    return NODES_A_PLACE * config.planner.samples * node


def _plan_actions(config: MissionConfig) -> float:
    """Actions of a plan: given, or about the depth of the tree."""
    planner, angles = config.planner, config.robot.steering_angles
    if planner.execute_actions is not None:
        return float(planner.execute_actions)
    if hasattr(planner, "actions"):
        return float(planner.actions)
    iterations = getattr(planner, "iterations", 0)
    return max(math.log(iterations + 1) / math.log(max(angles, 2)), 1.0)
