"""Leave-one-out residuals against refits that really leave one out."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from track import evidence, fitted, track

from infoplan.detect import gp_residual
from infoplan.model import GaussianProcess, StudentTProcess


def residual(model, x, y, given, i, noise_factor=1.0):
    """Standardised residual of sample i under scikit-learn's process given some others."""
    half = len(y) // 2
    low, size = x[:half].min(axis=0), np.ptp(x[:half], axis=0)
    scaled = 2 * (x - low) / size - 1
    h = model.hyperparameters
    kernel = ConstantKernel(h.amplitude**2) * RBF([h.lengthscale_1, h.lengthscale_2])
    noise = noise_factor * h.noise_std**2 + model.jitter
    process = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None)
    standard = (y - y[:half].mean()) / y[:half].std()
    process.fit(scaled[given], standard[given])
    mean, std = process.predict(scaled[[i]], return_std=True)
    return abs(standard[i] - mean[0]) / np.hypot(std[0], np.sqrt(noise))


SCOPES = {"batch": (slice(65, None), (47, 60)), "historical": (slice(None), ())}


@pytest.mark.parametrize(("kind", "noise_factor"), [(GaussianProcess, 1.0), (StudentTProcess, 2.0)])
@pytest.mark.parametrize("scope", SCOPES)
def test_all_at_once_is_leave_one_out(scope, kind, noise_factor):
    x, y, is_outlier = track()
    judged, flagged = SCOPES[scope]
    model = fitted(x, y, kind)
    samples = evidence(x, y, is_outlier, judged=judged, flagged=flagged)
    flags, score = gp_residual(
        samples, model, np.random.default_rng(0), threshold=2.5, one_by_one=False
    )
    candidates = np.setdiff1d(np.arange(80), flagged)
    for i in np.arange(80)[judged]:
        expected = residual(model, x, y, np.setdiff1d(candidates, [i]), i, noise_factor)
        assert score[i] == pytest.approx(expected, rel=1e-6)
    np.testing.assert_array_equal(flags[judged], score[judged] > 2.5)
    assert np.isnan(score[~samples.judged]).all()
    assert not flags[~samples.judged].any()


@pytest.mark.parametrize("scope", SCOPES)
def test_one_by_one_drops_the_worst_and_refits(scope):
    x, y, is_outlier = track()
    judged, flagged = SCOPES[scope]
    model = fitted(x, y)
    samples = evidence(x, y, is_outlier, judged=judged, flagged=flagged)
    flags, score = gp_residual(samples, model, np.random.default_rng(0), threshold=3.0)
    present = set(np.setdiff1d(np.arange(80), flagged).tolist())
    left = [i for i in np.arange(80)[judged].tolist() if i in present]
    expected = {}
    while True:
        expected |= {i: residual(model, x, y, sorted(present - {i}), i) for i in left}
        worst = max(left, key=expected.get)
        if expected[worst] <= 3.0:
            break
        present.remove(worst)
        left.remove(worst)
    assert 0 < len(expected) - len(left) < 12
    np.testing.assert_array_equal(np.flatnonzero(flags), sorted(set(expected) - set(left)))
    for i, value in expected.items():
        assert score[i] == pytest.approx(value, rel=1e-6)


def test_a_spike_spares_its_neighbours_one_by_one():
    x, y, is_outlier = track(height=150.0)
    model = fitted(x, y)
    samples = evidence(x, y, is_outlier, judged=slice(40, None))
    rng = np.random.default_rng(0)
    together, _ = gp_residual(samples, model, rng, one_by_one=False)
    alone, _ = gp_residual(samples, model, rng)
    assert alone[is_outlier].all()
    assert (alone & ~is_outlier).sum() < (together & ~is_outlier).sum()


def test_the_model_stays_as_it_was():
    x, y, is_outlier = track()
    model = fitted(x, y)
    before = model.predict(x), model.log_marginal_likelihood, model.n_data
    gp_residual(evidence(x, y, is_outlier, judged=slice(40, None)), model, None)
    after = model.predict(x), model.log_marginal_likelihood, model.n_data
    np.testing.assert_array_equal(before[0], after[0])
    assert before[1:] == after[1:]
