"""No number of a mission changes unless somebody says so, by raising ``numerics_version``."""

import json

import pytest
from golden.missions import FILE, MISSIONS, SEEDS, difference, fly

from infoplan.study.identity import NUMERICS_VERSION

GOLDEN = json.loads(FILE.read_text(encoding="utf-8"))

FLOAT32_RTOL = 1e-3
"""Other machines round differently; a float has 24 bits, and the epochs add up."""


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", MISSIONS)
def test_a_mission_gives_its_numbers(name, seed):
    rtol = FLOAT32_RTOL if "float32" in name else 1e-6
    assert not difference(GOLDEN["missions"][name][str(seed)], fly(name, seed), rtol)


def test_the_numbers_are_of_this_version():
    assert GOLDEN["numerics_version"] == NUMERICS_VERSION


def test_a_difference_is_seen():
    expected = {"curves": {"rmse": [1.0, None, 3.0]}}
    assert not difference(expected, {"curves": {"rmse": [1.0 + 1e-8, None, 3.0]}})
    assert "row 2" in difference(expected, {"curves": {"rmse": [1.0, None, 3.001]}})
    assert "row 1" in difference(expected, {"curves": {"rmse": [1.0, 2.0, 3.0]}})
    assert "2 rows" in difference(expected, {"curves": {"rmse": [1.0, None]}})
