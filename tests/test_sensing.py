"""Noise and spikes against the paper's description."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoplan.sensing import add_spikes
from infoplan.simulator import measure

batches = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=60).map(np.array)


def test_noise_has_the_stated_deviation():
    truth = np.full(100_000, 500.0)
    measured = measure(truth, 3.0, np.random.default_rng(0))
    assert abs(np.mean(measured - truth)) < 0.05
    assert np.std(measured - truth) == pytest.approx(3.0, rel=0.02)


@given(batches, st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_spikes_are_the_stated_share_and_size(batch, rho, seed):
    spiked, is_outlier = add_spikes(batch, rho, np.random.default_rng(seed))
    assert abs(is_outlier.sum() - rho * len(batch)) <= 0.5
    np.testing.assert_array_equal(spiked[~is_outlier], batch[~is_outlier])
    low, high = np.quantile(batch, [0.05, 0.95])
    size = np.abs(spiked - batch)[is_outlier]
    slack = 1e-9 * np.abs(batch).max()
    assert np.all(size >= 1 * (high - low) - slack)
    assert np.all(size <= 2 * (high - low) + slack)


@pytest.mark.parametrize(
    ("rule", "rho", "n", "expected"),
    [
        ("round", 0.05, 10, 0),
        ("round", 0.05, 11, 1),
        ("round", 0.15, 10, 2),
        ("round", 0.15, 30, 4),
        ("floor", 0.05, 19, 0),
        ("floor", 0.15, 20, 3),
        ("floor", 0.29, 100, 29),
        ("round", 1.0, 7, 7),
        ("bernoulli", 1.0, 7, 7),
        ("bernoulli", 0.0, 7, 0),
    ],
)
def test_number_of_spikes(rule, rho, n, expected):
    _, is_outlier = add_spikes(np.arange(n) * 1.0, rho, np.random.default_rng(0), count=rule)
    assert is_outlier.sum() == expected


def test_signs_and_places_are_even_and_bernoulli_has_its_rate():
    rng = np.random.default_rng(1)
    batch = np.linspace(0, 100, 50)
    ups, places, numbers = [], np.zeros(50), []
    for _ in range(2000):
        spiked, is_outlier = add_spikes(batch, 0.2, rng, count="bernoulli")
        ups.extend(spiked[is_outlier] > batch[is_outlier])
        places += is_outlier
        numbers.append(is_outlier.sum())
    assert np.mean(ups) == pytest.approx(0.5, abs=0.02)
    assert np.mean(numbers) == pytest.approx(10, abs=0.3)
    assert np.all(np.abs(places / 2000 - 0.2) < 0.05)


def test_amplitude_and_quantiles_are_used():
    batch = np.linspace(0, 100, 101)
    spiked, is_outlier = add_spikes(
        batch, 0.5, np.random.default_rng(0), amplitude=(3.0, 3.0), quantiles=(0.25, 0.75)
    )
    np.testing.assert_allclose(np.abs(spiked - batch)[is_outlier], 150.0)
