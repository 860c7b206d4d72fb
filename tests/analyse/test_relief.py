"""Local relief, and what is split by it."""

import made_tables
import numpy as np
import pandas as pd
import pytest

from infoplan.analyse import by_relief, load_maps, load_samples, local_relief
from infoplan.analyse.relief import grid_of, on_grid, relief_at


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0, 3.7])
def test_local_relief_is_that_of_the_disc(radius):
    elevation = np.random.default_rng(0).normal(size=(9, 13))
    extent = (0.0, 15.0, 2.0, 10.0)
    radius_used = max(radius, 1.25)  # the wider spacing of its nodes
    x, y = np.meshgrid(np.linspace(*extent[:2], 13), np.linspace(*extent[2:], 9))
    relief = local_relief(elevation, extent, radius)
    for i in range(9):
        for j in range(13):
            near = np.hypot(x - x[i, j], y - y[i, j]) <= radius_used + 1e-9
            assert relief[i, j] == pytest.approx(np.ptp(elevation[near]))


def test_grid_is_read_off_the_table():
    table = pd.DataFrame({"x1": [1.0, 3.0, 5.0] * 2, "x2": [0.0] * 3 + [4.0] * 3, "z": range(6)})
    assert grid_of(table) == ((2, 3), (1.0, 5.0, 0.0, 4.0))
    assert on_grid(table, "z").tolist() == [[0, 1, 2], [3, 4, 5]]


def test_false_alarms_and_errors_are_split_by_relief(tmp_path):
    east = np.arange(made_tables.SIDE) > 18
    mean = made_tables.truth() + np.where(east, 30.0, 0.0)
    samples = {
        "epoch": [0, 1, 1, 1, 1, 1],
        "x1": [50.0, 0.0, 5.0, 45.0, 50.0, 45.0],
        "x2": [20.0] * 6,
        "is_outlier": [False, False, False, False, False, True],
        "flagged": [True, False, False, True, False, True],
    }
    made_tables.store(tmp_path, "uct-copod", mean=mean, samples=samples)
    table = by_relief(load_samples(tmp_path), load_maps(tmp_path)).set_index("class")
    assert table.index.to_list() == ["flat", "middle", "rugged"]
    assert table["relief"].is_monotonic_increasing
    assert table.loc["flat", "rmse"] == 0.0
    assert table.loc["rugged", "rmse"] > 15.0
    # The pilot's sample and the true outlier are no false alarms.
    assert table["false_alarms"].sum() == 1
    assert table.loc["rugged", "false_alarm_rate"] == 0.5
    assert table["clean"].sum() == 4
    nodes = made_tables.SIDE**2
    squares = (table["rmse"] ** 2).to_numpy() * [226, 225, 225]  # thirds of 676 nodes
    assert squares.sum() / nodes == pytest.approx(np.mean((mean - made_tables.truth()) ** 2))


def test_relief_at_a_sample_is_its_nearest_nodes(tmp_path):
    made_tables.store(tmp_path, "uct-none", samples={"x1": [1.1, 48.9], "x2": [2.9, 0.0]})
    relief = local_relief(made_tables.truth(), (0.0, 50.0, 0.0, 50.0))
    at = relief_at(load_samples(tmp_path), load_maps(tmp_path))
    assert at.tolist() == [relief[1, 1], relief[0, 24]]
