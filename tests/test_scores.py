"""Scores against their definitions: integrals, draws, other formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from infoplan import scores

NUMBERS = st.floats(-5.0, 5.0)


@given(mean=NUMBERS, std=st.floats(0.1, 5.0), truth=NUMBERS)
def test_the_crps_is_the_integral_over_the_step(mean, std, truth):
    found = scores.continuous_ranked_probability(*map(np.array, ([mean], [std], [truth])))[0]
    cumulative = stats.norm(mean, std).cdf
    below, _ = integrate.quad(lambda t: cumulative(t) ** 2, mean - 60.0, truth, limit=400)
    above, _ = integrate.quad(lambda t: (1 - cumulative(t)) ** 2, truth, mean + 60.0, limit=400)
    assert found == pytest.approx(below + above, abs=1e-6)


def test_the_mean_of_the_truth_scores_one():
    truth = np.random.default_rng(0).normal(3.0, 2.0, 100)
    assert scores.standardised_square(truth.mean() - truth, truth) == pytest.approx(1.0)
    assert np.isnan(scores.standardised_square(np.ones(4), np.full(4, 7.0)))
    assert np.isnan(scores.standardised_square(np.ones(4), np.full(4, np.nan)))


def test_the_trivial_prediction_loses_nothing():
    rng = np.random.default_rng(1)
    truth, measured = rng.normal(size=100), rng.normal(1.0, 3.0, 50)
    nlpd = -np.mean(stats.norm.logpdf(truth, measured.mean(), measured.std()))
    assert scores.standardised_log_loss(nlpd, truth, measured) == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(scores.standardised_log_loss(nlpd, truth, np.full(50, 2.0)))


def test_thirds_have_errors_of_their_own():
    third = np.array([0, 1, 2, 2, 1, 0])
    found = scores.by_third(np.array([3.0, 1.0, 2.0, -2.0, -1.0, -4.0]), third)
    assert found == pytest.approx(
        {"rmse_flat": np.sqrt(12.5), "rmse_middle": 1.0, "rmse_rugged": 2.0}
    )


def test_a_way_is_the_sum_of_its_steps():
    assert scores.path_length(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]])) == 6.0
    assert scores.path_length(np.zeros((1, 2))) == 0.0
