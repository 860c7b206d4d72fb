"""Run configurations x seeds in one pool of workers and store what comes back.

This process is the only one that writes: workers hand their tables back. It holds the lock of each
mission that is under way, so that other infoplan processes on the same results fly other missions.
"""

import sys
import time
import warnings
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from infoplan.caches import kernel_note
from infoplan.config import Config, TerrainConfig, seed_list, validate
from infoplan.errors import RunError, UsageError
from infoplan.study.estimate import Pace, kind_of, learn
from infoplan.study.flight import Outcome, Task
from infoplan.study.identity import Run, identify
from infoplan.study.limits import (
    affordable_workers,
    check_count,
    check_mission,
    seconds_of,
    warning_of_time,
)
from infoplan.study.locks import Lock, NoLocksError, acquire, no_locks
from infoplan.study.pool import Pool, open_pool, worker_count
from infoplan.study.progress import Display, Line
from infoplan.study.provenance import git_state
from infoplan.study.signals import postponed, stoppable
from infoplan.study.store import (
    Stored,
    inspect,
    prepare,
    remedy,
    save_configuration,
    save_failure,
    save_mission,
)
from infoplan.terrain import Terrain, load_terrain

POLL_SECONDS = 0.5
"""How often a mission that another process holds is looked at again."""

SHARED = (
    "n_jobs", "backend", "scheduler", "mission_timeout", "on_error", "results_dir", "resume",
)  # fmt: skip
"""Options that all configurations of a study have in common, because they share one pool."""

MACHINE = ("python", "blas", "cpu")
MATHEMATICS = ("numpy", "scipy", "scikit-learn", "pyod", "numba", "llvmlite")
"""What decides the last digits: parts of a footer, and the libraries among them."""


@dataclass
class Study:
    """A study: what it consists of, and what `run_study` did.

    Attributes
    ----------
    names
        Name of the run of each configuration, in their order.
    runs
        The different runs with the seeds asked for.
    results_dir
        Where their tables are.
    stored
        What was there of each mission, by run and seed, when the study began.
    pace
        Seconds of all missions in the results.
    done
        Missions that were kept or flown now, by run and seed: those that tables and numbers count.
    computed, kept, unstarted
        Number of missions flown now, found done, and left by ``on_error=stop``.
    failed
        Label, one-line reason and file of each failed mission.
    seconds
        Wall time.
    """

    names: list[str]
    runs: list[tuple[Run, list[int]]]
    results_dir: Path
    stored: dict[tuple[str, int], Stored] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)
    done: set[tuple[str, int]] = field(default_factory=set)
    computed: int = 0
    kept: int = 0
    unstarted: int = 0
    failed: list[tuple[str, str, Path]] = field(default_factory=list)
    seconds: float = 0.0

    def todo(self, resume: bool) -> list[Task]:
        """List the missions to fly, longest first, so that none is left alone at the end."""
        missions = [
            (run, seed)
            for run, seeds in self.runs
            for seed in seeds
            if not (resume and self.stored[run.name, seed].state == "done")
        ]
        kinds = {run.name: kind_of(run.science) for run, _ in self.runs}
        length = {name: self.pace.seconds(kind) or kind.work for name, kind in kinds.items()}
        missions.sort(key=lambda mission: -length[mission[0].name])
        return [Task(run, seed, number) for number, (run, seed) in enumerate(missions)]


def check_study(configs: list[Config]) -> None:
    """Check every configuration, and that they can share a pool.

    Raises
    ------
    UsageError
        Names the first option that is wrong and what it may be.
    """
    for config in configs:
        validate(config)
    for name in SHARED:
        if len(values := {str(getattr(config, name)) for config in configs}) > 1:
            raise UsageError(
                f"{name}={','.join(sorted(values))} cannot be swept: all configurations of a study "
                f"share one pool and one results_dir, so give {name} one value"
            )
    for config in configs:
        check_mission(config)
    check_count(
        sum(len(seed_list(config.seeds)) for config in configs),
        f"seeds={configs[0].seeds}" if len(configs) == 1 else "this sweep",
    )


def plan_study(configs: list[Config], console: Console) -> Study:
    """Find out what a study consists of and what of it is done; nothing is written.

    Parameters
    ----------
    configs
        Valid (`check_study`).
    console
        Where warnings go.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        If a map cannot be had.
    """
    study = identify_study(configs, console)
    study.pace = learn(study.results_dir)
    for run, seeds in study.runs:
        for seed in seeds:
            study.stored[run.name, seed] = inspect(study.results_dir, run.name, seed)
    return study


def identify_study(configs: list[Config], console: Console) -> Study:
    """Find out what a study consists of; parameters and errors as of `plan_study`."""
    terrains = load_terrains([config.terrain for config in configs], console)
    identified = [identify(*pair) for pair in zip(configs, terrains, strict=True)]
    runs = merge_runs(identified, [seed_list(config.seeds) for config in configs])
    results_dir = Path(configs[0].results_dir).expanduser()
    return Study([run.name for run in identified], runs, results_dir)


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
        If a table cannot be stored, or the pool is lost; what is finished is kept.
    """
    check_study(configs)
    first = configs[0]
    prepare(Path(first.results_dir).expanduser())
    if note := kernel_note():
        console.print(f"WARNING: {note}", style="yellow", soft_wrap=True)
    study = plan_study(configs, console)
    for stored in study.stored.values():
        if stored.state == "broken":
            console.print(f"WARNING: {stored.reason}: it is computed again", style="yellow",
                          soft_wrap=True)  # fmt: skip
    tasks = study.todo(first.resume)
    study.done = set(study.stored) - {(task.run.name, task.seed) for task in tasks}
    study.kept = len(study.done)
    if study.kept:
        console.print(
            f"{study.kept} of {len(study.stored)} missions are there already and are kept"
        )
    for run, seeds in study.runs:
        done = any(study.stored[run.name, seed].state == "done" for seed in seeds)
        if done and save_configuration(study.results_dir, run):
            console.print(f"WARNING: runs/{run.name}.yaml did not hold the run's configuration: "
                          "it is written again", style="yellow", soft_wrap=True)  # fmt: skip
    git_state()  # now: the code may change while missions fly
    start = time.monotonic()
    if tasks:
        with stoppable():
            fly_all(tasks, study, first, console)
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
                loaded[key] = load_terrain(**vars(config))
            for warning in caught:
                console.print(f"WARNING: {warning.message}", style="bold yellow", soft_wrap=True)
        terrains.append(loaded[key])
    return terrains


def merge_runs(runs: list[Run], seeds: list[Sequence[int]]) -> list[tuple[Run, list[int]]]:
    """Make configurations that are the same run one, with all their seeds."""
    merged: dict[str, tuple[Run, dict[int, None]]] = {}
    for run, wanted in zip(runs, seeds, strict=True):
        merged.setdefault(run.name, (run, {}))[1].update(dict.fromkeys(wanted))
    return [(run, list(known)) for run, known in merged.values()]


def fly_all(tasks: list[Task], study: Study, config: Config, console: Console) -> None:
    """Fly missions in parallel; store each as it comes back.

    Parameters
    ----------
    tasks
        In the order in which they are to be started.
    study
        What it counts, and where its results are.
    config
        How to run: workers, backend, what to do on an error.
    console
        Where progress goes.

    Raises
    ------
    RunError
        If a table cannot be stored, or the pool is lost.
    """
    lines = [
        Line(f"{task.run.name} seed {task.seed}", task.run.terrain.unit, task.run.config.budget,
             kind_of(task.run.science))
        for task in tasks
    ]  # fmt: skip
    missions = [run.config for run in {t.run.name: t.run for t in tasks}.values()]
    workers = 1 if config.backend == "sequential" else worker_count(config.n_jobs)
    workers, fewer = affordable_workers(min(workers, len(tasks)), missions)
    elsewhere = config.scheduler is not None
    if not elsewhere:
        if fewer:
            console.print(Text(fewer, style="yellow"), soft_wrap=True)
        long = warning_of_time(expected_seconds(tasks, study.pace), workers)
        if long:
            console.print(Text(f"WARNING: {long}", style="yellow"), soft_wrap=True)
    with (
        Display(lines, study.pace, 1, study.kept, console) as display,
        open_pool(config, workers, display) as pool,
    ):
        display.workers = pool.size()
        pool.get_ready(missions, len(tasks))
        Flight(tasks, study, config, pool, display).fly()


def expected_seconds(tasks: list[Task], pace: Pace) -> float:
    """Seconds of all missions one after the other, by those of their kind or their operations."""
    each = {}
    for run in {task.run.name: task.run for task in tasks}.values():
        known = pace.of_kind(kind_of(run.science))
        each[run.name] = seconds_of(run.config) if known is None else known
    return sum(each[task.run.name] for task in tasks)


class Flight:
    """The missions of a study on their way through a pool.

    A mission is waiting, held (by another process), or flying, under this process's lock.
    """

    def __init__(
        self, tasks: list[Task], study: Study, config: Config, pool: Pool, display: Display
    ):
        self.study, self.config, self.pool, self.display = study, config, pool, display
        self.waiting = deque(tasks)
        self.held: list[Task] = []
        self.locks: dict[int, Lock | None] = {}
        self.warned: set[str] = set()
        self.stopping = False

    def fly(self) -> None:
        """Fly all missions to their end."""
        try:
            while self.waiting or self.held or self.locks:
                self.start_missions()
                outcomes = self.pool.wait(POLL_SECONDS)
                with postponed():  # what has ended is not lost
                    for outcome in outcomes:
                        self.settle(outcome)
                if self.held and not self.waiting:
                    if not self.locks:
                        self.warn(
                            "others", "another infoplan process flies the rest: waiting for it"
                        )
                        time.sleep(POLL_SECONDS)
                    self.waiting.extend(self.held)
                    self.held.clear()
        finally:
            for lock in self.locks.values():
                if lock:
                    lock.release()

    def start_missions(self) -> None:
        """Start missions while there is room; what another process flies is left for last."""
        self.display.workers = self.pool.size()
        while self.waiting and len(self.locks) < self.display.workers:
            task = self.waiting.popleft()
            try:
                lock = acquire(self.study.results_dir, task.run.name, task.seed)
            except NoLocksError as error:
                self.warn("locks", no_locks(self.study.results_dir, error))
                lock = None
            except OSError as error:
                raise RunError(
                    f"no lock can be taken in {self.study.results_dir} ({error.strerror}): "
                    f"{remedy(error)}, then run the same command again; what is finished is kept"
                ) from error
            else:
                if lock is None:
                    self.held.append(task)
                    continue
            if self.done_elsewhere(task):
                if lock:
                    lock.release()
                self.study.kept += 1
                self.study.done.add((task.run.name, task.seed))
                self.display.skip(task.number)
                continue
            self.locks[task.number] = lock
            self.display.start(task.number)
            self.pool.start(task)

    def done_elsewhere(self, task: Task) -> bool:
        """Whether another process has finished a mission since this study began."""
        name, seed = task.run.name, task.seed
        return self.config.resume and inspect(self.study.results_dir, name, seed).state == "done"

    def settle(self, outcome: Outcome) -> None:
        """Store a mission that has ended, or try it again, or record its failure."""
        task = outcome.task
        try:
            if outcome.tables is not None:
                self.store(outcome)
            elif outcome.again and not self.stopping:
                # Later, when whatever has eaten the memory may be gone.
                self.waiting.append(task)
                self.display.wait(task.number)
                self.display.say(
                    f"{self.display.lines[task.number].label}  {outcome.reason}: it will be tried "
                    "once more", "yellow",
                )  # fmt: skip
            else:
                self.record_failure(outcome)
        finally:
            lock = self.locks.pop(task.number)
            if lock:
                lock.release()

    def store(self, outcome: Outcome) -> None:
        """Write the tables of a mission that ended well."""
        task, tables = outcome.task, outcome.tables
        assert tables is not None
        self.warn_of_other_machines(outcome.footer)
        footer = outcome.footer | {"command": sys.orig_argv, "git": git_state()}
        save_mission(self.study.results_dir, task.run, task.seed, tables, footer)
        self.study.computed += 1
        self.study.done.add((task.run.name, task.seed))
        self.display.finish(task.number, outcome.seconds, tables.curves["rmse"][-1].as_py())

    def record_failure(self, outcome: Outcome) -> None:
        """Show a failure and keep its traceback; with ``on_error=stop`` start nothing more."""
        task, label = outcome.task, self.display.lines[outcome.task.number].label
        self.display.fail(task.number, outcome.reason)
        when = datetime.now(UTC).isoformat(timespec="seconds")
        text = f"{label}\n{when}\n{' '.join(sys.orig_argv)}\n\n{outcome.failure}"
        path = save_failure(self.study.results_dir, task.run.name, task.seed, text)
        self.study.failed.append((label, outcome.reason, path))
        if self.config.on_error == "stop":
            self.stopping = True
            self.study.unstarted += len(self.waiting) + len(self.held)
            self.waiting.clear()
            self.held.clear()

    def warn_of_other_machines(self, footer: dict[str, Any]) -> None:
        """Say once if missions of this study were computed where the last digits may differ."""
        for stored in self.study.stored.values():
            differing = differences(vars(stored.footer), footer) if stored.footer else []
            if differing and self.config.resume:
                self.warn(
                    "machine", f"missions of this study were computed elsewhere (other "
                    f"{', '.join(differing)}): their last digits may differ; resume=false computes "
                    "all of them here",
                )  # fmt: skip
                return

    def warn(self, subject: str, text: str) -> None:
        """Show a warning once."""
        if subject not in self.warned:
            self.warned.add(subject)
            self.display.say(f"WARNING: {text}" if subject != "others" else text, "yellow")


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Name what differs between two footers in machine and mathematics."""
    differing = [name for name in MACHINE if one.get(name) != other.get(name)]
    libraries = [footer.get("libraries") or {} for footer in (one, other)]
    return differing + [
        name for name in MATHEMATICS if libraries[0].get(name) != libraries[1].get(name)
    ]
