"""Detectors against PyOD and the paper's formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyod.models.copod import COPOD

from infoplan.detect import DETECTORS, Evidence

values = st.lists(
    st.floats(-1e4, 1e4, allow_nan=False).map(lambda v: round(v, 2)), min_size=5, max_size=80
).map(np.array)


def judge(name, y, is_outlier=None, **options):
    nothing = np.zeros(len(y), bool)
    samples = Evidence(
        x=np.zeros((len(y), 2)),
        measured=y,
        epoch=np.zeros(len(y), int),
        flagged=nothing,
        judged=~nothing,
        is_outlier=nothing if is_outlier is None else is_outlier,
    )
    return DETECTORS[name](samples, None, np.random.default_rng(0), **options)


@settings(deadline=None)
@given(values, st.sampled_from([0.05, 0.1, 0.3, 0.5]))
def test_copod_equals_pyod(y, contamination):
    flagged, score = judge("copod", y, contamination=contamination)
    reference = COPOD(contamination=contamination).fit(y[:, None])
    np.testing.assert_array_equal(flagged, reference.labels_ == 1)
    np.testing.assert_array_equal(score, reference.decision_scores_)


@settings(deadline=None)
@given(values)
def test_paper_score_is_the_maximum_of_the_three_tails(y):
    n = len(y)
    left = np.array([np.sum(y <= value) / n for value in y])
    right = np.array([np.sum(-y <= -value) / n for value in y])
    spread = np.sqrt(np.sum((y - y.mean()) ** 2) / (n - 1)) ** 3
    skewness = np.mean((y - y.mean()) ** 3) / spread if spread else 0.0
    corrected = left if skewness < 0 else right
    expected = np.max([-np.log(left), -np.log(right), -np.log(corrected)], axis=0)
    flagged, score = judge("copod", y, score="paper", contamination=0.2)
    np.testing.assert_array_equal(score, expected)
    np.testing.assert_array_equal(flagged, score > np.percentile(score, 80))


def test_scores_differ_on_skewed_data():
    y = np.random.default_rng(0).exponential(size=300)
    pyod_flags, _ = judge("copod", y, score="pyod")
    paper_flags, _ = judge("copod", y, score="paper")
    assert (pyod_flags != paper_flags).any()


def test_a_spike_is_flagged():
    y = np.append(np.random.default_rng(0).normal(size=200), 50.0)
    assert judge("copod", y)[0][-1]


@pytest.mark.parametrize(("name", "expected"), [("none", [0, 0, 0]), ("best", [0, 1, 0])])
def test_the_ends_of_the_scale(name, expected):
    flagged, score = judge(name, np.zeros(3), np.array([False, True, False]))
    assert flagged.tolist() == [bool(e) for e in expected]
    assert np.isnan(score).all()
