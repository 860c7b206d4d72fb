"""Where missions fly: worker processes on this machine, a Dask cluster, or this very process.

All pools have the same few methods. A pool never raises because of a mission: it hands back an
`Outcome`, also of a mission whose worker died.
"""

import logging
import multiprocessing
import os
import queue
import signal
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import resource_tracker as multiprocessing_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Protocol

from infoplan.config import MissionConfig
from infoplan.errors import RunError, UsageError
from infoplan.study.flight import (
    ONE_THREAD,
    Outcome,
    Task,
    failed,
    fly_here,
    fly_on_dask,
    get_ready,
)
from infoplan.study.progress import Address, Report, reporter
from infoplan.study.signals import ignored, postponed

TRIES = 2
"""How often a mission is started whose worker dies each time."""

INNOCENT_LOSSES = 5
"""How often Dask may lose a mission that it has not started, before it counts as failed."""

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
KILL_SECONDS = 1.0
CLUSTER_TRIES = 3
CONNECT_SECONDS = 20.0
CLUSTER_SECONDS = 2.0
"""How often a Dask cluster is asked how many workers it has."""

Say = Callable[[str], None]


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
def open_pool(
    backend: str, n_jobs: int, scheduler: str | None, address: Address | None, say: Say
) -> Iterator[Pool]:
    """Open a pool and close it in any case.

    Parameters
    ----------
    backend
        ``loky``: worker processes; ``dask``: a Dask cluster; ``sequential``: this process.
    n_jobs
        Number of workers, as `worker_count` reads it.
    scheduler
        Address or scheduler file of a Dask cluster; None: a cluster on this machine.
    address
        Where workers on this machine report progress.
    say
        Shows a line to the user.

    Raises
    ------
    UsageError
        If Dask is not installed.
    RunError
        If no Dask scheduler answers.
    """
    pool: Pool
    if backend == "sequential":
        pool = SequentialPool(address)
    elif backend == "dask":
        pool = DaskPool(n_jobs, scheduler, address, say)
    else:
        pool = ProcessPool(worker_count(n_jobs), address)
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

    def __init__(self, address: Address | None):
        self.address = address
        self.ended: list[Outcome] = []

    def size(self) -> int:
        """Return 1."""
        return 1

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Compile the kernels."""
        get_ready(configs, True, self.address)

    def start(self, task: Task) -> None:
        """Fly a mission to its end."""
        self.ended.append(fly_here(task, self.address))

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the missions flown since the last call."""
        ended, self.ended = self.ended, []
        return ended

    def close(self) -> None:
        """Do nothing."""


class Worker:
    """A process that flies missions one by one: one of joblib's loky processes, with its own pipes.

    A pipe of its own makes clear whose mission a death has cost, and cannot be left half-read by
    another worker's death. The second pipe is never written: it ends when the parent does.
    """

    def __init__(self) -> None:
        from joblib.externals.loky.backend.context import get_context

        context = get_context("loky")
        self.task: Task | None = None
        self.ready = False
        theirs: Connection
        self.connection, theirs = context.Pipe()
        their_lifeline, self.lifeline = context.Pipe(duplex=False)
        self.process = context.Process(
            target=serve, args=(theirs, their_lifeline), daemon=True,
            env={**ONE_THREAD, "MPLBACKEND": "Agg"},
        )  # fmt: skip
        try:
            with _deaf_children():
                self.process.start()
        finally:
            theirs.close()
            their_lifeline.close()

    def send(self, *call: Any) -> bool:
        """Send a call; False if the worker is dead."""
        try:
            self.connection.send(call)
        except OSError:
            return False
        return True

    def end(self) -> int | None:
        """Kill the process unless it is dead; return its exit code."""
        self.lifeline.close()
        self.connection.close()
        self.process.join(KILL_SECONDS)
        if self.process.exitcode is None:
            self.kill()
            self.process.join(KILL_SECONDS)
        return self.process.exitcode

    def kill(self) -> None:
        """Kill the process."""
        with suppress(OSError):  # dead already
            os.kill(self.process.pid, KILL)


def serve(connection: Connection, lifeline: Connection) -> None:
    """Answer calls until the pipe ends; the whole life of a `Worker`'s process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_die_with, args=(lifeline,), daemon=True).start()
    while True:
        try:
            function, *arguments = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(function(*arguments))


class ProcessPool:
    """Worker processes on this machine, replaced when they die."""

    def __init__(self, workers: int, address: Address | None):
        self.workers: list[Worker] = []
        self.limit, self.address = workers, address
        self.deaths: Counter[int] = Counter()

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
            if worker.ready and not worker.send(fly_here, task, self.address):
                self._bury(worker)  # it died idle
                continue
            worker.task = task
            return
        self._hire([task.run.config]).task = task

    def wait(self, seconds: float) -> list[Outcome]:
        """Wait for missions to end or workers to die."""
        if not self.workers:
            return []
        outcomes = []
        speaking = wait([worker.connection for worker in self.workers], seconds)
        for worker in [worker for worker in self.workers if worker.connection in speaking]:
            try:
                answer = worker.connection.recv()
            except (EOFError, OSError):
                outcomes.extend(self._bury(worker))
                continue
            except Exception as error:  # an answer that cannot be read here
                answer = failed(worker.task, error) if worker.task else None
            if isinstance(answer, Outcome):
                worker.task = None
                outcomes.append(answer)
            else:
                worker.ready = True
                if worker.task:
                    worker.send(fly_here, worker.task, self.address)
        return outcomes

    def close(self) -> None:
        """Kill all workers."""
        for worker in self.workers:
            worker.kill()
        for worker in self.workers:
            worker.end()

    def _hire(self, configs: list[MissionConfig], compiling: bool = False) -> Worker:
        try:
            worker = Worker()
        except OSError as error:
            raise RunError(
                f"no worker process can be started ({error.strerror}): lower n_jobs, or free memory"
            ) from error
        self.workers.append(worker)
        worker.send(get_ready, configs, compiling, self.address)
        return worker

    def _bury(self, worker: Worker) -> list[Outcome]:
        self.workers.remove(worker)
        code = worker.end()
        if worker.task is None:
            return []
        self.deaths[worker.task.number] += 1
        return [died(worker.task, _cause(code), self.deaths[worker.task.number])]


class DaskPool:
    """A Dask cluster: the one whose scheduler is named, else one on this machine.

    Every mission is a future of its own, so that a lost one takes no other with it. If a worker
    dies, Dask starts its missions elsewhere, as often as the scheduler's option
    ``distributed.scheduler.allowed-failures`` says, then gives up all that were assigned to the
    worker; only those that had really been started have then used up a try.
    """

    def __init__(self, n_jobs: int, scheduler: str | None, address: Address | None, say: Say):
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            raise UsageError(
                "backend=dask needs Dask, which is not installed: pip install 'infoplan[dask]'"
            ) from error
        # A scheduler that vanishes is told in one sentence, not in Dask's log.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        self.n_jobs, self.say = n_jobs, say
        self.where, self.address = scheduler or "this machine", address
        self.topic = f"infoplan-{uuid.uuid4().hex}"
        self.starts: Counter[int] = Counter()
        self.losses: Counter[int] = Counter()
        self.reports: dict[int, Report] = {}
        self.flying: dict[str, tuple[Task, Any]] = {}
        self.ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.workers, self.asked, self.told = 0, -CLUSTER_SECONDS, False
        self.others = set(multiprocessing.active_children())
        self.cluster: Any = None
        self.client: Any = None
        try:
            self._open(scheduler)
        except BaseException:
            with ignored():
                self.close()
            raise

    def _open(self, scheduler: str | None) -> None:
        from distributed import Client

        target: dict[str, Any] = {"address": scheduler}
        if scheduler is None:
            with _deaf_children():
                self.cluster = target["address"] = _local_cluster(worker_count(self.n_jobs))
        elif scheduler.endswith(".json"):
            target = {"scheduler_file": str(Path(scheduler).expanduser())}
        try:
            self.client = Client(**target, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError) as error:
            raise RunError(
                f"no Dask scheduler answers at {self.where} ({error}): start one there with "
                "`dask scheduler`, or leave scheduler= out for a cluster on this machine"
            ) from error
        self.client.subscribe_topic(self.topic, self._hear)

    def size(self) -> int:
        """Return ``n_jobs``, or where that is -1 the workers that the cluster has now."""
        if time.monotonic() - self.asked > CLUSTER_SECONDS:
            self.asked = time.monotonic()
            self.workers = len(self._asked(self.client.nthreads))
            if not self.workers and not self.told:
                self.told = True
                self.say(f"waiting for workers to join the Dask scheduler at {self.where}")
        return self.n_jobs if self.n_jobs > 0 else max(self.workers, 1)

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Compile the kernels on one worker; see that the workers have infoplan at all."""
        from distributed import KilledWorker

        self._check_versions()
        future = self.client.submit(get_ready, configs, True, None, pure=False)
        while not future.done():
            self.size()
            with suppress(TimeoutError):
                future.exception(timeout=CLUSTER_SECONDS)
        error = future.exception()
        if error is not None and not isinstance(error, KilledWorker):
            reason = str(error).splitlines()[0]
            raise RunError(
                f"infoplan cannot be imported by the Dask cluster at {self.where} ({reason}): "
                "install the same version there, for the workers and the scheduler"
            ) from error

    def _check_versions(self) -> None:
        """See that the scheduler and all workers there are now have this very infoplan.

        One that has none would die of the first mission it is sent.
        """
        here = version("infoplan")
        remedy = f"install version {here} there, for the workers and the scheduler"
        found: dict[str, Any] = {}
        try:
            found["scheduler"] = self.client.run_on_scheduler(version, "infoplan")
        except PackageNotFoundError as error:
            found["scheduler"] = error
        # A worker that dies meanwhile gives another error, which says nothing of its packages.
        found |= self._asked(lambda: self.client.run(version, "infoplan", on_error="return"))
        for place, there in found.items():
            if isinstance(there, PackageNotFoundError):
                raise RunError(
                    f"the Dask cluster at {self.where} has no infoplan ({place}): {remedy}"
                )
            if isinstance(there, str) and there != here:
                raise RunError(
                    f"the Dask cluster at {self.where} has infoplan {there} ({place}), this is "
                    f"{here}: {remedy}"
                )

    def start(self, task: Task) -> None:
        """Hand a mission to the cluster."""
        key = f"infoplan-{task.run.name}-{task.seed}-{uuid.uuid4().hex}"
        future = self.client.submit(fly_on_dask, task, self.topic, key=key, pure=False)
        self.flying[key] = (task, future)
        future.add_done_callback(self.ended.put)

    def wait(self, seconds: float) -> list[Outcome]:
        """Wait for missions to end."""
        outcomes = []
        try:
            outcomes.append(self._settled(self.ended.get(timeout=seconds)))
            while True:
                outcomes.append(self._settled(self.ended.get_nowait()))
        except queue.Empty:
            return outcomes

    def close(self) -> None:
        """Cancel what waits; kill the workers if they are this machine's."""
        if self.cluster is not None:
            for nanny in self.cluster.workers.values():
                nanny.auto_restart = False
        self._kill_workers()
        with suppress(Exception):  # the cluster may be gone
            self.client.cancel([future for _, future in self.flying.values()], force=True)
        with suppress(Exception):
            self.client.close(timeout=KILL_SECONDS)
        if self.cluster is not None:
            with suppress(Exception):
                self.cluster.close(timeout=KILL_SECONDS)
            # What has not ended by now would delay the exit by ten seconds.
            self.cluster.shutdown_on_close = False
        # One that was just being started again would be waited for at the exit, for ever.
        self._kill_workers()

    def _kill_workers(self) -> None:
        for process in set(multiprocessing.active_children()) - self.others:
            process.kill()

    def _settled(self, future: Any) -> Outcome:
        from distributed import KilledWorker

        task, _ = self.flying.pop(future.key)
        if future.status == "lost":
            # Its worker died after the mission's end, before the tables were fetched.
            self.losses[task.number] += 1
            return died(task, "its worker died", self.losses[task.number])
        if future.cancelled():
            raise RunError(
                f"the Dask scheduler at {self.where} is gone: what is finished is kept, the same "
                "command goes on where it stopped"
            )
        error = future.exception()
        if isinstance(error, KilledWorker):
            self.losses[task.number] += 1
            # Lost without a start, it was only assigned to a worker that another one has killed;
            # but not again and again.
            guilty = self.losses[task.number] > INNOCENT_LOSSES
            return died(task, "its worker died", TRIES if guilty else self.starts[task.number])
        if error is not None:
            return failed(task, error)
        outcome: Outcome = future.result()
        return outcome

    def _hear(self, event: tuple[float, dict[str, Any]]) -> None:
        """Pass a worker's report on to the display, and count the starts."""
        _, message = event
        number = message["mission"]
        if not message["collected"]:
            self.starts[number] += 1
            self.reports[number] = reporter(self.address, number)
        self.reports[number](message["collected"], message["rmse"])

    def _asked(self, question: Callable[[], Any]) -> Any:
        try:
            return question()
        except Exception as error:  # of many kinds when a scheduler vanishes
            raise RunError(
                f"the Dask scheduler at {self.where} does not answer ({error}): what is finished "
                "is kept, the same command goes on where it stopped"
            ) from error


def died(task: Task, reason: str, times: int) -> Outcome:
    """Describe a mission whose worker has died, so many times now."""
    if times > 1:
        reason = f"{reason}, {times} times"
    return Outcome(task, reason=reason, failure=f"{reason}\n", again=times < TRIES)


def _local_cluster(workers: int) -> Any:
    """Start a cluster on this machine; a worker that dies meanwhile spoils an attempt."""
    import dask
    from distributed import LocalCluster

    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        for attempt in range(CLUSTER_TRIES):
            try:
                return LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    memory_limit=0,
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            except (RuntimeError, OSError) as error:
                if attempt == CLUSTER_TRIES - 1:
                    raise RunError(
                        f"no Dask cluster can be started on this machine ({error}): lower n_jobs, "
                        "or use backend=loky"
                    ) from error


def _cause(code: int | None) -> str:
    """Say what a process died of, from its exit code."""
    if code is None or code >= 0:
        return f"its worker died (exit status {code})"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ", perhaps out of memory" if name == "SIGKILL" else ""
    return f"its worker died ({name}{hint})"


def _die_with(lifeline: Connection) -> None:
    """End this process when the other end of the pipe does: the parent is dead, or has enough."""
    with suppress(EOFError, OSError):
        lifeline.recv()
    os._exit(1)


@contextmanager
def _deaf_children() -> Iterator[None]:
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
