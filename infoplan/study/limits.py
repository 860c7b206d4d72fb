"""What missions need of a machine, estimated before any is flown, and what the machine has.

The estimates are of peaks, as measured on missions, and rather low than high: only what certainly
cannot be done is refused.
"""

import math
import os
import resource
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from infoplan.config import MissionConfig, TreeSearchConfig
from infoplan.errors import UsageError
from infoplan.wording import counted, figure

WORKER_BYTES = 250e6
"""Of a worker that has imported what missions need."""

NODE_BYTES = 250
"""Of a node of the query grid: truth, predictions, reward maps, and its row in the tables."""

SAMPLE_BYTES = 400
"""Of a sample, its row in the table and what the detector is shown of it."""

POINT_BYTES = 50
"""Of a sample of the pilot and a control point, while the curve is drawn."""

PAIR_BYTES = {"gp": 8, "student_t": 48}
"""Of a pair of samples in a model in double precision: matrices that are held at a time."""

DETECTOR_PAIR_BYTES = {"gp_residual": 24, "local": 30}
"""Of a judged sample and one that it is judged by."""

BLOCK = 512
"""Nodes that are predicted at a time."""

MISSION_BYTES = 3_000
"""Of a mission in the process that leads the study: its name, its state, its line."""

CONFIGURATION_BYTES = 90_000
"""Of a configuration of a sweep, as Hydra holds it."""

DESCRIPTORS, SPARE_DESCRIPTORS = 5, 24
"""Open files of a worker, and of everything else, in the process that leads the study."""

FLOPS = 2e9
"""Floating-point operations a second of the matrix routines, of an old machine."""

STEP_SECONDS, CHOICE_SECONDS = 1e-8, 2e-9
"""Of a step of the robot in the tree search, and of an action that it looks at."""

PYTHON_STEP_SECONDS = 3e-6
"""Of a step in the planners that have no tree."""

DAY = 86_400.0

CGROUPS = Path("/sys/fs/cgroup")


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
        Part(nodes * NODE_BYTES, f"the query grid of {_count(nodes)} nodes", f"grid={config.grid}"),
        Part(
            budget * SAMPLE_BYTES + pairs * budget**2 + predicted,
            f"the model of {_count(budget)} samples", f"budget={config.budget}",
        ),
        Part(
            DETECTOR_PAIR_BYTES.get(detector.name, 0) * judged * budget,
            f"the detector {detector.name} on {_count(judged)} of {_count(budget)} samples",
            f"budget={config.budget}" + (" or detector.scope=historical" if judged > batch else ""),
        ),
        Part(
            POINT_BYTES * float(config.pilot.samples) * len(config.pilot.control_points),
            f"the pilot path of {_count(config.pilot.samples)} samples",
            f"pilot.samples={config.pilot.samples}",
        ),
        Part(
            float(iterations + 1) * (64 + 8 * angles) if iterations else 0.0,
            f"the search tree of {_count(iterations)} iterations and {_count(angles)} actions",
            f"planner.iterations={iterations}" if iterations > angles
            else f"robot.steering_angles={angles}",
        ),
        Part(
            100.0 * angles + 50.0 * _plan_actions(config) * config.robot.samples_per_action,
            f"a plan among {_count(angles)} actions",
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


def check_count(missions: int, name: str) -> None:
    """Refuse a study of more missions than the process that leads it can keep in mind.

    Raises
    ------
    UsageError
        With the figure.
    """
    if missions * MISSION_BYTES > machine_memory():
        raise UsageError(
            f"{name} makes a study of {_count(missions)} missions, whose list alone takes "
            f"{size(missions * MISSION_BYTES)} of memory, and this machine gives a process "
            f"{size(machine_memory())}: run it in parts"
        )


def check_sweep(configurations: int) -> None:
    """Refuse a sweep of more configurations than can be held, before they are composed.

    Raises
    ------
    UsageError
        With the figure.
    """
    needed = configurations * CONFIGURATION_BYTES
    if needed > machine_memory():
        raise UsageError(
            f"this sweep has {_count(configurations)} configurations, which take {size(needed)} of "
            f"memory, and this machine gives a process {size(machine_memory())}: sweep in parts"
        )


def affordable_workers(wanted: int, configs: Sequence[MissionConfig]) -> tuple[int, str]:
    """Say how many workers the memory and the open files of this machine allow.

    Parameters
    ----------
    wanted
        How many there would be.
    configs
        Of the missions that they may fly at a time.

    Returns
    -------
    workers : int
        At least 1.
    why : str
        What makes them fewer, in a sentence; empty if nothing does.
    """
    each = WORKER_BYTES + max(map(memory_of, configs), default=0.0)
    by_memory = max(int(free_memory() / each), 1)
    open_files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    by_files = wanted
    if open_files != resource.RLIM_INFINITY:
        by_files = max((open_files - SPARE_DESCRIPTORS) // DESCRIPTORS, 1)
    workers = min(wanted, by_memory, by_files)
    if workers == wanted:
        return workers, ""
    if workers == by_memory:
        why = f"each may take {size(each)} of memory, of which {size(free_memory())} are free"
    else:
        why = f"this process may have {open_files} files open (ulimit -n)"
    return workers, f"{counted(workers, 'worker')} instead of {_count(wanted)}: {why}"


def seconds_of(config: MissionConfig) -> float:
    """Estimate roughly, and rather too few, the seconds of a mission, from its operations."""
    budget, pilot = float(config.budget), float(config.pilot.samples)
    nodes, robot, planner = float(config.grid[0]) * config.grid[1], config.robot, config.planner
    batch = min(_plan_actions(config) * robot.samples_per_action, budget)
    epochs = max((budget - pilot) / batch, 1.0)
    per_epoch = batch if config.model.iterations == "per_sample" else float(config.model.iterations)
    operations = 0.0
    if config.model.name in PAIR_BYTES:
        # Of the factors of ever larger matrices the mean is a quarter of the last, of squares a
        # third.
        operations += config.model.pilot_iterations * pilot**3
        operations += epochs * (per_epoch * budget**3 / 4 + nodes * budget**2 / 3)
    along = robot.samples_per_action
    if isinstance(planner, TreeSearchConfig):
        step = (1 + planner.rollouts) * along * STEP_SECONDS
        planning = planner.iterations * (step + robot.steering_angles * CHOICE_SECONDS)
    else:
        planning = _plan_actions(config) * robot.steering_angles * along * PYTHON_STEP_SECONDS
    return operations / FLOPS + epochs * planning


def warning_of_time(seconds: float, workers: int) -> str:
    """Warn of a study that takes longer than a day; empty if it does not."""
    if seconds / workers <= DAY:
        return ""
    return (
        f"this takes about {_long(seconds / workers)} with {counted(workers, 'worker')}, roughly "
        "estimated: Ctrl-C ends it, and keeps what is finished"
    )


def machine_memory() -> float:
    """Bytes that a process may have here: of the machine, its control group, its own limit."""
    return min(_total_memory(), *_group_limits(), _own_limit())


def free_memory() -> float:
    """Bytes that are free for all workers together."""
    memory = _lines(Path("/proc/meminfo"))
    free = [float(line.split()[1]) * 1024 for line in memory if line.startswith("MemAvailable:")]
    for limit, usage in _group_files():
        with suppress(ValueError):
            free.append(float(limit) - float(usage))
    return max(min(free, default=_total_memory()), 0.0)


def size(number: float) -> str:
    """Bytes as a person says them."""
    units = ["MB", "GB", "TB", "PB", "EB"]
    place = min(max(int(math.log10(max(number, 1.0)) // 3) - 2, 0), len(units) - 1)
    return f"{figure(number / 1e6 / 1000**place)} {units[place]}"


def _plan_actions(config: MissionConfig) -> float:
    """Actions of a plan: given, or about the depth of the tree."""
    planner, angles = config.planner, config.robot.steering_angles
    if planner.execute_actions is not None:
        return float(planner.execute_actions)
    if hasattr(planner, "actions"):
        return float(planner.actions)
    iterations = getattr(planner, "iterations", 0)
    return max(math.log(iterations + 1) / math.log(max(angles, 2)), 1.0)


def _total_memory() -> float:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def _own_limit() -> float:
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


def _group_limits() -> list[float]:
    limits = []
    for limit, _ in _group_files():
        with suppress(ValueError):  # max: there is none
            limits.append(float(limit))
    return limits


def _group_files() -> list[tuple[str, str]]:
    """Limit and usage of the control groups that this process is in, those above them included."""
    found = []
    for line in _lines(Path("/proc/self/cgroup")):
        _, controllers, place = line.split(":", 2)
        if not controllers:
            root, names = CGROUPS, ("memory.max", "memory.current")
        elif "memory" in controllers.split(","):
            root, names = CGROUPS / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes")
        else:
            continue
        folder = root / place.strip("/")
        # In a container the group's own path may not be there, only the root of what is mounted.
        for group in (folder, *folder.parents):
            texts = ["".join(_lines(group / name)) for name in names]
            if all(texts):
                found.append((texts[0], texts[1]))
            if group == root:
                break
    return found


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []


def _count(number: float) -> str:
    return f"{number:.0f}" if number < 1e6 else figure(number)


def _long(seconds: float) -> str:
    days = seconds / DAY
    return f"{figure(days)} days" if days < 1000 else f"{figure(days / 365.25)} years"
