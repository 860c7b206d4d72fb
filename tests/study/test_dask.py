"""A Dask cluster that is somewhere else: a scheduler and workers in processes of their own."""

import asyncio
import os
import shlex
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import pytest
from distributed import Security, rpc
from studies import assert_same_numbers, curves, environment, quick, started, study, until

from infoplan.cli import main
from infoplan.study import dask_pool
from infoplan.study.executor import Flight


@contextmanager
def process(module: str, *arguments: str, slow: float = 0.0):
    command = [sys.executable, "-m", f"distributed.cli.dask_{module}", *arguments]
    # Elsewhere: in another folder, and no file of the caller's is needed.
    running = subprocess.Popen(
        command, cwd="/", env=environment(slow), stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield running
    finally:
        running.kill()
        running.wait()


@contextmanager
def scheduler(tmp_path: Path):
    file = tmp_path / "scheduler.json"
    with process("scheduler", "--scheduler-file", str(file), "--host", "127.0.0.1", "--port", "0",
                 "--no-dashboard") as running:  # fmt: skip
        until(file.exists)
        yield file, running


def worker(file: Path, slow: float = 0.0, threads: int = 1):
    return process("worker", "--scheduler-file", str(file), "--nthreads", str(threads),
                   "--no-nanny", "--no-dashboard", slow=slow)  # fmt: skip


@pytest.mark.long
def test_a_cluster_elsewhere_survives_its_workers(tmp_path):
    folder = tmp_path / "results"
    with (
        scheduler(tmp_path) as (file, _),
        worker(file, slow=0.5) as first,
        started(folder, "seeds=4", "backend=dask", f"scheduler={file}") as run,
    ):
        until(lambda: curves(folder), run)
        first.kill()
        with worker(file):
            said, _ = run.communicate(timeout=300)
            assert run.returncode == 0, said
    assert "of 160 samples" in said or "4 missions computed" in said
    study(quick(), tmp_path / "undisturbed", seeds=4, backend="sequential")
    assert_same_numbers(folder, tmp_path / "undisturbed")


def test_a_worker_of_several_threads_gives_the_same_numbers(tmp_path):
    with scheduler(tmp_path) as (file, _), worker(file, threads=3):
        done, _ = study(quick(), tmp_path / "results", seeds=4, n_jobs=3, backend="dask",
                        scheduler=str(file))  # fmt: skip
    assert done.computed == 4
    study(quick(), tmp_path / "undisturbed", seeds=4, backend="sequential")
    assert_same_numbers(tmp_path / "results", tmp_path / "undisturbed")


def test_a_scheduler_that_vanishes_ends_the_study_in_one_sentence(tmp_path):
    folder = tmp_path / "results"
    with (
        scheduler(tmp_path) as (file, running),
        worker(file, slow=0.5),
        started(folder, "seeds=9", "backend=dask", f"scheduler={file}") as run,
    ):
        until(lambda: curves(folder), run)
        running.kill()
        said, _ = run.communicate(timeout=300)
        assert run.returncode == 1
    assert said.splitlines()[-1].startswith(f"infoplan: the Dask scheduler at {file}")
    assert "what is finished is kept" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("raise importlib.metadata.PackageNotFoundError(name)", "has no infoplan"),
        ("return '0.0.1'", "has infoplan 0.0.1"),
    ],
)
def test_a_cluster_with_another_infoplan_is_refused(line, words, tmp_path, capfd, monkeypatch):
    other = tmp_path / "other"
    other.mkdir()
    (other / "sitecustomize.py").write_text(f"""
import importlib.metadata
real = importlib.metadata.version
def version(name):
    if name != "infoplan":
        return real(name)
    {line}
version.__module__ = "importlib.metadata"
importlib.metadata.version = version
""")
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("studies.SABOTEUR", str(other))
        with scheduler(tmp_path) as (file, _), worker(file):
            options = ["terrain=volcano", "backend=dask", f"scheduler={file}"]
            assert main(["run", *options, f"results_dir={tmp_path / 'results'}"]) == 1
    said = capfd.readouterr().err
    assert words in said
    assert "Traceback" not in said


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "foo://127.0.0.1:9", "127.0.0.1:9"])
def test_no_scheduler_is_one_sentence(address, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(dask_pool, "CONNECT_SECONDS", 1.0)
    line = ["terrain=volcano", "backend=dask", f"scheduler={address}", f"results_dir={tmp_path}"]
    assert main(["run", *line]) == 1
    said = capfd.readouterr().err
    assert f"infoplan: no Dask scheduler answers at {address}" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("", "names no address"),
        ("[[[[", "names no address"),
        ('{"address": 5}', "names no address"),
        ('{"workers": {}}', "names no address"),
    ],
)
def test_a_bad_scheduler_file_is_one_sentence(text, words, tmp_path, capfd):
    file = tmp_path / "it's = the, scheduler.json"
    if text is not None:
        file.write_text(text)
    line = ["terrain=volcano", "backend=dask", f"scheduler={file}", f"results_dir={tmp_path}"]
    assert main(["run", *line]) == 1
    said = capfd.readouterr().err
    assert said.startswith(f"infoplan: the scheduler file {file} {words}")
    assert len(said.splitlines()) == 1
    remedy = said.partition("`")[2].rpartition("`")[0]
    assert shlex.split(remedy) == ["dask", "scheduler", "--scheduler-file", str(file)]


def test_a_port_that_never_answers_is_one_sentence(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(dask_pool, "CONNECT_SECONDS", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        where = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        line = ["terrain=volcano", "backend=dask", f"scheduler={where}", f"results_dir={tmp_path}"]
        assert main(["run", *line]) == 1
    said = capfd.readouterr().err
    assert said.startswith(f"infoplan: no Dask scheduler answers at {where} (no answer within 1 s)")
    assert len(said.splitlines()) == 1


def test_ctrl_c_while_connecting_is_quiet(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as mute:
        where = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        with started(tmp_path, "backend=dask", f"scheduler={where}") as process:
            mute.accept()
            os.killpg(process.pid, signal.SIGINT)
            said, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.startswith("interrupted:")
    assert len(said.splitlines()) == 1


def test_the_cluster_on_this_machine_talks_to_nobody_else():
    """Neither without encryption nor with a certificate of another's making."""
    cluster = dask_pool._local_cluster(1)
    try:
        address = cluster.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        strangers = [
            (address.replace("tls", "tcp"), Security()),
            (address, Security.temporary()),
        ]
        for where, security in strangers:
            with pytest.raises((OSError, TimeoutError)):
                asyncio.run(ask(where, security))
        assert asyncio.run(ask(address, cluster.security))["type"] == "Scheduler"
        page = f"http://127.0.0.1:{cluster.scheduler.http_server.port}/info/main/workers.html"
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(page, timeout=20)
        assert cluster.scheduler.http_server.port != 8787
    finally:
        cluster.close()


async def ask(address: str, security: Security):
    async with asyncio.timeout(10):
        scheduler = rpc(address, connection_args=security.get_connection_args("client"))
        try:
            return await scheduler.identity()
        finally:
            await scheduler.close_rpc()


@pytest.mark.parametrize("backend", ["dask", "loky"])
def test_missions_leave_no_descriptor_open(backend, tmp_path, monkeypatch):
    if not Path("/proc/self/fd").exists():
        pytest.skip("this system does not list open files")
    counts = []
    real = Flight.store

    def store(self, outcome):
        real(self, outcome)
        counts.append(len(os.listdir("/proc/self/fd")))

    monkeypatch.setattr(Flight, "store", store)
    study(quick(), tmp_path, seeds=30, n_jobs=1, backend=backend)
    assert len(counts) == 30
    assert counts[-1] <= counts[4] + 2


def test_dask_without_cryptography_is_a_usage_error(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(dask_pool.importlib.util, "find_spec", lambda name: None)
    assert main(["run", "terrain=volcano", "backend=dask", f"results_dir={tmp_path}"]) == 2
    assert "needs the package cryptography" in capfd.readouterr().err


def test_dask_that_is_not_installed_is_a_usage_error(tmp_path, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["run", "terrain=volcano", "backend=dask", f"results_dir={tmp_path}"]) == 2
    assert "pip install 'infoplan[dask]'" in capfd.readouterr().err
