"""What this machine has: memory, its own and what a process may have of it."""

import math
import os
import resource
from contextlib import suppress
from pathlib import Path

from infoplan.wording import figure

CGROUPS = Path("/sys/fs/cgroup")


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
