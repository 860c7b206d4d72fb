"""Means over strata, against SciPy and against what an interval of 95 % promises."""

import numpy as np
import pytest
from scipy import stats

from infoplan.analyse.statistics import stratified_mean


def test_one_stratum_is_students_interval():
    values = np.random.default_rng(0).normal(3, 2, size=7)
    found = stratified_mean([values])
    expected = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert found.mean == pytest.approx(values.mean())
    assert found.error == pytest.approx(stats.sem(values))
    assert (found.interval.low, found.interval.high) == pytest.approx(tuple(expected))
    assert found.interval.n == 7


def test_two_strata_are_welchs_interval():
    rng = np.random.default_rng(1)
    one, two = rng.normal(1, 3, size=4), rng.normal(5, 0.5, size=9)
    found = stratified_mean([one, two])
    welch = stats.ttest_ind(one, -two, equal_var=False)
    expected = welch.confidence_interval(0.9)
    assert found.mean == pytest.approx((one.mean() + two.mean()) / 2)
    assert found.dof == pytest.approx(welch.df)
    assert found.bound(0.05) == pytest.approx(expected.low / 2)
    assert found.bound(0.95) == pytest.approx(expected.high / 2)


def test_the_interval_of_three_unlike_strata_holds_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(3000):
        strata = [rng.normal(mean, spread, size=n) for mean, spread, n in
                  ((0, 1, 5), (10, 3, 5), (-4, 0.2, 3))]  # fmt: skip
        interval = stratified_mean(strata).interval
        held += interval.low <= 2.0 <= interval.high
    assert held / 3000 == pytest.approx(0.95, abs=0.012)


def test_too_few_or_equal_values():
    single = stratified_mean([[1.0], [3.0, 5.0]])
    assert single.mean == 2.5
    assert np.isnan([single.interval.low, single.interval.high]).all()
    equal = stratified_mean([[2.0, 2.0], [4.0, 4.0, 4.0]])
    assert (equal.interval.low, equal.mean, equal.interval.high) == (3.0, 3.0, 3.0)
