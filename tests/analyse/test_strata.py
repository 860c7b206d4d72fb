"""Means over strata at any level, against SciPy and against what an interval promises."""

import numpy as np
import pytest
from scipy import stats

from infoplan.analyse.statistics import stratified_mean


def test_two_strata_are_welchs_interval_at_any_level():
    rng = np.random.default_rng(1)
    one, two = rng.normal(1, 3, size=4), rng.normal(5, 0.5, size=9)
    welch = stats.ttest_ind(one, -two, equal_var=False)
    for level in (0.95, 0.9, 0.991):
        found = stratified_mean([one, two], level)
        expected = welch.confidence_interval(level)
        assert found.mean == pytest.approx((one.mean() + two.mean()) / 2)
        assert (found.low, found.high) == pytest.approx((expected.low / 2, expected.high / 2))


def test_the_interval_of_three_unlike_strata_holds_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(2)
    held, above = 0, 0
    for _ in range(2000):
        strata = [rng.normal(mean, spread, size=n) for mean, spread, n in
                  ((0, 1, 5), (10, 3, 5), (-4, 0.2, 3))]  # fmt: skip
        interval = stratified_mean(strata)
        held += interval.low <= 2.0 <= interval.high
        above += stratified_mean(strata, 1 - 2 * 0.01).low > 2.0
    assert held / 2000 == pytest.approx(0.95, abs=0.015)
    assert above / 2000 == pytest.approx(0.01, abs=0.006)
