"""The one executor: missions to fly, replay or refit go through one pool of workers.

Each is stored. This process is the only one that writes: workers hand their tables back. It holds
the lock of each mission that is under way, so that other infoplan processes on the same results
fly other missions.
"""

import sys
import time
from collections import deque
from datetime import UTC, datetime
from typing import Any

from infoplan.caches import kernel_note
from infoplan.config import Config
from infoplan.errors import RunError
from infoplan.files import remedy
from infoplan.mission_cost import seconds_of
from infoplan.study.estimate import Pace, kind_of
from infoplan.study.flight import Outcome, Task
from infoplan.study.limits import affordable_workers, warning_of_time
from infoplan.study.listening import Listener, Progress
from infoplan.study.locks import Lock, NoLocksError, acquire, no_locks
from infoplan.study.pool import Pool, open_pool, worker_count
from infoplan.study.provenance import git_state
from infoplan.study.signals import postponed, stoppable
from infoplan.study.store import (
    save_configuration,
    save_derived,
    save_failure,
    save_mission,
)
from infoplan.study.study import Study

POLL_SECONDS = 0.5
"""How often a mission that another process holds is looked at again."""

MACHINE = ("python", "blas", "cpu")
MATHEMATICS = ("numpy", "scipy", "scikit-learn", "pyod", "numba", "llvmlite")
"""What decides the last digits: parts of a footer, and the libraries among them."""


def carry_out(study: Study, config: Config, listener: Listener) -> None:
    """Fly, replay or refit what is not done of a study, in one pool, and store the tables.

    Parameters
    ----------
    study
        What is wanted and what is stored; is told what was done.
    config
        How to run: workers, backend, what to do on an error, what to keep.
    listener
        Is told of warnings and progress.

    Raises
    ------
    UsageError
        If a backend is not installed.
    RunError
        If a table cannot be stored, or the pool is lost; what is finished is kept.
    """
    if note := kernel_note():
        listener.say(f"WARNING: {note}", "warning")
    for stored in study.stored.values():
        if stored.state == "broken":
            listener.say(f"WARNING: {stored.reason}: it is computed again", "warning")
    tasks = study.todo(config.resume)
    study.done = set(study.stored) - {(task.run.name, task.seed) for task in tasks}
    study.kept = len(study.done)
    if study.kept:
        listener.say(
            f"{study.kept} of {len(study.stored)} missions are there already and are kept", "note"
        )
    for run, seeds in study.runs:
        done = any(study.stored[run.name, seed].state == "done" for seed in seeds)
        if done and save_configuration(study.results_dir, run):
            listener.say(
                f"WARNING: runs/{run.name}.yaml did not hold the run's configuration: it is "
                "written again", "warning",
            )  # fmt: skip
    git_state()  # now: the code may change while missions fly
    start = time.monotonic()
    if tasks:
        with stoppable():
            fly_all(tasks, study, config, listener)
    study.seconds = time.monotonic() - start


def fly_all(tasks: list[Task], study: Study, config: Config, listener: Listener) -> None:
    """Fly missions in parallel; store each as it comes back.

    Parameters
    ----------
    tasks
        In the order in which they are to be started.
    study
        What it counts, and where its results are.
    config
        How to run: workers, backend, what to do on an error.
    listener
        Is told of warnings and progress.

    Raises
    ------
    RunError
        If a table cannot be stored, or the pool is lost.
    """
    missions = [run.config for run in {t.run.name: t.run for t in tasks}.values()]
    workers = 1 if config.backend == "sequential" else worker_count(config.n_jobs)
    workers, fewer = affordable_workers(min(workers, len(tasks)), missions)
    elsewhere = config.scheduler is not None
    if not elsewhere:
        if fewer:
            listener.say(fewer, "warning")
        long = warning_of_time(expected_seconds(tasks, study.pace), workers)
        if long:
            listener.say(f"WARNING: {long}", "warning")
    with (
        listener.follow(tasks, study.pace, study.kept) as progress,
        open_pool(config, workers, progress) as pool,
    ):
        progress.workers = pool.size()
        pool.get_ready(missions, len(tasks))
        Flight(tasks, study, config, pool, progress).fly()


def expected_seconds(tasks: list[Task], pace: Pace) -> float:
    """Seconds of all missions one after the other, by those of their kind or their operations."""
    each = {}
    for run in {task.run.name: task.run for task in tasks}.values():
        known = pace.of_kind(kind_of(run.science, run.config))
        each[run.name] = seconds_of(run.config) if known is None else known
    return sum(each[task.run.name] for task in tasks)


class Flight:
    """The missions of a study on their way through a pool.

    A mission is waiting, held (by another process), or flying, under this process's lock.
    """

    def __init__(
        self, tasks: list[Task], study: Study, config: Config, pool: Pool, progress: Progress
    ):
        self.study, self.config, self.pool, self.progress = study, config, pool, progress
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
        self.progress.workers = self.pool.size()
        while self.waiting and len(self.locks) < self.progress.workers:
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
                self.progress.skip(task.number)
                continue
            self.locks[task.number] = lock
            self.progress.start(task.number)
            self.pool.start(task)

    def done_elsewhere(self, task: Task) -> bool:
        """Whether another process has finished a mission since this study began."""
        name, seed = task.run.name, task.seed
        return self.config.resume and self.study.inspect(name, seed).state == "done"

    def settle(self, outcome: Outcome) -> None:
        """Store a mission that has ended, or try it again, or record its failure."""
        task = outcome.task
        try:
            if outcome.tables is not None:
                self.store(outcome)
            elif outcome.refits is not None:
                self.store_refits(outcome)
            elif outcome.again and not self.stopping:
                # Later, when whatever has eaten the memory may be gone.
                self.waiting.append(task)
                self.progress.wait(task.number)
                self.progress.say(
                    f"{task.label}  {outcome.reason}: it will be tried once more", "warning",
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
        self.progress.finish(task.number, outcome.seconds, tables.curves["rmse"][-1].as_py())

    def store_refits(self, outcome: Outcome) -> None:
        """Write the refits of a mission."""
        task, refits = outcome.task, outcome.refits
        assert refits is not None
        save_derived(self.study.results_dir, "refits", task.run.name, task.seed, refits)
        self.study.computed += 1
        self.study.done.add((task.run.name, task.seed))
        self.progress.finish(task.number, outcome.seconds, refits["rmse"][0].as_py())

    def record_failure(self, outcome: Outcome) -> None:
        """Show a failure and keep its traceback; with ``on_error=stop`` start nothing more."""
        task, label = outcome.task, outcome.task.label
        self.progress.fail(task.number, outcome.reason)
        when = datetime.now(UTC).isoformat(timespec="seconds")
        text = f"{label}\n{when}\n{' '.join(sys.orig_argv)}\n\n{outcome.failure}"
        what = "refits-" if self.study.refit else ""
        path = save_failure(self.study.results_dir, task.run.name, task.seed, text, what)
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
            self.progress.say(f"WARNING: {text}" if subject != "others" else text, "warning")


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Name what differs between two footers in machine and mathematics."""
    differing = [name for name in MACHINE if one.get(name) != other.get(name)]
    libraries = [footer.get("libraries") or {} for footer in (one, other)]
    return differing + [
        name for name in MATHEMATICS if libraries[0].get(name) != libraries[1].get(name)
    ]
