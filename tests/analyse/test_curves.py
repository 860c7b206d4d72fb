"""Curves on a common axis, and the numbers that sum them up."""

import made_tables
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from infoplan.analyse import (
    area_under_curve,
    compare,
    load_curves,
    mean_between,
    on_common_axis,
    summarise,
    value_at,
)
from infoplan.errors import UsageError

LINE = pd.DataFrame({"collected": [100, 300, 1000, 2000], "rmse": [900.0, 500.0, 150.0, 50.0]})


def test_values_are_linear_between_epochs_and_nan_outside():
    values = value_at(LINE, [50, 100, 200, 1500, 2000, 2001])
    assert values[1:5] == pytest.approx([900.0, 700.0, 100.0, 50.0])
    assert np.isnan(values[[0, 5]]).all()


@given(
    st.lists(st.floats(0.0, 1000.0), min_size=4, max_size=4),
    st.floats(100.0, 1900.0),
    st.floats(1.0, 2000.0),
)
def test_mean_between_is_the_integral(rmse, low, length):
    curve = LINE.assign(rmse=rmse)
    high = min(low + length, 2000.0)
    fine = np.linspace(low, high, 20001)
    middles = (fine[1:] + fine[:-1]) / 2
    expected = np.interp(middles, curve["collected"], curve["rmse"]).mean()
    assert mean_between(curve, low, low + length) == pytest.approx(expected, abs=0.05)


def test_mean_between_wants_the_stretch_to_begin_inside():
    assert np.isnan(mean_between(LINE, 99, 500))
    assert np.isnan(mean_between(LINE, 2000, 3000))
    assert mean_between(LINE, 1000, np.inf) == pytest.approx(100.0)


def test_common_axis_ends_where_all_missions_are(tmp_path):
    made_tables.store(tmp_path, "uct-none", seed=0, collected=[100, 180, 400], rmse=[3, 2, 1])
    made_tables.store(tmp_path, "uct-none", seed=1, collected=[120, 400], rmse=[8, 1])
    together = on_common_axis(load_curves(tmp_path))
    assert together.index[0] == 120
    assert together.index[-1] == 400
    assert np.all(np.diff(together.index) > 0)
    assert together.notna().all().all()
    assert together.iloc[0].to_list() == pytest.approx([2.75, 8.0])
    given_axis = on_common_axis(load_curves(tmp_path), [110, 180])
    assert given_axis.xs(0, level="seed", axis=1).iloc[1, 0] == pytest.approx(2.0)
    assert np.isnan(given_axis.xs(1, level="seed", axis=1).iloc[0, 0])


def test_area_is_the_mean_over_samples(tmp_path):
    made_tables.store(tmp_path, "uct-none", collected=[100, 300], rmse=[10, 0])
    made_tables.store(tmp_path, "uct-best", collected=[200, 300], rmse=[4, 4])
    areas = area_under_curve(load_curves(tmp_path)).droplevel("seed")
    assert areas.filter(like="best").item() == pytest.approx(4.0)
    assert areas.filter(like="none").item() == pytest.approx(2.5)  # from the first common on


@pytest.mark.parametrize(("scope", "tp", "rate"), [("batch", 5, 4 / 14), ("historical", 3, 0.3)])
def test_counts_of_a_mission_follow_the_scope(tmp_path, scope, tp, rate):
    counts = [(0, 0, 0, 0), (2, 1, 1, 3), (3, 3, 0, 7)]
    made_tables.store(tmp_path, "uct-copod", scope=scope, counts=counts, rmse=[9, 4, 6])
    (summary,) = summarise(load_curves(tmp_path)).to_dict("records")
    assert (summary["tp"], summary["false_alarm_rate"]) == pytest.approx((tp, rate))
    assert (summary["final"], summary["minimum"], summary["late"]) == pytest.approx((6, 4, 5))
    assert summary["seconds"] == pytest.approx(3.0)


def test_early_is_cut_at_the_budget_and_late_needs_a_thousand(tmp_path):
    made_tables.store(tmp_path, "uct-none", collected=[100, 400], rmse=[400, 100])
    summary = summarise(load_curves(tmp_path)).iloc[0]
    assert summary["early"] == pytest.approx(225.0)
    assert np.isnan(summary["late"])
    assert np.isnan(summary["precision"])


def test_compare_pairs_seeds_as_scipy_would(tmp_path):
    rng = np.random.default_rng(2)
    ends = {"uct-best": rng.normal(200, 50, 8), "uct-none": rng.normal(900, 50, 8)}
    for method, finals in ends.items():
        for seed, final in enumerate(finals):
            made_tables.store(tmp_path, method, seed=seed, rmse=[700, 400, final])
    best, none = (load_curves(tmp_path, method=method) for method in ends)
    difference = compare(best, none)
    known = stats.ttest_rel(ends["uct-best"], ends["uct-none"])
    theirs = known.confidence_interval(0.95)
    assert difference.mean.n == 8
    assert difference.p == 2 / 2**8
    assert (difference.mean.low, difference.mean.high) == pytest.approx((theirs.low, theirs.high))
    by_area = compare(best, none, by="area")
    # The curves differ in the last stretch alone, on average by half of its end.
    assert by_area.mean.mean == pytest.approx(difference.mean.mean / 2 * 1000 / 1900)


def test_compare_wants_one_run_a_side_and_a_common_seed(tmp_path):
    made_tables.store(tmp_path, "uct-best", seed=0)
    made_tables.store(tmp_path, "uct-none", seed=1)
    both = load_curves(tmp_path)
    best, none = load_curves(tmp_path, method="UCT-BEST"), load_curves(tmp_path, method="uct-none")
    with pytest.raises(UsageError, match="one run on each side, not 2"):
        compare(both, none)
    with pytest.raises(UsageError, match="no seed in common"):
        compare(best, none)
