"""A mission that raises, or whose worker is killed, costs no other mission."""

import json

import pytest
from studies import OPTIONS, SABOTEUR, assert_same_numbers, curves, quick, study

from infoplan.cli import main
from infoplan.study.store import list_failures, list_missions


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Tables of seven missions, flown in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    study(quick(), folder, seeds=7, backend="sequential")
    return folder


@pytest.fixture
def sabotage(monkeypatch, tmp_path):
    """Make the missions of some seeds misbehave in all workers started from here on."""
    monkeypatch.setenv("PYTHONPATH", SABOTEUR)
    monkeypatch.setenv("SABOTAGE_NOTES", str(tmp_path))
    return lambda plan: monkeypatch.setenv("SABOTAGE", plan)


def seeds_done(folder):
    return sorted(int(path.stem.removeprefix("seed=")) for path in curves(folder))


@pytest.mark.parametrize(
    ("backend", "jobs"),
    [
        ("loky", 2),
        *[pytest.param(*one, marks=pytest.mark.long) for one in (("loky", 1), ("dask", 2))],
    ],
    ids=["two", "one", "dask"],
)
def test_others_finish_and_the_next_call_heals(backend, jobs, tmp_path, sabotage, undisturbed):
    folder = tmp_path / "results"
    sabotage("raise:1,kill:2,kill-once:4")
    done, said = study(quick(), folder, seeds=7, n_jobs=jobs, backend=backend)
    assert seeds_done(folder) == [0, 3, 4, 5, 6]
    assert (done.computed, len(done.failed)) == (5, 2)
    run = next(iter(list_missions(folder)))
    assert list_failures(folder) == {run: [1, 2]}
    assert f"{run} seed 1  FAILED: ArithmeticError: seed 1 is sabotaged" in said
    assert f"{run} seed 2  FAILED: its worker died" in said
    raised = (folder / "failures" / run / "seed=1.txt").read_text()
    assert "Traceback" in raised
    assert "misbehave(what, seed)" in raised
    assert "worker died" in (folder / "failures" / run / "seed=2.txt").read_text()
    # What raised is not tried again, what was killed is: once.
    assert "seed 1  ArithmeticError" not in said
    # Dask may have given one of them to a worker that the other has killed: lost without a try.
    most = 2 if backend == "dask" else 1
    assert 1 <= said.count("seed 2  its worker died") <= most
    assert 1 <= said.count("seed 4  its worker died") <= most
    assert "2 times" in said

    sabotage("")
    healed, _ = study(quick(), folder, seeds=7, backend="sequential")
    assert (healed.computed, healed.kept, healed.failed) == (2, 5, [])
    assert list_failures(folder) == {}
    assert_same_numbers(folder, undisturbed)


def test_a_failure_shows_in_the_closing_table_and_in_the_exit_status(
    tmp_path, sabotage, capfd, monkeypatch
):
    sabotage("raise:1")
    options = [*OPTIONS, "seeds=2", "n_jobs=1", f"results_dir={tmp_path}"]
    assert main(["run", *options]) == 1
    said = capfd.readouterr().out
    shown, closing = said.split("RMSE in ft", 1)
    assert "FAILED: ArithmeticError: seed 1 is sabotaged" in shown
    assert "1 of 2" in closing
    path = next(tmp_path.glob("failures/*/seed=1.txt"))
    assert f"seed 1: ArithmeticError: seed 1 is sabotaged ({path})" in closing
    assert "1 failed (the same command tries them again)" in closing
    assert main(["status", "--json", f"results_dir={tmp_path}"]) == 0
    (run,) = json.loads(capfd.readouterr().out)["runs"]
    assert (run["done"], run["failed"], run["missing"]) == ([0], [1], [])
    sabotage("")
    assert main(["run", *options]) == 0
    assert not path.exists()


def test_on_error_stop_starts_no_more(tmp_path, sabotage):
    sabotage("raise:0,kill:1")
    done, said = study(quick(), tmp_path, seeds=7, n_jobs=1, on_error="stop")
    assert (done.computed, len(done.failed), done.unstarted) == (0, 1, 6)
    assert "seed 0  FAILED" in said
    sabotage("")
    again, _ = study(quick(), tmp_path, seeds=3, backend="sequential", on_error="stop")
    assert (again.computed, again.failed) == (3, [])


def test_numbers_do_not_depend_on_workers(small, tmp_path):
    ways = [("sequential", 1), ("loky", 1), ("loky", 2), ("dask", 2)]
    folders = [tmp_path / f"{backend}-{jobs}" for backend, jobs in ways]
    for (backend, jobs), folder in zip(ways, folders, strict=True):
        done, _ = study(small, folder, seeds=4, n_jobs=jobs, backend=backend)
        assert done.computed == 4
        assert_same_numbers(folder, folders[0])


def test_numbers_of_before_do_not_stand_for_a_mission_that_failed_now(tmp_path, sabotage, capfd):
    options = [*OPTIONS, "seeds=2", "n_jobs=1", f"results_dir={tmp_path}"]
    assert main(["run", *options]) == 0
    capfd.readouterr()
    sabotage("raise:1")
    assert main(["run", *options, "resume=false"]) == 1
    said = capfd.readouterr().out
    assert " 1 of 2 " in said
    assert "1 mission computed" in said


def test_a_method_that_exits_is_a_failure(tmp_path, monkeypatch, capfd):
    (tmp_path / "leaving.py").write_text(
        "import sys\n\n\ndef leave(samples, model, rng):\n    sys.exit()\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [str(tmp_path), *__import__("sys").path])
    own = ["detector=own", "detector.function=leaving.leave"]
    options = [option for option in OPTIONS if not option.startswith("detector")]
    assert main(["run", *options, *own, "seeds=1", "backend=sequential"]) == 1
    said = capfd.readouterr()
    assert "FAILED: SystemExit" in said.out + said.err
