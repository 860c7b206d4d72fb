"""Deviation from the running median, against pandas."""

import numpy as np
import pandas as pd
import pytest
from track import evidence, track

from infoplan.detect import hampel


@pytest.mark.parametrize("reach", [1, 5, 100])
@pytest.mark.parametrize("judged", [slice(65, None), slice(2, None), slice(None)])
def test_scores_are_those_of_rolling_medians(judged, reach):
    x, y, is_outlier = track()
    samples = evidence(x, y, is_outlier, judged=judged, flagged=(47, 60))
    flags, score = hampel(samples, None, np.random.default_rng(0), reach=reach, threshold=2.0)
    rolling = {"window": 2 * reach + 1, "center": True, "min_periods": 1}
    middle = pd.Series(y).rolling(**rolling).median().to_numpy()
    mad = pd.Series(y).rolling(**rolling).apply(lambda near: (near - near.median()).abs().median())
    expected = np.abs(y - middle) / (1.4826 * mad.to_numpy())
    np.testing.assert_allclose(score[samples.judged], expected[samples.judged])
    assert np.isnan(score[~samples.judged]).all()
    np.testing.assert_array_equal(flags, samples.judged & (expected > 2.0))


def test_spikes_are_flagged_and_little_else():
    x, y, is_outlier = track(200, spikes=range(5, 200, 20), height=300.0)
    samples = evidence(x, y, is_outlier, judged=slice(None))
    flags, _ = hampel(samples, None, np.random.default_rng(0))
    assert flags[is_outlier].all()
    assert (flags & ~is_outlier).sum() < 10


def test_flat_ground_without_noise():
    x, _, _ = track(20)
    y = np.full(20, 700.0)
    y[3] += 1e-3
    samples = evidence(x, y, np.zeros(20, bool), judged=slice(None))
    flags, score = hampel(samples, None, np.random.default_rng(0))
    assert flags.tolist() == [i == 3 for i in range(20)]
    assert np.isfinite(score).all()
