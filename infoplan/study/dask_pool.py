"""A Dask cluster as a pool: somebody's, or one on this machine that nobody else can reach."""

import asyncio
import importlib.util
import json
import logging
import multiprocessing
import queue
import shlex
import time
import uuid
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from infoplan.config import MissionConfig
from infoplan.errors import RunError, UsageError
from infoplan.files import read_regular, user_path
from infoplan.study.flight import Outcome, Task, compile_on_dask, failed, fly_on_dask
from infoplan.study.listening import Progress
from infoplan.study.processes import KILL_SECONDS, TRIES, deaf_children, died
from infoplan.study.signals import ignored

INNOCENT_LOSSES = 5
"""How often Dask may lose a mission that it has not started, before it counts as failed."""

CLUSTER_TRIES = 3
CONNECT_SECONDS = 20.0
CLUSTER_SECONDS = 2.0
"""How often a Dask cluster is asked how many workers it has."""

LARGEST_SCHEDULER_FILE = 1_000_000
"""Bytes."""

LOCAL = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.http.routes": [],  # pages that whoever is on this machine could read
    "distributed.worker.http.routes": [],
}
"""Dask's configuration of a cluster on this machine."""


class DaskPool:
    """A Dask cluster: the one whose scheduler is named, else one on this machine.

    Every mission is a future of its own, so that a lost one takes no other with it. If a worker
    dies, Dask starts its missions elsewhere, as often as the scheduler's option
    ``distributed.scheduler.allowed-failures`` says, then gives up all that were assigned to the
    worker; only those that had really been started have then used up a try.
    """

    def __init__(self, n_jobs: int, scheduler: str | None, progress: Progress):
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            raise UsageError(
                "backend=dask needs Dask, which is not installed: pip install 'infoplan[dask]'"
            ) from error
        # What goes wrong is told in one sentence, not in Dask's log.
        for name in ("distributed", "distributed.client", "tornado.application"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self.n_jobs, self.progress = n_jobs, progress
        self.where = scheduler or "this machine"
        self.topic = f"infoplan-{uuid.uuid4().hex}"
        self.starts: Counter[int] = Counter()
        self.losses: Counter[int] = Counter()
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

        if scheduler is None:
            with deaf_children():
                target = self.cluster = _local_cluster(self.n_jobs)
        else:
            target = _address(scheduler)
        try:
            if scheduler is not None:
                asyncio.run(_greet(target))
            self.client = Client(target, timeout=CONNECT_SECONDS, set_as_default=False)
        except Exception as error:  # of many kinds, one a transport
            reason = " ".join(str(error).split()) or type(error).__name__
            if isinstance(error, TimeoutError):
                reason = f"no answer within {CONNECT_SECONDS:g} s"
            raise RunError(
                f"no Dask scheduler answers at {self.where} ({reason}): start one there with "
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
                self.progress.say(f"waiting for workers to join the Dask scheduler at {self.where}")
        return self.n_jobs if self.n_jobs > 0 else max(self.workers, 1)

    def get_ready(self, configs: list[MissionConfig], missions: int) -> None:
        """Compile the kernels on one worker; see that the workers have infoplan at all."""
        from distributed import KilledWorker

        self._check_versions()
        future = self.client.submit(compile_on_dask, configs, pure=False)
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
        """Pass a worker's report on, and count the starts."""
        _, message = event
        number = message["mission"]
        if not message["collected"]:
            self.starts[number] += 1
        self.progress.report(number, message["collected"], message["rmse"])

    def _asked(self, question: Callable[[], Any]) -> Any:
        try:
            return question()
        except Exception as error:  # of many kinds when a scheduler vanishes
            raise RunError(
                f"the Dask scheduler at {self.where} does not answer ({error}): what is finished "
                "is kept, the same command goes on where it stopped"
            ) from error


async def _greet(address: str) -> None:
    """See that a scheduler answers at an address; Dask's client by itself would try for minutes."""
    from distributed import Security, rpc

    async with asyncio.timeout(CONNECT_SECONDS):
        scheduler = rpc(address, connection_args=Security().get_connection_args("client"))
        try:
            await scheduler.identity()
        finally:
            scheduler.close_comms()
            await scheduler.close_rpc()


def _address(scheduler: str) -> str:
    """Address of a scheduler, which may be named by the file that it has written."""
    if not scheduler.endswith(".json"):
        return scheduler
    path = user_path(scheduler)
    start = f"`dask scheduler --scheduler-file {shlex.quote(str(path))}`"
    try:
        address = json.loads(read_regular(path, LARGEST_SCHEDULER_FILE))["address"]
    except OSError as error:
        raise RunError(
            f"the scheduler file {path} cannot be read ({error.strerror}): start a scheduler with "
            f"{start}, on a file system that both see"
        ) from error
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise RunError(
            f"the scheduler file {path} names no address: let {start} write it anew"
        ) from error
    if not isinstance(address, str):
        raise RunError(
            f"the scheduler file {path} names no address: {address!r} is none; let {start} write "
            "it anew"
        )
    return address


def _local_cluster(workers: int) -> Any:
    """Start a cluster on this machine; a worker that dies meanwhile spoils an attempt.

    Whoever reaches a scheduler can run code in its workers: this one talks to those alone that hold
    a certificate made for it, and kept in memory.
    """
    import dask
    from distributed import LocalCluster, Security

    if importlib.util.find_spec("cryptography") is None:
        raise UsageError(
            "backend=dask on this machine needs the package cryptography, which keeps other users "
            "of the machine out of its workers: pip install 'infoplan[dask]', or use backend=loky"
        )
    with dask.config.set(LOCAL):
        for attempt in range(CLUSTER_TRIES):
            try:
                return LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    memory_limit=0,
                    dashboard_address="127.0.0.1:0",
                    security=Security.temporary(),
                    protocol="tls://",
                    host="127.0.0.1",
                    silence_logs=logging.CRITICAL,
                )
            except (RuntimeError, OSError) as error:
                if attempt == CLUSTER_TRIES - 1:
                    raise RunError(
                        f"no Dask cluster can be started on this machine ({error}): lower n_jobs, "
                        "or use backend=loky"
                    ) from error
