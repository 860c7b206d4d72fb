"""Missions in threads of one process: the bits of missions in sequence, and nothing left behind."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
import scipy.linalg  # noqa: F401 - its BLAS counts, too
import threadpoolctl

import infoplan
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
