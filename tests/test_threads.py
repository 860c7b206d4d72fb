"""Missions in threads of one process: the bits of missions in sequence, and nothing left behind."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
import scipy.linalg  # noqa: F401 - its BLAS counts, too
import threadpoolctl
from survey_logs import QUICK, write_log

import infoplan
from infoplan.analyse.audit import neighbours
from infoplan.cli import main
from infoplan.model import VecchiaProcess
from infoplan.terrain import load_terrain
from infoplan.threads import look_again, one_thread


@pytest.fixture(autouse=True)
def two_threads():
    """A machine whose BLAS uses two threads; as found afterwards."""
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        yield


def blas_threads() -> list[int]:
    return [
        library["num_threads"]
        for library in threadpoolctl.threadpool_info()
        if library["user_api"] == "blas"
    ]


def test_the_last_to_leave_restores():
    before = blas_threads()
    assert set(before) == {2}
    entered, leave = threading.Event(), threading.Event()

    def hold() -> None:
        with one_thread():
            entered.set()
            leave.wait(20)

    other = threading.Thread(target=hold)
    with one_thread():
        other.start()
        entered.wait(20)
    assert set(blas_threads()) == {1}  # the other is still inside
    leave.set()
    other.join()
    assert blas_threads() == before


def test_nested_and_after_an_error():
    before = blas_threads()

    def fail() -> None:
        with one_thread():
            with one_thread():
                look_again()
            assert set(blas_threads()) == {1}
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert blas_threads() == before


@pytest.mark.parametrize("detector", ["detector=copod", "detector=pyod"])
def test_threads_give_the_bits_of_one_after_the_other(detector):
    options = ["terrain=volcano", "planner=random", "model.pilot_iterations=30", detector]
    config = infoplan.configure(*options, budget=250, grid=[20, 20])
    before = blas_threads()

    def fly(seed: int) -> pd.DataFrame:
        frames = infoplan.fly(config, seed)
        numbers = [frames.curves.filter(regex="^(?!.*_seconds)").select_dtypes("number"),
                   frames.samples.select_dtypes("number"), frames.maps]  # fmt: skip
        return [frame.to_numpy(dtype=float) for frame in numbers]

    expected = [fly(seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(fly, range(4)))
    for wanted, got in zip(expected, found, strict=True):
        for one, other in zip(wanted, got, strict=True):
            np.testing.assert_array_equal(one, other)
    assert blas_threads() == before


def test_models_solve_on_one_thread_whoever_asks_them(tmp_path, monkeypatch):
    """Solves with a few dozen samples take twenty times as long on two threads as on one."""
    seen: set[int] = set()
    libraries = threadpoolctl.ThreadpoolController().select(user_api="blas")

    def watched(function):
        def call(*arguments, **options):
            seen.update(library["num_threads"] for library in libraries.info())
            return function(*arguments, **options)

        return call

    for owner, names in (
        (VecchiaProcess, ("predict", "optimize", "replace", "append",
                          "weights_and_sparse_inverse")),
        (neighbours, ("predict", "log_likelihood", "information")),
    ):  # fmt: skip
        for name in names:
            monkeypatch.setattr(owner, name, watched(getattr(owner, name)))
    log, results = write_log(tmp_path / "bay.csv"), tmp_path / "results"
    there = [f"results_dir={results}"]
    options = [*QUICK[1:], "model=vecchia"]

    def limited(act) -> bool:
        seen.clear()
        act()
        return seen == {1}

    def command(*words: str) -> None:
        assert main([*words, *there]) == 0

    assert limited(lambda: command("survey", str(log), *options, "check=0.05"))
    run = next((results / "runs").glob("survey-*.yaml")).stem
    assert limited(lambda: command("next", run, "budget=60", "planner.iterations=20"))
    assert limited(lambda: command("replay", run, "detector=hampel", "backend=sequential"))
    assert limited(lambda: command("audit", run))
    options = ["terrain=volcano", "model=vecchia", "planner=random", "model.pilot_iterations=3"]
    config = infoplan.configure(*options, budget=150, grid=[9, 9], detector="gp_residual")
    assert limited(lambda: infoplan.fly(config))
    mission = infoplan.Mission(config, load_terrain("volcano"), seed=1)
    assert limited(lambda: mission.start(mission.sample(mission.pilot_path())))
    assert limited(lambda: mission.observe(mission.sample(mission.plan())))
    assert set(blas_threads()) == {2}, "as before"
