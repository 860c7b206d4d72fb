"""Clocks, the rate of the matrix product, peak memory, and the machine they belong to.

Every duration is taken twice: by the wall clock, which is what a person waits, and as processor
time, which other work on the machine disturbs far less.
"""

import gc
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from scipy.linalg import get_blas_funcs

from infoplan.study.provenance import blas_libraries, cpu_model

PRODUCT_SIZE = 1900


@dataclass
class Seconds:
    """A duration by the wall clock and in processor time."""

    wall: float = float("nan")
    cpu: float = float("nan")

    def over(self, other: "Seconds") -> "Seconds":
        """Return the ratio of two durations, clock by clock."""
        return Seconds(self.wall / other.wall, self.cpu / other.cpu)

    def least(self, other: "Seconds") -> "Seconds":
        """Return the shorter of each clock: the least disturbed."""
        return Seconds(float(np.fmin(self.wall, other.wall)), float(np.fmin(self.cpu, other.cpu)))


@contextmanager
def timed() -> Iterator[Seconds]:
    """Time the body of a with statement."""
    spent = Seconds()
    wall, cpu = perf_counter(), process_time()
    yield spent
    spent.wall, spent.cpu = perf_counter() - wall, process_time() - cpu


def best(call: Callable[[], object], repeats: int) -> Seconds:
    """Return the shortest time of a call."""
    shortest = Seconds()
    for _ in range(repeats):
        with timed() as spent:
            call()
        shortest = shortest.least(spent)
    return shortest


def product_rate(dtype: str = "float64", repeats: int = 5) -> Seconds:
    """Operations a second of a dense matrix product in this process, by either clock."""
    (gemm,) = get_blas_funcs(("gemm",), dtype=dtype)
    a = np.random.default_rng(0).normal(size=(PRODUCT_SIZE, PRODUCT_SIZE)).astype(dtype, order="F")
    shortest = best(lambda: gemm(1.0, a, a), repeats)
    operations = 2.0 * PRODUCT_SIZE**3
    return Seconds(operations / shortest.wall, operations / shortest.cpu)


def resident_mib() -> tuple[float, float]:
    """Resident memory of this process, MiB: now, and the largest so far (Linux).

    Not ``getrusage``: its maximum is inherited from the process that started this one.
    """
    lines = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
    kib = {words[0]: int(words[1]) for words in lines if words[0] in ("VmRSS:", "VmHWM:")}
    return kib["VmRSS:"] / 1024, kib["VmHWM:"] / 1024


def restart_peak_mib() -> float:
    """Forget the largest resident memory of this process so far; return the present one, MiB."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")
    return resident_mib()[1]


def machine() -> dict[str, Any]:
    """Describe the machine, the libraries, and how busy it is."""
    packages = ("numpy", "scipy", "numba", "scikit-learn", "pyod", "torch", "pypolo")

    def installed(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    return {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(),
        "python": platform.python_version(),
        "libraries": {name: installed(name) for name in packages},
        "blas": blas_libraries(),
        "load_average": os.getloadavg(),
    }
