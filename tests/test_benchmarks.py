"""The benchmark runs and says what it should; how fast anything is, is not tested."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[1]
# The reference is an extra of its own.
SECTIONS = [
    "optimiser",
    "search",
    "memory",
    "start",
    "far",
    "blas",
    "floor",
    "rmse",
    "workers",
    "neighbours",
] + (["mission"] if find_spec("pypolo") else [])


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "figures.json"
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.run", "--quick", "--json", path, "--only", *SECTIONS],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(path.read_text())
    for figure in found["figures"]:
        assert figure["section"] in done.stdout
    return found


def test_every_section_has_figures(document):
    assert set(document["raw"]) == set(SECTIONS)
    assert {figure["section"][0] for figure in document["figures"]} >= set("2345679")
    assert all(figure["measured"] for figure in document["figures"])


def test_targets_that_no_clock_decides_are_met(document):
    decided = [f for f in document["figures"] if f["section"] in ("3 optimiser", "6 memory")]
    assert all(figure["met"] for figure in decided if figure["target"])


def test_the_floor_counts_the_arithmetic(document):
    (run,) = document["raw"]["floor"]
    # Two or three epochs of at most 250 samples: 16/3 N^3 and 2500 N^2 at most in each.
    most = 5 * (16 / 3 * 250**3 + 2500 * 250**2)
    assert 0 < run["floor"]["cpu"] * run["rate"]["cpu"] < most
    assert run["over_floor"]["cpu"] == pytest.approx(run["seconds"]["cpu"] / run["floor"]["cpu"])
