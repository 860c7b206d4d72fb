"""What a worker does: fly one mission and hand back its tables, or say why not."""

import threading
import time
import traceback
import warnings
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from infoplan.backend import load_matplotlib
from infoplan.config import DetectorConfig, MissionConfig, TerrainConfig, with_values
from infoplan.errors import RunError, UsageError
from infoplan.study.identity import NUMERICS_VERSION, Run
from infoplan.study.progress import COMPILING, Address, Report, reporter
from infoplan.study.provenance import provenance
from infoplan.study.store import MissionTables, build_tables

NOTICE_SECONDS = 2.0
"""Kernels that are in the cache are loaded in less; whatever takes longer is compiling."""

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
     "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS"),
    "1",
)  # fmt: skip
"""Environment of a worker: missions run side by side, each on one thread."""

_one_mission = threading.Lock()
"""Held by the mission that a process flies."""


@dataclass(frozen=True)
class Task:
    """A mission to fly: one run, one seed, and its number in the display."""

    run: Run
    seed: int
    number: int


@dataclass
class Outcome:
    """What became of a mission.

    Attributes
    ----------
    task
        Which.
    seconds
        How long it took.
    tables, footer
        Of a mission that ended well.
    reason
        Of one that did not: in a line.
    failure
        The same with its traceback.
    again
        Its worker died, and the mission has a try left.
    """

    task: Task
    seconds: float = 0.0
    tables: MissionTables | None = None
    footer: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    failure: str = ""
    again: bool = False


def fly(task: Task, report: Report | None = None) -> Outcome:
    """Fly one mission, on one thread, and return its tables or what went wrong.

    Parameters
    ----------
    task
        The mission.
    report
        Called with 0 and None at the start, then with (samples collected, RMSE) after each epoch.
    """
    report = report or (lambda collected, rmse: None)
    started, clock = datetime.now(UTC), time.perf_counter()
    report(0, None)
    try:
        _check_version(task.run)

        from infoplan.mission import Mission
        from infoplan.threads import look_again, one_thread

        look_again()
        with one_thread():
            mission = Mission(task.run.config, task.run.terrain, task.seed)
            rows = []
            for row in mission.run():
                rows.append(row)
                report(row.collected, row.rmse)
            tables = build_tables(task.run, mission, rows)
            footer = provenance() | {
                "started": started.isoformat(timespec="milliseconds"),
                "ended": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "seconds": time.perf_counter() - clock,
            }
    except (Exception, SystemExit) as error:  # a method of the user's may call sys.exit
        return failed(task, error, time.perf_counter() - clock)
    return Outcome(task, time.perf_counter() - clock, tables, footer)


def fly_here(task: Task, address: Address | None) -> Outcome:
    """Fly a mission in a process on this machine, and report to the display at an address."""
    return fly(task, reporter(address, task.number))


def fly_on_dask(task: Task, topic: str) -> Outcome:
    """Fly a mission on a Dask worker, and report through Dask's events.

    A worker of several threads flies one mission at a time: the number of threads of the numerical
    libraries, which decides the last bits, is that of the whole process.
    """
    from distributed import get_worker

    worker = get_worker()

    def report(collected: int, rmse: float | None) -> None:
        worker.log_event(topic, {"mission": task.number, "collected": collected, "rmse": rmse})

    with _one_mission:
        return fly(task, report)


def failed(task: Task, error: BaseException, seconds: float = 0.0) -> Outcome:
    """Describe a mission that raised."""
    expected = isinstance(error, UsageError | RunError)
    last = str(error) if expected else traceback.format_exception_only(error)[-1].strip()
    return Outcome(task, seconds, reason=last, failure="".join(traceback.format_exception(error)))


def get_ready(configs: list[MissionConfig], compiling: bool, address: Address | None) -> None:
    """Import what missions need, and compile the numerical kernels that are not in the cache.

    To compile, each kind of mission is flown for an epoch with next to no data. What goes wrong
    here goes wrong in the missions too, and is told there.

    Parameters
    ----------
    configs
        Configurations of the missions to come.
    compiling
        False: imports only, because another worker compiles.
    address
        Where a display listens that is told if compiling takes long.
    """
    from infoplan.mission import Mission
    from infoplan.terrain import load_terrain

    if any(config.detector.name == "pyod" for config in configs):
        load_matplotlib()  # as PyOD does
        with suppress(ImportError):
            import pyod.models.base  # noqa: F401 - takes a second
    if not compiling:
        return
    shrunk: list[MissionConfig] = []
    for config in configs:
        config = replace(
            config,
            detector=DetectorConfig(),
            pilot=replace(config.pilot, samples=5),
            model=replace(config.model, pilot_iterations=1, iterations=1),
            planner=with_values(config.planner, iterations=2, actions=1),
            terrain=TerrainConfig(extent=config.terrain.extent),
            rho=0.1,
            grid=[2, 2],
            budget=6,
        )
        if config not in shrunk:
            shrunk.append(config)
    notice = threading.Timer(NOTICE_SECONDS, reporter(address, COMPILING), [0, None])
    notice.daemon = True
    notice.start()
    for config in shrunk:
        with suppress(Exception), warnings.catch_warnings(action="ignore"):
            terrain = load_terrain("volcano", extent=config.terrain.extent)
            for _ in Mission(config, terrain, seed=0).run():
                pass
    notice.cancel()


def _check_version(run: Run) -> None:
    """Refuse a task from an infoplan whose numbers are others: its tables would be misnamed."""
    wanted = run.science["numerics_version"]
    if wanted != NUMERICS_VERSION:
        raise RunError(
            f"this worker's infoplan computes numbers of version {NUMERICS_VERSION}, the run wants "
            f"version {wanted}: install the same infoplan on all machines"
        )
