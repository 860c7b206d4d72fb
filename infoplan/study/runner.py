"""Run configurations x seeds in one pool of workers and store what comes back."""

import os
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from infoplan.config import (
    Config,
    DetectorConfig,
    MissionConfig,
    TerrainConfig,
    seed_list,
    validate,
)
from infoplan.errors import RunError, UsageError
from infoplan.study.identity import Run, identify
from infoplan.study.progress import Address, Display, Line, reporter
from infoplan.study.provenance import git_state, provenance
from infoplan.study.store import MissionTables, build_tables, is_done, prepare, save_mission
from infoplan.terrain import Terrain, load_terrain


@dataclass(frozen=True)
class Task:
    """A mission to fly: one run, one seed, and its number in the display."""

    run: Run
    seed: int
    number: int


@dataclass
class Outcome:
    """What a worker sends back: tables and footer, or the traceback of a failure."""

    task: Task
    seconds: float
    tables: MissionTables | None = None
    footer: dict[str, Any] = field(default_factory=dict)
    failure: str = ""


@dataclass
class Study:
    """What `run_study` did.

    Attributes
    ----------
    names
        Name of the run of each configuration, in their order.
    runs
        The different runs with the seeds asked for.
    results_dir
        Where their tables are.
    computed, kept
        Number of missions flown now, and found done.
    failed
        Label and reason of each failed mission.
    seconds
        Wall time.
    """

    names: list[str]
    runs: list[tuple[Run, list[int]]]
    results_dir: Path
    computed: int = 0
    kept: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0


def run_study(configs: list[Config], console: Console) -> Study:
    """Run all configurations with all their seeds in one pool, and store the tables.

    Parameters
    ----------
    configs
        Valid or not; they are validated before any work.
    console
        Where progress and warnings go.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        If a configuration is wrong, a map cannot be had, or the results cannot be written.
    RunError
        If a table cannot be stored.
    """
    for config in configs:
        validate(config)
    first = configs[0]
    results_dir = Path(first.results_dir).expanduser()
    prepare(results_dir)
    terrains = load_terrains([config.terrain for config in configs], console)
    identified = [identify(*pair) for pair in zip(configs, terrains, strict=True)]
    runs = merge_runs(identified, [seed_list(config.seeds) for config in configs])
    study = Study([run.name for run in identified], runs, results_dir)
    wanted = [(run, seed) for run, seeds in study.runs for seed in seeds]
    todo = [
        (run, seed)
        for run, seed in wanted
        if not (first.resume and is_done(results_dir, run.name, seed))
    ]
    study.kept = len(wanted) - len(todo)
    if study.kept:
        console.print(f"{study.kept} of {len(wanted)} missions are there already and are kept")
    # Longest first, so that no worker starts a long mission when the others are done.
    todo.sort(key=lambda item: -item[0].config.budget)
    tasks = [Task(run, seed, number) for number, (run, seed) in enumerate(todo)]
    start = time.monotonic()
    if tasks:
        compile_kernels([run for run, _ in study.runs], console)
        fly_all(tasks, study, first.n_jobs, console)
    study.seconds = time.monotonic() - start
    return study


def load_terrains(wanted: Iterable[TerrainConfig], console: Console) -> list[Terrain]:
    """Load each map once, here in the parent, so that all workers use the same.

    A fallback to another map is shown once, loudly, before any work.
    """
    loaded: dict[str, Terrain] = {}
    terrains = []
    for config in wanted:
        key = repr(config)
        if key not in loaded:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                loaded[key] = load_terrain(
                    config.name,
                    path=config.path,
                    extent=tuple(config.extent),
                    unit=config.unit,
                    on_missing=config.on_missing,
                )
            for warning in caught:
                console.print(f"WARNING: {warning.message}", style="bold yellow", soft_wrap=True)
        terrains.append(loaded[key])
    return terrains


def merge_runs(runs: list[Run], seeds: list[list[int]]) -> list[tuple[Run, list[int]]]:
    """Make configurations that are the same run one, with all their seeds."""
    merged: dict[str, tuple[Run, list[int]]] = {}
    for run, wanted in zip(runs, seeds, strict=True):
        known = merged.setdefault(run.name, (run, []))[1]
        known.extend(seed for seed in wanted if seed not in known)
    return list(merged.values())


def compile_kernels(runs: list[Run], console: Console) -> None:
    """Compile the numerical kernels here, once, so that all workers find them in the cache.

    Each kind of run is flown for an epoch with next to no data.
    """
    from infoplan.mission import Mission

    shrunk: list[MissionConfig] = []
    for run in runs:
        config = replace(
            run.config,
            detector=DetectorConfig(),
            pilot=replace(run.config.pilot, samples=5),
            model=replace(run.config.model, pilot_iterations=1, iterations=1),
            planner=replace(run.config.planner, iterations=2),
            grid=[2, 2],
            budget=6,
        )
        if config not in shrunk:
            shrunk.append(config)
    notice = threading.Timer(
        1.0, console.print, ["compiling the numerical kernels, once on this machine ..."]
    )
    notice.start()
    try:
        for config in shrunk:
            for _ in Mission(config, runs[0].terrain, seed=0).run():
                pass
    finally:
        notice.cancel()


def fly_all(tasks: list[Task], study: Study, n_jobs: int, console: Console) -> None:
    """Fly missions in parallel; store each as it comes back."""
    lines = [
        Line(f"{task.run.name} seed {task.seed}", task.run.config.budget, task.run.terrain.unit)
        for task in tasks
    ]
    with Display(lines, console) as display:
        for outcome in _outcomes(tasks, n_jobs, display.address):
            task = outcome.task
            if outcome.tables is None:
                reason = outcome.failure.strip().splitlines()[-1]
                study.failed.append((lines[task.number].label, outcome.failure))
                display.fail(task.number, reason)
                continue
            footer = outcome.footer | {"command": sys.orig_argv, "git": git_state()}
            save_mission(study.results_dir, task.run, task.seed, outcome.tables, footer)
            study.computed += 1
            display.finish(task.number, outcome.seconds, outcome.tables.curves["rmse"][-1].as_py())


def _outcomes(tasks: list[Task], n_jobs: int, address: Address) -> Iterator[Outcome]:
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", n_jobs=n_jobs, inner_max_num_threads=1):
        # One mission a dispatch: a finished mission must come back at once.
        pool = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="n_jobs")
        yield from pool(delayed(fly)(task, address) for task in tasks)


def fly(task: Task, address: Address | None) -> Outcome:
    """Fly one mission in a worker, on one thread, and return its tables."""
    os.environ.setdefault("MPLBACKEND", "Agg")  # PyOD imports pyplot
    from threadpoolctl import threadpool_limits

    from infoplan.mission import Mission

    started, clock = datetime.now(UTC), time.perf_counter()
    report = reporter(address, task.number)
    try:
        with threadpool_limits(limits=1):
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
    except (UsageError, RunError) as error:
        return Outcome(task, time.perf_counter() - clock, failure=str(error))
    except Exception:
        return Outcome(task, time.perf_counter() - clock, failure=traceback.format_exc())
    return Outcome(task, time.perf_counter() - clock, tables, footer)
