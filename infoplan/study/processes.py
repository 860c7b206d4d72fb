"""Worker processes on this machine: missions on this side of a pipe, flown on the other."""

import io
import os
import re
import resource
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from multiprocessing import resource_tracker as multiprocessing_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from infoplan.config import METHODS, MissionConfig
from infoplan.errors import RunError
from infoplan.study.flight import ONE_THREAD, Outcome, Task, failed, fly, get_ready, shortened
from infoplan.study.listening import Progress
from infoplan.study.signals import postponed
from infoplan.wording import figure, harmless

TRIES = 2
"""How often a mission is started whose worker dies each time."""

STILLBIRTHS = 3
"""After so many workers in a row have died while they started, no more are tried."""

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
KILL_SECONDS = 1.0

LONGEST_HEARD = 64_000
"""Bytes that are kept of what a worker writes to standard error during a mission."""

LONGEST_TOLD = 160
"""Characters of a worker's last words that a sentence quotes."""

SHORT_OF_MEMORY = re.compile(
    r"MemoryError|bad_alloc|[Cc]annot allocate|Unable to allocate|[Oo]ut of memory|"
    r"[Mm]emory allocation|failed to map segment|Could not find/load shared object|"
    r"can't start new thread|Resource temporarily unavailable"
)
"""What Python, the loader, OpenBLAS and LLVM say where memory is short."""


class Worker:
    """A process that flies missions one by one: one of joblib's loky processes, with its own pipes.

    A pipe of its own makes clear whose mission a death has cost, and cannot be left half-read by
    another worker's death. The second pipe is never written: it ends when the parent does. The
    third is the worker's standard error, which tells what it died of.
    """

    def __init__(self) -> None:
        from joblib.externals.loky.backend.context import get_context

        context = get_context("loky")
        self.task: Task | None = None
        self.since = 0.0
        self.ready = False
        self.heard = b""
        theirs: Connection
        self.connection, theirs = context.Pipe()
        their_lifeline, self.lifeline = context.Pipe(duplex=False)
        self.voice, their_voice = os.pipe()
        os.set_blocking(self.voice, False)
        self.process = context.Process(
            target=serve, args=(theirs, their_lifeline), daemon=True,
            env={**ONE_THREAD, "MPLBACKEND": "Agg"},
        )  # fmt: skip
        try:
            with deaf_children(), _standard_error_into(their_voice):
                self.process.start()
        except BaseException:
            for end in (self.connection, self.lifeline):
                end.close()
            os.close(self.voice)
            raise
        finally:
            theirs.close()
            their_lifeline.close()
            os.close(their_voice)

    def send(self, *call: Any) -> bool:
        """Send a call; False if the worker is dead."""
        try:
            self.connection.send(call)
        except OSError:
            return False
        return True

    def fly(self, task: Task) -> bool:
        """Send it the mission that it has been given; False if it is dead."""
        self.task, self.since = task, time.monotonic()
        return self.send(fly, task)

    def listen(self) -> None:
        """Take in what it has written to standard error, the first and the last of it."""
        with suppress(BlockingIOError):
            while piece := os.read(self.voice, LONGEST_HEARD):
                heard = self.heard + piece
                half = LONGEST_HEARD // 2
                self.heard = heard if len(heard) < 2 * half else heard[:half] + heard[-half:]

    def said(self) -> str:
        """Return what it has written to standard error since this was asked last."""
        self.listen()
        heard, self.heard = self.heard, b""
        return heard.decode("utf-8", "replace")

    def end(self) -> int | None:
        """Kill the process unless it is dead; return its exit code."""
        self.lifeline.close()
        self.connection.close()
        self.process.join(KILL_SECONDS)
        if self.process.exitcode is None:
            self.kill()
            self.process.join(KILL_SECONDS)
        os.close(self.voice)
        return self.process.exitcode

    def kill(self) -> None:
        """Kill the process."""
        with suppress(OSError):  # dead already
            os.kill(self.process.pid, KILL)


def serve(connection: Connection, lifeline: Connection) -> None:
    """Answer calls until the pipe ends; the whole life of a `Worker`'s process.

    Each call gets reports, tuples, and then the function's answer.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_die_with, args=(lifeline,), daemon=True).start()
    speaking = threading.Lock()

    def report(*news: Any) -> None:
        with speaking:
            connection.send(news)

    while True:
        try:
            function, *arguments = connection.recv()
        except (EOFError, OSError):
            return
        answer = function(*arguments, report)
        with speaking:
            connection.send(answer)


class ProcessPool:
    """Worker processes on this machine, replaced when they die.

    Parameters
    ----------
    workers
        How many.
    progress
        Is told what missions report, and what workers write to standard error.
    timeout
        Seconds after which a mission is given up; None: never.
    """

    def __init__(self, workers: int, progress: Progress, timeout: float | None = None):
        self.workers: list[Worker] = []
        self.limit, self.progress, self.timeout = workers, progress, timeout
        self.deaths: Counter[int] = Counter()
        self.stillborn = 0

    def size(self) -> int:
        """Return the number of workers."""
        return self.limit

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Start as many workers as there is work for; the first compiles, the others import."""
        for number in range(min(self.limit, missions)):
            self._hire(configs, compiling=number == 0)
        while any(not worker.ready for worker in self.workers):
            self.wait(KILL_SECONDS)

    def start(self, task: Task) -> None:
        """Fly a mission on a free worker; one that is not ready yet gets it when it is."""
        for worker in [worker for worker in self.workers if worker.task is None]:
            if worker.ready and not worker.fly(task):
                worker.task = None
                self._bury(worker)  # it died idle
                continue
            worker.task = task
            return
        self._hire([task.run.config]).task = task

    def wait(self, seconds: float) -> list[Outcome]:
        """Wait for missions to end, workers to die, or missions to take too long."""
        if not self.workers:
            return []
        outcomes = []
        speaking = wait(
            [worker.connection for worker in self.workers]
            + [worker.voice for worker in self.workers],
            seconds,
        )
        for worker in list(self.workers):
            if worker.voice in speaking:
                worker.listen()
            if worker.connection in speaking:
                outcomes.extend(self._hear(worker))
            elif self._is_late(worker):
                outcomes.append(self._give_up(worker))
        return outcomes

    def close(self) -> None:
        """Kill all workers."""
        for worker in self.workers:
            worker.kill()
        for worker in self.workers:
            worker.end()

    def _hear(self, worker: Worker) -> list[Outcome]:
        try:
            answer = worker.connection.recv()
        except (EOFError, OSError):
            return self._bury(worker)
        except Exception as error:  # an answer that cannot be read here
            answer = failed(worker.task, error) if worker.task else None
        if isinstance(answer, tuple):
            self.progress.report(*answer)
            return []
        if not isinstance(answer, Outcome):
            worker.ready, self.stillborn = True, 0
            if worker.task:
                worker.fly(worker.task)
            return []
        if said := worker.said():
            self.progress.overhear(shortened(said, LONGEST_HEARD))
        if worker.task and uses_own(worker.task.run.config):
            # Such code may have changed NumPy, the locale, anything: it goes with its process.
            self.workers.remove(worker)
            worker.end()
        worker.task = None
        return [answer]

    def _hire(self, configs: list[MissionConfig], compiling: bool = False) -> Worker:
        try:
            worker = Worker()
        except (OSError, MemoryError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or error or type(error).__name__
            raise RunError(
                f"no worker process can be started ({reason}): lower n_jobs, or give it more of "
                "what is short (ulimit -a shows memory, open files, processes); what is finished "
                "is kept"
            ) from error
        self.workers.append(worker)
        worker.send(get_ready, configs, compiling)
        return worker

    def _bury(self, worker: Worker) -> list[Outcome]:
        self.workers.remove(worker)
        said = worker.said()
        code = worker.end()
        reason = cause(code, said)
        if not worker.ready:
            self.stillborn += 1
            if self.stillborn >= STILLBIRTHS:
                raise RunError(f"no worker can be started: {reason}; what is finished is kept")
        if worker.task is None:
            return []
        self.deaths[worker.task.number] += 1
        return [died(worker.task, reason, self.deaths[worker.task.number], said)]

    def _is_late(self, worker: Worker) -> bool:
        flying = worker.ready and worker.task is not None
        late = self.timeout is not None and time.monotonic() - worker.since > self.timeout
        return flying and late

    def _give_up(self, worker: Worker) -> Outcome:
        assert worker.task is not None
        assert self.timeout is not None
        self.workers.remove(worker)
        worker.kill()
        said = worker.said()
        worker.end()
        reason = (
            f"it took longer than mission_timeout={self.timeout:g} seconds and was ended: raise "
            "mission_timeout, or see whether a method never ends"
        )
        return Outcome(worker.task, self.timeout, reason=reason, failure=f"{reason}\n\n{said}")


def uses_own(config: MissionConfig) -> bool:
    """Whether a mission calls a planner, detector or model of the user's."""
    return any(getattr(config, group).name == "own" for group in METHODS)


def died(task: Task, reason: str, times: int, said: str = "") -> Outcome:
    """Describe a mission whose worker has died, so many times now, and its last words."""
    if times > 1:
        reason = f"{reason}, {times} times"
    return Outcome(task, reason=reason, failure=f"{reason}\n\n{said}", again=times < TRIES)


def cause(code: int | None, said: str) -> str:
    """Say what a process died of, from its exit code and its last words."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    telling = [line for line in lines if SHORT_OF_MEMORY.search(line)] or lines
    words = f": {harmless(shortened(telling[-1], LONGEST_TOLD))}" if telling else ""
    name = f"exit status {code}"
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
    hint = ""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if name == "SIGKILL":
        hint = ", perhaps out of memory"
    elif SHORT_OF_MEMORY.search(said) and limit != resource.RLIM_INFINITY:
        hint = f", out of memory: a process may have {figure(limit / 1e6)} MB here, raise ulimit -v"
    elif SHORT_OF_MEMORY.search(said):
        hint = ", out of memory: lower n_jobs, budget or grid"
    return f"its worker died ({name}{words}{hint})"


def _die_with(lifeline: Connection) -> None:
    """End this process when the other end of the pipe does: the parent is dead, or has enough."""
    with suppress(EOFError, OSError):
        lifeline.recv()
    os._exit(1)


@contextmanager
def _standard_error_into(descriptor: int) -> Iterator[None]:
    """Let a process that is started in the block write its standard error elsewhere.

    The start flushes this process' own streams, which may be closed or full: not those, therefore.
    """
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        try:
            kept = os.dup(2)
        except OSError:  # it is closed
            kept = -1
        os.dup2(descriptor, 2)
        try:
            yield
        finally:
            if kept < 0:
                os.close(2)
            else:
                os.dup2(kept, 2)
                os.close(kept)


@contextmanager
def deaf_children() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, and start them whole: signals wait until it is done.

    An interrupted start would leave a process without its first message.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Started inside, the helper processes of multiprocessing would unblock the signal too early.
    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    for tracker in (multiprocessing_tracker, loky_tracker):
        tracker.ensure_running()
    with postponed():
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
