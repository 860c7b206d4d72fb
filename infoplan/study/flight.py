"""What a worker does: fly, replay, map or refit a mission, and hand back tables, or say why not."""

import os
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from infoplan.backend import load_matplotlib
from infoplan.config import DetectorConfig, GpConfig, MissionConfig, RandomConfig, TerrainConfig
from infoplan.errors import RunError, UsageError
from infoplan.later_logs import Origins, flagged_first, verdicts
from infoplan.options import with_values
from infoplan.samples import Samples
from infoplan.study.identity import NUMERICS_VERSION, Run
from infoplan.study.mission_tables import MissionTables, build_tables
from infoplan.study.provenance import provenance
from infoplan.study.signals import Interrupted
from infoplan.study.store import read_table, table_path
from infoplan.wording import harmless

if TYPE_CHECKING:
    from infoplan.scoring import CurveRow, State, StretchScore

Report = Callable[[int, int, float | None], None]
"""Takes the number of a mission, the samples that it has collected, and its RMSE; at the start 0
and None."""

COMPILING = -1
"""Number that a worker reports instead of a mission's while it compiles the kernels."""

NOTICE_SECONDS = 2.0
"""Kernels that are in the cache are loaded in less; whatever takes longer is compiling."""

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
     "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS"),
    "1",
)  # fmt: skip
"""Environment of a worker: missions run side by side, each on one thread."""

LONGEST_REASON, LONGEST_FAILURE = 500, 64_000
"""Characters of a failure's line and of its file."""

_one_mission = threading.Lock()
"""Held by the mission that a process flies."""


@dataclass(frozen=True)
class Task:
    """A mission for a worker: one run, one seed, and the number by which it reports.

    Attributes
    ----------
    run, seed, number
        Which it is.
    flown
        Of a replay, the results folder and the run whose samples it gets; else None.
    surveyed
        The samples of a survey, by batch; else None.
    origins
        Of a survey of several logs, where its samples come from; else None.
    refit
        Where the mission's tables are whose hyperparameters are fit anew; else None.
    """

    run: Run
    seed: int
    number: int
    flown: tuple[Path, str] | None = None
    surveyed: Samples | None = None
    origins: Origins | None = None
    refit: Path | None = None

    @property
    def label(self) -> str:
        """What it is called before people."""
        return f"{self.run.name} seed {self.seed}"


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
    refits
        Of refits that ended well.
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
    refits: pa.Table | None = None
    footer: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    failure: str = ""
    again: bool = False


def fly(task: Task, report: Report | None = None) -> Outcome:
    """Fly, replay or refit a mission, on one thread, and return its tables or what went wrong.

    Whatever a method of the user's raises fails the mission alone: only a signal gets through.

    Parameters
    ----------
    task
        The mission.
    report
        Called with the mission's number and 0 and None at the start, then with (samples collected,
        RMSE) after each epoch.
    """
    report = report or (lambda number, collected, rmse: None)
    started, clock, process = datetime.now(UTC), time.perf_counter(), os.getpid()
    report(task.number, 0, None)
    try:
        _check_version(task.run)

        from infoplan.threads import look_again, one_thread

        look_again()
        with one_thread():
            if task.refit is not None:
                from infoplan.study.refits import refit_mission

                refits = refit_mission(task.refit, task.run, task.seed)
                return Outcome(task, time.perf_counter() - clock, refits=refits)
            rows: list[CurveRow] = []
            stretches: list[StretchScore] = []
            flags: dict[int, NDArray[np.bool_]] = {}
            origins = _origins(task)
            for state in _states(task):
                _end_if_forked(process)
                rows.append(state.row)
                stretches += state.stretches
                if origins and state.row.collected in origins.ends:
                    flags[state.row.collected] = state.samples.flagged
                report(task.number, state.row.collected, state.row.rmse)
            verdicts = _later_verdicts(task, origins, flags, state) if origins else None
            tables = build_tables(task.run, task.seed, rows, state, stretches, verdicts)
            footer = provenance() | {
                "started": started.isoformat(timespec="milliseconds"),
                "ended": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "seconds": time.perf_counter() - clock,
            }
    except Interrupted:
        raise
    except BaseException as error:
        _end_if_forked(process)
        return failed(task, error, time.perf_counter() - clock)
    return Outcome(task, time.perf_counter() - clock, tables, footer=footer)


def _states(task: Task) -> Iterator["State"]:
    """Carry a task out, giving the mission's state after the pilot and each epoch."""
    config, terrain = task.run.config, task.run.terrain
    if task.surveyed is not None:
        from infoplan.mission import explore
        from infoplan.source import StoredSource
        from infoplan.terrain.relief import local_relief, thirds

        unknown = np.full(config.grid, np.nan)
        third = thirds(local_relief(unknown, terrain.extent)).ravel()
        source = StoredSource(task.surveyed, terrain.extent, unknown.ravel(), third, labelled=False)
        return explore(config, source, task.seed)
    if task.flown is None:
        from infoplan.mission import explore
        from infoplan.simulator import Simulator

        return explore(config, Simulator(config, terrain, task.seed), task.seed)
    from infoplan.study.replayed import explore_again

    samples, maps = (
        read_table(task.flown[0], name, task.flown[1], task.seed).to_pandas()
        for name in ("samples", "maps")
    )
    return explore_again(config, task.seed, samples, maps)


def _origins(task: Task) -> Origins | None:
    """Say where the samples of a survey of several logs come from; None of any other mission."""
    if task.flown is None:
        return task.origins
    where = (task.flown[0], "origins", task.flown[1], task.seed)
    if not os.path.lexists(table_path(*where)):
        return None
    table = read_table(*where).to_pandas()
    names = tuple(dict.fromkeys(table["log"]))
    log = table["log"].map(names.index).to_numpy(dtype=np.int64)
    return Origins(names, log, table["row"].to_numpy(dtype=np.int64))


def _later_verdicts(
    task: Task, origins: Origins, flags: dict[int, NDArray[np.bool_]], last: "State"
) -> dict[str, Any]:
    """Columns of the table ``origins``."""
    first = flagged_first(origins, flags) & ~np.isnan(last.samples.measured)
    lengthscales = np.array([last.row.lengthscale_1, last.row.lengthscale_2])
    judged_again = task.run.config.detector.scope == "historical"
    return {
        "log": [origins.names[number] for number in origins.log],
        "row": origins.row,
        "flagged_first": first,
        "verdict": verdicts(origins, first, last.samples, lengthscales)
        if judged_again
        else [None] * len(first),
    }


def _end_if_forked(process: int) -> None:
    """End a child that a method has forked and that came back: it has nothing to say here."""
    if os.getpid() != process:
        os._exit(0)


def fly_on_dask(task: Task, topic: str) -> Outcome:
    """Fly a mission on a Dask worker, and report through Dask's events.

    A worker of several threads flies one mission at a time: the number of threads of the numerical
    libraries, which decides the last bits, is that of the whole process.
    """
    from distributed import get_worker

    worker = get_worker()

    def report(number: int, collected: int, rmse: float | None) -> None:
        worker.log_event(topic, {"mission": number, "collected": collected, "rmse": rmse})

    with _one_mission:
        return fly(task, report)


def failed(task: Task, error: BaseException, seconds: float = 0.0) -> Outcome:
    """Describe a mission that raised; texts of any length are kept short."""
    text = "".join(traceback.format_exception(error))
    if isinstance(error, UsageError | RunError):
        last = str(error)
    elif isinstance(error, MemoryError):
        last = (
            f"it needs more memory than there is ({error or 'MemoryError'}): lower budget= "
            "or grid=, or n_jobs= where several missions share the memory"
        )
    else:
        last = " ".join(traceback.format_exception_only(error)[-1].split())
    return Outcome(
        task, seconds, reason=harmless(shortened(last, LONGEST_REASON)),
        failure=shortened(text, LONGEST_FAILURE),
    )  # fmt: skip


def shortened(text: str, longest: int) -> str:
    """Leave out the middle of a text that is too long: the head and the tail tell most."""
    if len(text) <= longest:
        return text
    half = longest // 2
    return f"{text[:half]} ... [{len(text) - 2 * half} characters left out] ... {text[-half:]}"


def get_ready(configs: list[MissionConfig], compiling: bool, report: Report) -> None:
    """Import what missions need, and compile the numerical kernels that are not in the cache.

    To compile, each kind of mission is flown for an epoch with next to no data, without the user's
    methods. What goes wrong here goes wrong in the missions too, and is told there.

    Parameters
    ----------
    configs
        Configurations of the missions to come.
    compiling
        False: imports only, because another worker compiles.
    report
        Called if compiling takes long.
    """
    from infoplan.mission import explore
    from infoplan.simulator import Simulator
    from infoplan.terrain import load_terrain

    if any(config.detector.name == "pyod" for config in configs):
        load_matplotlib()  # as PyOD does
        with suppress(ImportError):
            import pyod.models.base  # noqa: F401 - takes a second
    if not compiling:
        return
    shrunk: list[MissionConfig] = []
    for config in configs:
        own = {group: getattr(config, group).name == "own" for group in ("planner", "model")}
        planner = RandomConfig() if own["planner"] else config.planner
        model = GpConfig() if own["model"] else config.model
        config = replace(
            config,
            detector=DetectorConfig(),
            pilot=replace(config.pilot, samples=5),
            model=replace(model, pilot_iterations=1, iterations=1),
            planner=with_values(planner, iterations=2, actions=1),
            terrain=TerrainConfig(extent=config.terrain.extent),
            rho=0.1,
            grid=[2, 2],
            budget=6,
        )
        if config not in shrunk:
            shrunk.append(config)
    notice = threading.Timer(NOTICE_SECONDS, report, [COMPILING, 0, None])
    notice.daemon = True
    notice.start()
    for config in shrunk:
        with suppress(Exception), warnings.catch_warnings(action="ignore"):
            terrain = load_terrain("volcano", extent=config.terrain.extent)
            for _ in explore(config, Simulator(config, terrain, seed=0), seed=0):
                pass
    notice.cancel()


def compile_on_dask(configs: list[MissionConfig]) -> None:
    """Compile the kernels on a Dask worker (`get_ready`)."""
    get_ready(configs, True, lambda number, collected, rmse: None)


def _check_version(run: Run) -> None:
    """Refuse a task from an infoplan whose numbers are others: its tables would be misnamed."""
    wanted = run.science["numerics_version"]
    if wanted != NUMERICS_VERSION:
        raise RunError(
            f"this worker's infoplan computes numbers of version {NUMERICS_VERSION}, the run wants "
            f"version {wanted}: install the same infoplan on all machines"
        )
