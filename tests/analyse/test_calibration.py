"""Calibration curves of stored maps."""

import made_tables
import numpy as np

from infoplan.analyse import calibration_curve, find_missions


def test_shares_are_those_of_the_normal(tmp_path):
    truth, rng = made_tables.truth(), np.random.default_rng(3)
    noise = 7.0 * rng.normal(size=truth.shape)
    good = made_tables.store(tmp_path, "uct-none", mean=truth + noise, std=7.0)
    bad = made_tables.store(tmp_path, "uct-best", mean=truth + 14.0, std=7.0)
    table = calibration_curve(find_missions(tmp_path)).set_index(["run", "level"])["covered"]
    np.testing.assert_allclose(table[good], table[good].index, atol=0.06)
    assert (table[bad][table[bad].index < 0.95] == 0.0).all()
    assert table[bad][0.99] == 1.0


def test_levels_are_chosen(tmp_path):
    made_tables.store(tmp_path, "uct-none")
    assert calibration_curve(find_missions(tmp_path), [0.5])["level"].to_list() == [0.5]
