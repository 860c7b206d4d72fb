"""Where missions fly: worker processes on this machine, a Dask cluster, or this very process.

All pools have the same few methods. A pool never raises because of a mission: it hands back an
`Outcome`, also of a mission whose worker died.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from infoplan.config import Config, MissionConfig
from infoplan.study.flight import Outcome, Report, Task, fly, get_ready
from infoplan.study.listening import Progress
from infoplan.study.signals import ignored


class Pool(Protocol):
    """What the runner needs of a pool."""

    def size(self) -> int:
        """Return how many missions may be under way at a time, now."""

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Have the kernels compiled, once, for so many missions of these configurations."""

    def start(self, task: Task) -> None:
        """Fly a mission; only while fewer than `size` are under way."""

    def wait(self, seconds: float) -> list[Outcome]:
        """Wait for missions to end, at most so long, and return those that have."""

    def close(self) -> None:
        """End all workers at once; what they fly is lost."""


@contextmanager
def open_pool(config: Config, workers: int, progress: Progress) -> Iterator[Pool]:
    """Open a pool and close it in any case.

    Parameters
    ----------
    config
        Its ``backend``, ``scheduler``, ``n_jobs`` and ``mission_timeout``.
    workers
        Processes on this machine, where missions fly in such.
    progress
        Is told what missions report.

    Raises
    ------
    UsageError
        If Dask is not installed.
    RunError
        If no Dask scheduler answers, or no worker can be started.
    """
    pool: Pool
    if config.backend == "sequential":
        pool = SequentialPool(progress.report)
    elif config.backend == "dask":
        from infoplan.study.dask_pool import DaskPool

        if config.scheduler is not None:
            workers = config.n_jobs
        pool = DaskPool(workers, config.scheduler, progress)
    else:
        from infoplan.study.processes import ProcessPool

        pool = ProcessPool(workers, progress, config.mission_timeout)
    try:
        yield pool
    finally:
        with ignored():
            pool.close()


def worker_count(n_jobs: int) -> int:
    """Return the number of workers that ``n_jobs`` stands for; -1: one a core, -2: one less."""
    from joblib import cpu_count

    return n_jobs if n_jobs > 0 else max(cpu_count() + 1 + n_jobs, 1)


class SequentialPool:
    """One mission after the other in this process, for debuggers and profilers."""

    def __init__(self, report: Report):
        self.report = report
        self.ended: list[Outcome] = []

    def size(self) -> int:
        """Return 1."""
        return 1

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Compile the kernels."""
        get_ready(configs, True, self.report)

    def start(self, task: Task) -> None:
        """Fly a mission to its end."""
        self.ended.append(fly(task, self.report))

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the missions flown since the last call."""
        ended, self.ended = self.ended, []
        return ended

    def close(self) -> None:
        """Do nothing."""
