"""SIGKILL at random moments, then one more call: the tables are those of an undisturbed run."""

import random
import signal
from pathlib import Path

import psutil
import pytest
from studies import (
    alive,
    assert_same_numbers,
    curves,
    family,
    quick,
    started,
    study,
    until,
    workers,
)

SEEDS_A_KILL = 4
SLOW = 0.2
"""Seconds added to every epoch; a mission has four or more of them."""

VICTIMS = ("parent", "worker", "dask worker")


@pytest.mark.parametrize("kills", [3, pytest.param(21, marks=pytest.mark.long)])
def test_nothing_is_lost(kills, tmp_path):
    dice = random.Random(kills)
    folder = tmp_path / "disturbed"
    for number in range(kills):
        victim = VICTIMS[number % len(VICTIMS)]
        seeds = f"seeds={SEEDS_A_KILL * (number + 1)}"
        backend = "backend=dask" if victim == "dask worker" else "backend=loky"
        with started(folder, seeds, backend, "n_jobs=2", slow=SLOW) as process:
            kill_one(process, folder, victim, dice)
            children = family(process.pid)
            output, _ = process.communicate(timeout=300)
        if victim == "parent":
            assert process.returncode == -signal.SIGKILL
            psutil.wait_procs(children, timeout=20)
            assert not [child for child in children if alive(child)]
        else:
            # The same command has finished everything, the killed worker's mission included.
            assert process.returncode == 0, output
            assert len(curves(folder)) == SEEDS_A_KILL * (number + 1)
    total = SEEDS_A_KILL * kills
    with started(folder, f"seeds={total}", "n_jobs=2") as process:
        output, _ = process.communicate(timeout=300)
        assert process.returncode == 0, output
    study(quick(), tmp_path / "undisturbed", seeds=total, backend="sequential")
    assert_same_numbers(folder, tmp_path / "undisturbed")


def kill_one(process, folder: Path, victim: str, dice: random.Random) -> None:
    """Kill the parent or a worker, at a random moment between the workers' birth and the end."""
    until(lambda: len(workers(process.pid)) == 2, process)
    before, finished = len(curves(folder)), dice.randrange(SEEDS_A_KILL - 2)
    until(lambda: len(curves(folder)) >= before + finished, process)
    with pytest.raises(psutil.TimeoutExpired):
        psutil.Process(process.pid).wait(dice.uniform(0, 2 * SLOW))
    if victim == "parent":
        process.kill()
    else:
        until(lambda: workers(process.pid), process)
        dice.choice(workers(process.pid)).kill()
