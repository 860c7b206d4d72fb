"""Intervals and tests against SciPy's and statsmodels', which are not always installed."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from infoplan.analyse import (
    holm,
    interquartile_mean,
    mean_band,
    mean_interval,
    paired_difference,
    probability_below_zero,
    sign_flip_test,
    stratified_mean,
    t_test,
)
from infoplan.analyse.judging import Stated, p_inside, p_outside
from infoplan.analyse.statistics import ratio_band

VALUES = np.random.default_rng(5).gamma(2.0, 100.0, size=11)
CENTRED = VALUES - 170.0
SIDES = ("less", "greater", "two-sided")


@pytest.mark.parametrize("n", [2, 3, 10, 11])
def test_interval_of_the_mean_is_scipys(n):
    ours = mean_interval(VALUES[:n])
    theirs = stats.ttest_1samp(VALUES[:n], 0.0).confidence_interval(0.95)
    assert ours.mean == pytest.approx(VALUES[:n].mean())
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)
    assert ours.n == n


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=25))
def test_interquartile_mean_is_scipys_trimmed_mean(values):
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25), abs=1e-6)


def test_nans_are_left_out_and_little_data_has_no_interval():
    assert mean_interval([1.0, np.nan, 3.0]) == mean_interval([1.0, 3.0])
    single = mean_interval([7.0, np.nan])
    assert (single.mean, single.n) == (7.0, 1)
    assert np.isnan([single.low, single.high]).all()
    nothing = mean_interval([np.nan])
    assert np.isnan(nothing.mean)
    assert nothing.n == 0


def test_an_infinite_value_has_no_interval_and_no_p():
    found = mean_interval([1.0, 2.0, np.inf])
    assert found.mean == np.inf
    assert np.isnan([found.low, found.high]).all()
    assert np.isnan([t_test([1.0, np.inf]), sign_flip_test([1.0, np.inf])]).all()


def test_band_is_the_interval_of_every_point():
    curves = VALUES[:6, None] + np.random.default_rng(1).normal(0, 20, (6, 4))
    mean, low, high = mean_band(curves)
    for point in range(4):
        interval = mean_interval(curves[:, point])
        assert (mean[point], low[point], high[point]) == pytest.approx(
            (interval.mean, interval.low, interval.high)
        )


def test_a_single_curve_has_no_band():
    mean, low, high = mean_band([[1.0, 2.0]])
    assert mean.tolist() == [1.0, 2.0]
    assert np.isnan([low, high]).all()


def test_differences_are_paired_by_seed():
    a = pd.Series({0: 10.0, 1: 20.0, 2: 30.0, 3: 50.0, 7: 1.0})
    b = pd.Series({3: 20.0, 2: 10.0, 1: 15.0, 0: 9.0, 8: 1.0})
    difference = paired_difference(a, b)
    assert difference.differences.to_dict() == {0: 1.0, 1: 5.0, 2: 20.0, 3: 30.0}
    assert difference.mean.mean == pytest.approx(14.0)
    assert difference.interquartile_mean == pytest.approx(12.5)
    assert difference.p == 2 / 16
    theirs = stats.ttest_rel([10, 20, 30, 50], [9, 15, 10, 20]).confidence_interval(0.95)
    assert (difference.mean.low, difference.mean.high) == pytest.approx((theirs.low, theirs.high))


def test_pairing_takes_away_what_seeds_share():
    shared = pd.Series(VALUES)
    paired = paired_difference(shared + 3.0, shared)
    assert paired.mean.low == pytest.approx(3.0)
    assert paired.mean.high == pytest.approx(3.0)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("n", [2, 6, 11])
def test_t_test_is_scipys(n, side):
    theirs = stats.ttest_1samp(CENTRED[:n], 0.0, alternative=side).pvalue
    assert t_test(CENTRED[:n], side) == pytest.approx(theirs, rel=1e-9)


def test_t_test_of_numbers_without_spread():
    assert [t_test([3.0] * 6, side) for side in SIDES] == [1.0, 0.0, 0.0]
    assert [t_test([-3.0] * 6, side) for side in SIDES] == [0.0, 1.0, 0.0]
    assert [t_test([0.0] * 6, side) for side in SIDES] == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("values", [CENTRED[:6], CENTRED, np.array([1.0, -2.0, 2.0, 0.0, 3.0])])
def test_exact_p_is_scipys(values, side):
    theirs = stats.permutation_test(
        (values,), np.mean, permutation_type="samples", alternative=side, n_resamples=np.inf
    ).pvalue
    assert sign_flip_test(values, side) == pytest.approx(theirs)


def test_least_exact_p_is_that_of_one_flip_in_all():
    assert sign_flip_test([1.0, 2.0, 3.0, 4.0, 5.0], "greater") == 1 / 32 > 0.025
    assert sign_flip_test([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "greater") == 1 / 64 < 0.025


def test_many_flips_are_drawn_from_a_fixed_seed():
    values = np.random.default_rng(3).normal(0.3, 1.0, 30)
    p = sign_flip_test(values, "greater")
    assert p == sign_flip_test(values, "greater")
    theirs = stats.permutation_test(
        (values,), np.mean, permutation_type="samples", alternative="greater",
        n_resamples=20_000, rng=np.random.default_rng(1),
    ).pvalue  # fmt: skip
    assert p == pytest.approx(theirs, abs=0.01)


def test_holm_is_statsmodels():
    multitest = pytest.importorskip("statsmodels.stats.multitest")
    p = [0.01, 0.04, 0.03, 0.005, 0.9, 0.03]
    assert holm(p) == pytest.approx(multitest.multipletests(p, method="holm")[1])


def test_holm_by_hand():
    assert holm([0.03, 0.01, 0.02]).tolist() == pytest.approx([0.04, 0.03, 0.04])
    assert holm([0.9, 0.6]).tolist() == [1.0, 1.0]


def test_two_one_sided_tests_are_statsmodels():
    weightstats = pytest.importorskip("statsmodels.stats.weightstats")
    for shift in (-60.0, 0.0, 55.0, 90.0):
        values = CENTRED / 3 + shift
        theirs = weightstats.ttost_paired(values, np.zeros(11), -60.0, 60.0)[0]
        assert p_inside(values, Stated(-60.0, 60.0), t_test) == pytest.approx(theirs)


def test_outside_of_two_bounds_is_corrected_for_two_tests():
    values = CENTRED + 100.0
    one = stats.ttest_1samp(values, 60.0, alternative="greater").pvalue
    assert p_outside(values, Stated(high=60.0), t_test) == pytest.approx(one)
    assert p_outside(values, Stated(-60.0, 60.0), t_test) == pytest.approx(2 * one)


def test_mean_over_two_strata_is_welchs():
    a, b = VALUES[:4], 3 * VALUES[4:]
    ours = stratified_mean([a, -b])
    theirs = stats.ttest_ind(a, b, equal_var=False).confidence_interval(0.95)
    assert ours.mean == pytest.approx((a.mean() - b.mean()) / 2)
    assert (ours.low, ours.high) == pytest.approx((theirs.low / 2, theirs.high / 2))
    assert ours.n == 11


def test_one_stratum_is_a_mean_and_little_data_has_no_interval():
    one, plain = stratified_mean([VALUES]), mean_interval(VALUES)
    assert (one.mean, one.low, one.high) == pytest.approx((plain.mean, plain.low, plain.high))
    few = stratified_mean([[1.0, 2.0], [5.0, np.nan]])
    assert (few.mean, few.n) == (3.25, 3)
    assert np.isnan([few.low, few.high]).all()
    assert np.isnan(stratified_mean([[1.0, 2.0], [np.nan]]).mean)


def test_probability_of_improvement_is_scipys_binomial():
    strata = [[-1.0, -2.0, 1.0, -3.0], [-1.0, 2.0, 1.0, -3.0]]
    theirs = stats.binomtest(5, 8).proportion_ci(0.95, method="exact")
    ours = probability_below_zero(strata)
    assert (ours.mean, ours.low, ours.high) == pytest.approx((5 / 8, theirs.low, theirs.high))
    sure, never = probability_below_zero([[-1.0] * 6]), probability_below_zero([[1.0] * 6])
    ends = stats.binomtest(6, 6).proportion_ci(0.95, method="exact")
    assert (sure.mean, sure.low, sure.high) == pytest.approx((1.0, ends.low, 1.0))
    assert (never.mean, never.low, never.high) == pytest.approx((0.0, 0.0, 1.0 - ends.low))


def test_probability_of_improvement_weighs_strata_alike_and_halves_ties():
    found = probability_below_zero([[-1.0], [1.0, 1.0, 0.0, 0.0]])
    assert found.mean == pytest.approx((1.0 + 0.25) / 2)
    # Worth 4 / (1 + 1/4) = 3.2 numbers: less than the five.
    assert found.high - found.low > np.ptp(stats.binomtest(3, 5).proportion_ci(0.95))


def test_a_ratio_of_equal_denominators_is_a_mean():
    parts = VALUES[:, None] / 1000
    assert ratio_band(2 * parts, np.full_like(parts, 2.0)) == pytest.approx(mean_band(parts))
    assert ratio_band([[1.0], [0.0]], [[1.0], [1.0]])[:, 0].tolist() == [0.5, 0.0, 1.0]


def test_a_ratio_has_the_error_of_a_weighted_line_through_zero():
    rng = np.random.default_rng(2)
    whole = rng.integers(5, 50, 40).astype(float)
    part = rng.binomial(whole.astype(int), 0.3).astype(float)
    jackknifed = [(part.sum() - a) / (whole.sum() - b) for a, b in zip(part, whole, strict=True)]
    error = np.sqrt(39 / 40 * np.sum((jackknifed - np.mean(jackknifed)) ** 2))
    ratio, low, high = ratio_band(part[:, None], whole[:, None])[:, 0]
    assert ratio == pytest.approx(part.sum() / whole.sum())
    assert (high - low) / 2 == pytest.approx(stats.t.ppf(0.975, 39) * error, rel=0.05)
