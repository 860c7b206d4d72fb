"""Several infoplan processes on one results folder share the work."""

import re

import pytest
from studies import assert_same_numbers, curves, quick, started, study, until

from infoplan.study import locks
from infoplan.study.identity import identify
from infoplan.study.store import table_path

WAITING = "another infoplan flies the rest"


def computed(said: str) -> int:
    return int(re.search(r"(\d+) missions? computed", said)[1])


def test_two_processes_fly_each_mission_once(tmp_path):
    folder = tmp_path / "results"
    options = ("seeds=8", "n_jobs=1")
    with started(folder, *options, slow=0.2) as one, started(folder, *options, slow=0.2) as two:
        said = [process.communicate(timeout=300)[0] for process in (one, two)]
        assert (one.returncode, two.returncode) == (0, 0), said
    counts = [computed(text) for text in said]
    assert sum(counts) == 8
    assert min(counts) > 0
    assert list((folder / locks.FOLDER).iterdir()) == []
    study(quick(), tmp_path / "undisturbed", seeds=8, backend="sequential")
    assert_same_numbers(folder, tmp_path / "undisturbed")


def test_what_a_dead_process_held_is_taken_over(tmp_path):
    folder = tmp_path / "results"
    with started(folder, "seeds=3", "n_jobs=1", slow=100) as stuck:
        until(lambda: list(folder.glob(".locks/*.seed=0")), stuck)
        with started(folder, "seeds=3", "n_jobs=1") as other:
            until(lambda: len(curves(folder)) == 2, other)
            stuck.kill()
            said, _ = other.communicate(timeout=300)
            assert other.returncode == 0, said
    assert computed(said) == 3
    assert len(curves(folder)) == 3


@pytest.mark.parametrize("outcome", ["finished", pytest.param("given up", marks=pytest.mark.long)])
def test_what_another_holds_is_left_for_last(outcome, tmp_path, volcano):
    folder, elsewhere = tmp_path / "results", tmp_path / "elsewhere"
    run = identify(quick(), volcano).name
    study(quick(), elsewhere, seeds=3, backend="sequential")
    held = locks.acquire(folder, run, 0)
    assert held
    with started(folder, "seeds=3", "n_jobs=1") as process:
        until(lambda: len(curves(folder)) == 2, process)
        assert not table_path(folder, "curves", run, 0).exists()
        if outcome == "finished":
            for table in ("samples", "maps", "curves"):
                table_path(elsewhere, table, run, 0).rename(table_path(folder, table, run, 0))
        held.release()
        said, _ = process.communicate(timeout=300)
        assert process.returncode == 0, said
    assert computed(said) == (2 if outcome == "finished" else 3)
    assert ("seed 0  done by another infoplan" in said) == (outcome == "finished")
    assert len(curves(folder)) == 3


def test_a_lock_is_held_once_and_freed(tmp_path):
    lock = locks.acquire(tmp_path, "run", 1)
    assert lock
    assert locks.acquire(tmp_path, "run", 1) is None
    assert locks.list_held(tmp_path) == {("run", 1)}
    other = locks.acquire(tmp_path, "run", 11)
    assert other
    lock.release()
    assert locks.list_held(tmp_path) == {("run", 11)}
    again = locks.acquire(tmp_path, "run", 1)
    assert again
    for held in (again, other):
        held.release()
    assert list((tmp_path / locks.FOLDER).iterdir()) == []


def test_the_file_of_a_dead_holder_is_no_lock(tmp_path):
    path = locks.lock_path(tmp_path, "run", 1)
    path.parent.mkdir()
    path.touch()
    assert locks.list_held(tmp_path) == set()
    lock = locks.acquire(tmp_path, "run", 1)
    assert lock
    lock.release()


def test_a_file_system_without_locks_is_told_once(tmp_path, monkeypatch):
    def refuse(descriptor, how):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(locks.fcntl, "flock", refuse)
    with pytest.raises(locks.NoLocksError):
        locks.acquire(tmp_path, "run", 1)
    done, said = study(quick(), tmp_path, seeds=3, backend="sequential")
    assert done.computed == 3
    assert said.count("no locks can be had") == 1
