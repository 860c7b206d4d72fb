"""Ctrl-C and a batch system's signals: finished missions are kept, no process is left."""

import os
import signal
import subprocess
from contextlib import suppress

import psutil
import pytest
from studies import alive, assert_same_numbers, curves, family, quick, started, study, until


@pytest.mark.parametrize(
    ("number", "group", "backend"),
    [
        # Ctrl-C reaches workers, too
        (signal.SIGINT, True, "loky"),
        pytest.param(signal.SIGTERM, False, "loky", marks=pytest.mark.long),
        pytest.param(signal.SIGHUP, True, "loky", marks=pytest.mark.long),
        (signal.SIGINT, True, "sequential"),
        pytest.param(signal.SIGINT, True, "dask", marks=pytest.mark.long),
    ],
)
def test_an_interrupted_study_goes_on_later(number, group, backend, tmp_path):
    folder, seeds = tmp_path / "results", 40
    # By itself it would take many times longer than the time-out below.
    with started(folder, f"seeds={seeds}", "n_jobs=2", f"backend={backend}", slow=0.5) as process:
        until(lambda: family(process.pid) or backend == "sequential", process)
        if backend == "loky":
            until(lambda: curves(folder), process)
        else:
            until(lambda: list(folder.glob(".locks/*")), process)
        children = family(process.pid)
        (os.killpg if group else os.kill)(process.pid, number)
        said, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.splitlines()[-1] == (
        "interrupted: finished missions are kept; the same command goes on where it stopped"
    )
    assert "Traceback" not in said
    assert "KeyboardInterrupt" not in said
    psutil.wait_procs(children, timeout=20)
    assert not [child for child in children if alive(child)]
    finished = len(curves(folder))
    assert finished < seeds
    done, _ = study(quick(), folder, seeds=finished + 2, backend="sequential")
    assert done.kept + done.computed == finished + 2
    study(quick(), tmp_path / "undisturbed", seeds=finished + 2, backend="sequential")
    assert_same_numbers(folder, tmp_path / "undisturbed")


def test_ctrl_c_while_workers_start_is_quiet(tmp_path):
    with started(tmp_path, "n_jobs=2") as process:
        until(lambda: len(family(process.pid)) >= 3, process)
        os.killpg(process.pid, signal.SIGINT)
        said, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.startswith("interrupted:")
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize(
    "pause", [0.02, *[pytest.param(long, marks=pytest.mark.long) for long in (0.0, 0.2)]]
)
def test_a_second_ctrl_c_changes_nothing(pause, tmp_path):
    with started(tmp_path, "seeds=40", "n_jobs=2", slow=0.5) as process:
        until(lambda: list(tmp_path.glob(".locks/*")), process)
        children = family(process.pid)
        for _ in range(4):
            # By its own handle: who else waits for a child takes its exit status away.
            with suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(process.pid, signal.SIGINT)
                process.wait(pause)
        said, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.splitlines()[-1].startswith("interrupted: finished missions are kept")
    assert "Traceback" not in said
    psutil.wait_procs(children, timeout=20)
    assert not [child for child in children if alive(child)]
