"""QARTOD's tests against ioos_qc, and by hand."""

import numpy as np
import pytest
from track import evidence, track

from infoplan.detect import qartod

NONE = dict.fromkeys(("gross_range", "spike", "rate", "flat"))
OFF = 1.4826


def judged_by(y, judged=slice(None), **limits):
    samples = evidence(np.zeros((len(y), 2)), y, np.zeros(len(y), bool), judged=judged)
    return qartod(samples, None, np.random.default_rng(0), **{**NONE, **limits})


def stream(seed=0):
    """A track with spikes, and values that repeat, some for longer than others."""
    y = track(300, spikes=range(7, 300, 23), seed=seed)[1]
    for start, length in ((30, 3), (80, 4), (130, 5), (200, 12), (290, 10)):
        y[start : start + length] = y[start]
    return y


@pytest.mark.parametrize("seed", range(3))
def test_each_test_is_that_of_ioos(seed):
    tests = pytest.importorskip("ioos_qc.qartod")
    y, seconds = stream(seed), np.arange(300)
    middle, away = np.median(y), np.median(np.abs(y - np.median(y)))
    span = (middle - OFF * away, middle + OFF * away)
    expected = tests.gross_range_test(y, span) == 4
    np.testing.assert_array_equal(judged_by(y, gross_range=1.0)[0], expected)
    assert expected.any()
    bends = np.abs(y[1:-1] - (y[:-2] + y[2:]) / 2)
    limit = 4 * np.median(bends)
    expected = tests.spike_test(y, limit, limit) == 4
    np.testing.assert_array_equal(judged_by(y, spike=4.0)[0], expected)
    assert expected.any()
    limit = 4 * np.median(np.abs(np.diff(y)))
    expected = tests.rate_of_change_test(y, seconds, limit, limit) == 4
    np.testing.assert_array_equal(judged_by(y, rate=4.0)[0], expected)
    assert expected.any()
    for flat, tolerance in ((3, 1e-9), (1, 2.0), (4, 5.0)):
        expected = tests.flat_line_test(y, seconds, flat + 1, flat + 1, tolerance) == 4
        np.testing.assert_array_equal(judged_by(y, flat=flat, tolerance=tolerance)[0], expected)
        assert expected.any()


def test_each_test_by_hand():
    y = np.array([0.0, 1, 2, 3, 50, 5, 6, 7, 7, 7, 7, 9])
    # Median 6.5, of the distances 2.25, of the bends 0.25, of the steps 1.
    flags, score = judged_by(y, gross_range=3.0)
    assert flags.tolist() == [i == 4 for i in range(12)]
    assert score[4] == pytest.approx(43.5 / (3 * OFF * np.median(np.abs(y - 6.5))))
    bends = [0, 0, 23, 46, 23, 0, 0.5, 0, 0, 1]
    assert judged_by(y, spike=50.0)[1][1:-1] == pytest.approx(
        np.array(bends) / (50 * np.median(bends))
    )
    assert np.flatnonzero(judged_by(y, rate=8.0)[0]).tolist() == [4, 5]
    assert np.flatnonzero(judged_by(y, flat=2)[0]).tolist() == [10]
    assert judged_by(y, flat=2)[1].tolist() == [0] * 8 + [0.5, 1, 1.5, 0]
    assert np.flatnonzero(judged_by(y, flat=2, tolerance=1.0)[0]).tolist() == [9, 10]
    assert not judged_by(y)[0].any()


def test_the_score_is_the_largest_share_and_only_the_judged_have_one():
    y = stream()
    limits = {"gross_range": 2.0, "spike": 3.0, "rate": 3.0, "flat": 2}
    flags, score = judged_by(y, slice(250, None), **limits)
    alone = [judged_by(y, **{name: limit})[1] for name, limit in limits.items()]
    np.testing.assert_array_equal(score[250:], np.max(alone, axis=0)[250:])
    assert np.isnan(score[:250]).all()
    np.testing.assert_array_equal(flags, np.nan_to_num(score) > 1)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_short_tracks_and_flat_ground(n):
    limits = {"gross_range": 2.0, "spike": 3.0, "rate": 3.0}
    flags, score = judged_by(np.full(n, 700.0), **limits, flat=3)
    assert not flags.any()
    assert np.isfinite(score).all()
    assert judged_by(np.array([700.0] * 9 + [701.0] + [700.0] * 9), **limits)[0][9]
