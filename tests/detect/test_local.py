"""Deviation from nearest neighbours, against loops and SciPy."""

import numpy as np
import pytest
from scipy.stats import median_abs_deviation
from track import evidence, track

from infoplan.detect import local


@pytest.mark.parametrize("neighbours", [3, 10])
@pytest.mark.parametrize(
    ("judged", "flagged"), [(slice(65, None), (47, 60, 64)), (slice(None), ())]
)
def test_scores_are_modified_z_scores(judged, flagged, neighbours):
    x, y, is_outlier = track()
    samples = evidence(x, y, is_outlier, judged=judged, flagged=flagged)
    flags, score = local(
        samples, None, np.random.default_rng(0), neighbours=neighbours, threshold=2.0
    )
    for i in range(80):
        if not samples.judged[i]:
            assert np.isnan(score[i])
            assert not flags[i]
            continue
        others = [j for j in range(80) if j != i and j not in flagged]
        others.sort(key=lambda j, i=i: np.hypot(*(x[i] - x[j])))
        near = y[others[:neighbours]]
        spread = median_abs_deviation(near, scale=1 / 1.4826)
        assert score[i] == pytest.approx(abs(y[i] - np.median(near)) / spread)
        assert flags[i] == (score[i] > 2.0)


def test_spikes_are_flagged_and_little_else():
    x, y, is_outlier = track(200, spikes=range(5, 200, 20), height=300.0)
    samples = evidence(x, y, is_outlier, judged=slice(None))
    flags, _ = local(samples, None, np.random.default_rng(0))
    assert flags[is_outlier].all()
    assert (flags & ~is_outlier).sum() < 10


def test_flat_ground_without_noise():
    x, _, _ = track(20)
    y = np.full(20, 700.0)
    y[3] += 1e-3
    samples = evidence(x, y, np.zeros(20, bool), judged=slice(None))
    flags, score = local(samples, None, np.random.default_rng(0))
    assert flags.tolist() == [i == 3 for i in range(20)]
    assert np.isfinite(score).all()


def test_more_neighbours_than_samples():
    x, y, is_outlier = track(6, spikes=())
    samples = evidence(x, y, is_outlier, judged=slice(4, None))
    _, score = local(samples, None, np.random.default_rng(0), neighbours=50)
    near = y[:5]
    expected = abs(y[5] - np.median(near)) / median_abs_deviation(near, scale=1 / 1.4826)
    assert score[5] == pytest.approx(expected)
