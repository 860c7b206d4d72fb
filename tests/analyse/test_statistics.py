"""The bootstrap and the means against SciPy's."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from infoplan.analyse import (
    bootstrap,
    bootstrap_band,
    bootstrap_mean,
    interquartile_mean,
    paired_difference,
)

VALUES = np.random.default_rng(5).gamma(2.0, 100.0, size=11)


def scipys(values, statistic):
    result = stats.bootstrap(
        (values,),
        statistic,
        n_resamples=10_000,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    return result.confidence_interval


@pytest.mark.parametrize("n", [2, 3, 10, 11])
def test_interval_of_the_mean_is_scipys(n):
    ours, theirs = bootstrap_mean(VALUES[:n]), scipys(VALUES[:n], np.mean)
    assert ours.mean == pytest.approx(VALUES[:n].mean())
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)
    assert ours.n == n


def test_interval_of_the_interquartile_mean_is_scipys():
    ours = bootstrap(VALUES, interquartile_mean)
    theirs = scipys(VALUES, lambda sample, axis: stats.trim_mean(sample, 0.25, axis=axis))
    assert ours.mean == pytest.approx(stats.trim_mean(VALUES, 0.25))
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=25))
def test_interquartile_mean_is_scipys_trimmed_mean(values):
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25), abs=1e-6)


def test_another_seed_of_the_bootstrap_agrees_within_its_noise():
    first, second = bootstrap(VALUES, np_mean), bootstrap(VALUES, np_mean, seed=1)
    width = first.high - first.low
    assert first.low != second.low
    assert abs(first.low - second.low) < 0.05 * width
    assert abs(first.high - second.high) < 0.05 * width


def np_mean(values):
    return values.mean(axis=-1)


def test_nans_are_left_out_and_little_data_has_no_interval():
    assert bootstrap_mean([1.0, np.nan, 3.0]) == bootstrap_mean([1.0, 3.0])
    single = bootstrap_mean([7.0, np.nan])
    assert (single.mean, single.n) == (7.0, 1)
    assert np.isnan([single.low, single.high]).all()
    nothing = bootstrap_mean([np.nan])
    assert np.isnan(nothing.mean)
    assert nothing.n == 0


def test_band_is_the_interval_of_every_point():
    curves = VALUES[:6, None] + np.random.default_rng(1).normal(0, 20, (6, 4))
    mean, low, high = bootstrap_band(curves)
    for point in range(4):
        interval = bootstrap_mean(curves[:, point])
        assert (mean[point], low[point], high[point]) == pytest.approx(
            (interval.mean, interval.low, interval.high)
        )


def test_a_single_curve_has_no_band():
    mean, low, high = bootstrap_band([[1.0, 2.0]])
    assert mean.tolist() == [1.0, 2.0]
    assert np.isnan([low, high]).all()


def test_differences_are_paired_by_seed():
    a = pd.Series({0: 10.0, 1: 20.0, 2: 30.0, 3: 50.0, 7: 1.0})
    b = pd.Series({3: 20.0, 2: 10.0, 1: 15.0, 0: 9.0, 8: 1.0})
    difference = paired_difference(a, b)
    assert difference.differences.to_dict() == {0: 1.0, 1: 5.0, 2: 20.0, 3: 30.0}
    assert difference.mean.mean == pytest.approx(14.0)
    assert difference.interquartile_mean.mean == pytest.approx(12.5)
    theirs = scipys(np.array([1.0, 5.0, 20.0, 30.0]), np.mean)
    assert (difference.mean.low, difference.mean.high) == pytest.approx((theirs.low, theirs.high))


def test_pairing_takes_away_what_seeds_share():
    shared = pd.Series(VALUES)
    paired = paired_difference(shared + 3.0, shared)
    assert paired.mean.low == pytest.approx(3.0)
    assert paired.mean.high == pytest.approx(3.0)
