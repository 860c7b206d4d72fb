"""Methods of a user's that misbehave: each fails its own mission, and changes no other."""

import subprocess
import sys
from pathlib import Path

import pytest
from studies import OPTIONS, curves

METHODS = """
import os, sys, time
import numpy as np


class Odd(BaseException):
    pass


def _verdict(samples):
    return np.zeros(len(samples), dtype=bool), np.zeros(len(samples))


def leaves(samples, model, rng):
    raise GeneratorExit


def interrupts(samples, model, rng):
    raise KeyboardInterrupt


def odd(samples, model, rng):
    raise Odd("one of its own")


def ends(samples, model, rng):
    os._exit(3)


def talks(samples, model, rng):
    raise ValueError("\\x1b[2J" + "blah " * 100_000 + "the end")


def loops(samples, model, rng):
    while True:
        pass


def forks(samples, model, rng):
    os.fork()
    return _verdict(samples)


def patches(samples, model, rng):
    np.seterr(all="raise")
    np.random.seed(0)
    os.chdir("/")
    os.environ["LC_ALL"] = "C"
    np.exp = np.log = np.sqrt = np.abs
    import scipy.linalg
    scipy.linalg.cho_solve = None
    return _verdict(samples)


def whispers(samples, model, rng):
    print("what a method says", file=sys.stderr)
    return _verdict(samples)
"""


def run(tmp_path: Path, *options: str, method: str = "", **keywords: object):
    (tmp_path / "odd_methods.py").write_text(METHODS)
    own = [f"detector.function=odd_methods.{method}", "detector=own"] if method else []
    rest = [option for option in OPTIONS if not (own and option.startswith("detector"))]
    command = [sys.executable, "-m", "infoplan.cli", "run", *rest, *own, *options]
    return subprocess.run(
        [*command, f"results_dir={tmp_path / 'results'}"], cwd=tmp_path, capture_output=True,
        text=True, timeout=300, **keywords,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("method", "words", "backend"),
    [
        ("leaves", "GeneratorExit", "sequential"),
        ("interrupts", "KeyboardInterrupt", "sequential"),
        ("odd", "Odd: one of its", "sequential"),
        ("interrupts", "KeyboardInterrupt", "loky"),
        pytest.param("leaves", "GeneratorExit", "loky", marks=pytest.mark.long),
        pytest.param("odd", "Odd: one of its", "loky", marks=pytest.mark.long),
    ],
)
def test_whatever_is_raised_fails_the_mission_alone(method, words, backend, tmp_path):
    done = run(tmp_path, "seeds=1", "n_jobs=1", f"backend={backend}", method=method)
    assert done.returncode == 1
    assert f"FAILED: {words}" in done.stdout or f"FAILED: odd_methods.{words}" in done.stdout
    assert "1 failed" in done.stdout
    assert "interrupted" not in done.stderr


def test_a_worker_that_ends_is_replaced(tmp_path):
    done = run(tmp_path, "seeds=1", "n_jobs=1", method="ends")
    assert done.returncode == 1
    assert "FAILED: its worker died (exit status 3), 2 times" in done.stdout


def test_a_long_story_is_cut_in_the_middle(tmp_path):
    done = run(tmp_path, "seeds=1", "n_jobs=1", method="talks")
    assert done.returncode == 1
    assert "\x1b[2J" not in done.stdout
    assert len(done.stdout) < 10_000
    (file,) = (tmp_path / "results").glob("failures/*/*.txt")
    text = file.read_text()
    assert len(text) < 70_000
    assert "Traceback" in text
    assert "characters left out" in text
    assert "the end" in text[-200:]


def test_a_mission_that_never_ends_is_given_up(tmp_path):
    done = run(tmp_path, "seeds=1", "n_jobs=1", "mission_timeout=3", method="loops")
    assert done.returncode == 1
    assert "FAILED: it took longer than mission_timeout=3 seconds and was ended" in done.stdout
    fine = run(tmp_path, "seeds=1", "n_jobs=1", "mission_timeout=300")
    assert fine.returncode == 0


@pytest.mark.parametrize("backend", ["dask", "sequential"])
def test_where_no_mission_can_be_ended_a_timeout_is_refused(backend, tmp_path):
    done = run(tmp_path, "mission_timeout=3", f"backend={backend}")
    assert done.returncode == 2
    assert f"mission_timeout=3 has no use with backend={backend}" in done.stderr


@pytest.mark.parametrize("option", ["mission_timeout=0", "mission_timeout=-1"])
def test_a_timeout_is_above_zero(option, tmp_path):
    assert run(tmp_path, option).returncode == 2


@pytest.mark.parametrize("backend", [pytest.param("loky", marks=pytest.mark.long), "sequential"])
def test_a_child_that_comes_back_says_nothing(backend, tmp_path):
    done = run(tmp_path, "seeds=2", "n_jobs=1", f"backend={backend}", method="forks")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("  done in ") == 2
    assert done.stdout.count("missions computed") == 1
    assert len(curves(tmp_path / "results")) == 2


def test_a_method_that_patches_numpy_changes_no_other_mission(tmp_path):
    """Both kinds in one pool of one worker, the patching ones first."""
    import pandas as pd

    (tmp_path / "alone").mkdir()
    alone = run(tmp_path / "alone", "seeds=2", "n_jobs=1")
    assert alone.returncode == 0, alone.stderr
    (tmp_path / "odd_methods.py").write_text(METHODS)
    line = 'sweep=["detector=own detector.function=odd_methods.patches","detector=none"]'
    plain = [option for option in OPTIONS if not option.startswith("detector")]
    mixed = subprocess.run(
        [sys.executable, "-m", "infoplan.cli", "run", *plain, line, "seeds=2", "n_jobs=1",
         f"results_dir={tmp_path / 'results'}"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert "4 of 4" in mixed.stdout or "[4/4]" in mixed.stdout, mixed.stdout + mixed.stderr
    found = curves(tmp_path / "alone" / "results")
    assert len(found) == 2
    for path in found:
        other = tmp_path / "results" / path.relative_to(tmp_path / "alone" / "results")
        clocks = [f"{part}_seconds" for part in ("plan", "fit", "predict", "detect")]
        one, two = (pd.read_parquet(file).drop(columns=clocks) for file in (path, other))
        pd.testing.assert_frame_equal(one, two, check_exact=True)


def test_what_a_method_says_is_passed_on(tmp_path):
    done = run(tmp_path, "seeds=1", "n_jobs=1", method="whispers")
    assert done.returncode == 0
    assert "what a method says" in done.stderr
