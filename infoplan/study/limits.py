"""What a study may ask of the process that leads it and of its machine."""

import resource
from collections.abc import Sequence

from infoplan.config import MissionConfig
from infoplan.errors import UsageError
from infoplan.machine import free_memory, machine_memory, size
from infoplan.mission_cost import WORKER_BYTES, memory_of
from infoplan.wording import counted, figure, rough

MISSION_BYTES = 3_000
"""Of a mission in the process that leads the study: its name, its state, its line."""

CONFIGURATION_BYTES = 90_000
"""Of a configuration of a sweep, as Hydra holds it."""

DESCRIPTORS, SPARE_DESCRIPTORS = 5, 24
"""Open files of a worker, and of everything else, in the process that leads the study."""

DAY = 86_400.0


def check_count(missions: int, name: str) -> None:
    """Refuse a study of more missions than the process that leads it can keep in mind.

    Raises
    ------
    UsageError
        With the figure.
    """
    if missions * MISSION_BYTES > machine_memory():
        raise UsageError(
            f"{name} makes a study of {rough(missions)} missions, whose list alone takes "
            f"{size(missions * MISSION_BYTES)} of memory, and this machine gives a process "
            f"{size(machine_memory())}: run it in parts"
        )


def sweep_fits(configurations: int) -> bool:
    """Whether the configurations of a sweep can be held."""
    return configurations * CONFIGURATION_BYTES <= machine_memory()


def check_sweep(configurations: int) -> None:
    """Refuse a sweep of more configurations than can be held, before they are composed.

    Raises
    ------
    UsageError
        With the figure.
    """
    if not sweep_fits(configurations):
        raise UsageError(
            f"this sweep has {rough(configurations)} configurations, which take "
            f"{size(configurations * CONFIGURATION_BYTES)} of memory, and this machine gives a "
            f"process {size(machine_memory())}: sweep in parts"
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
    return workers, f"{counted(workers, 'worker')} instead of {rough(wanted)}: {why}"


def warning_of_time(seconds: float, workers: int) -> str:
    """Warn of a study that takes longer than a day; empty if it does not."""
    if seconds / workers <= DAY:
        return ""
    return (
        f"this takes about {_long(seconds / workers)} with {counted(workers, 'worker')}, roughly "
        "estimated: Ctrl-C ends it, and keeps what is finished"
    )


def _long(seconds: float) -> str:
    days = seconds / DAY
    return f"{figure(days)} days" if days < 1000 else f"{figure(days / 365.25)} years"
