"""The trimming process against the package of its authors, and against trimming step by step."""

import numpy as np
import pytest
from scipy import stats

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, IterativeTrimmingProcess
from infoplan.model.itgp import consistency

START = {"amplitude": 1.2, "lengthscale": 0.6, "noise_variance": 0.05, "jitter": 0.0}
QUERY = np.array([[0.1, 0.2], [-0.7, 0.4], [0.9, -0.9], [1.5, 0.0]])
STEPS = {
    "usual": {},
    "gentle": {"alpha1": 0.8, "alpha2": 0.9, "shrinking": 1},
    "no reweighting": {"reweighting": 0, "concentrating": 3},
    "no concentrating": {"concentrating": 0, "reweighting": 2},
    "no trimming first": {"shrinking": 0, "concentrating": 0, "reweighting": 3},
}


def data(n=80, spikes=12, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (n, 2))
    y = np.sin(3 * x[:, 0]) + x[:, 1] + 0.1 * rng.standard_normal(n)
    y[:spikes] += rng.choice([-1.0, 1.0], spikes) * rng.uniform(2, 6, spikes)
    return x, y


def scaled(x, y, at):
    low, extent = x.min(axis=0), np.ptp(x, axis=0)
    return 2 * (x - low) / extent - 1, (y - y.mean()) / y.std(), 2 * (at - low) / extent - 1


def of_the_package(x, y, learn, **steps):
    """The package on scaled data; mean and deviation of noisy observations at the queries."""
    robustgp, gpy = pytest.importorskip("robustgp"), pytest.importorskip("GPy")
    names = {"shrinking": "nsh", "concentrating": "ncc", "reweighting": "nrw"}
    inputs, outputs, query = scaled(x, y, QUERY)
    kernel = gpy.kern.RBF(2, START["amplitude"] ** 2, [START["lengthscale"]] * 2, ARD=True)
    likelihood = gpy.likelihoods.Gaussian(variance=START["noise_variance"])
    if not learn:
        kernel.fix(), likelihood.fix()
    steps = {names.get(name, name): value for name, value in steps.items()}
    found = robustgp.ITGP(inputs, outputs, kernel=kernel, likelihood=likelihood, **steps)
    mean, variance = found.gp.predict(query, include_likelihood=True)
    std = y.std() * np.sqrt(found.consistency * variance[:, 0])
    return y.mean() + y.std() * mean[:, 0], std, found.gp


@pytest.mark.parametrize("steps", STEPS.values(), ids=STEPS)
def test_it_is_the_authors_package_under_given_hyperparameters(steps):
    x, y = data()
    model = IterativeTrimmingProcess(x, y, **START, **steps)
    mean, std = model.predict(QUERY, noisy=True)
    expected_mean, expected_std, gp = of_the_package(x, y, learn=False, **steps)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-6)
    np.testing.assert_allclose(std, expected_std, rtol=1e-6)
    assert model.log_marginal_likelihood == pytest.approx(float(gp.log_likelihood()), rel=1e-5)


def test_it_learns_what_the_authors_package_learns():
    x, y = data()
    model = IterativeTrimmingProcess(x, y, **START, optimizer="lbfgs")
    model.optimize(300)
    mean, std = model.predict(QUERY, noisy=True)
    expected_mean, expected_std, gp = of_the_package(x, y, learn=True)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-3)
    np.testing.assert_allclose(std, expected_std, rtol=1e-3)
    learned = model.hyperparameters
    assert learned.noise_std**2 == pytest.approx(float(gp.likelihood.variance[0]), rel=1e-2)
    assert learned.lengthscale_1 == pytest.approx(float(gp.kern.lengthscale[0]), rel=1e-2)


def test_outliers_do_not_move_it():
    x, y = data(120, 0)
    sound = GaussianProcess(x, y, noise_variance=0.05)
    worse = y.copy()
    worse[::6] += 50.0
    model, gaussian = (
        kind(x, y, noise_variance=0.05) for kind in (IterativeTrimmingProcess, GaussianProcess)
    )
    for one in (model, gaussian):
        one.replace(x, worse)
        one.optimize(30)
    sound.optimize(30)
    truth = sound.predict(QUERY)[0]
    assert np.abs(model.predict(QUERY)[0] - truth).max() < 0.4
    assert np.abs(gaussian.predict(QUERY)[0] - truth).max() > 2.0
    assert model.n_data == 120


def test_data_that_come_later_are_trimmed_without_being_learned_from():
    x, y = data(100, 0)
    model = IterativeTrimmingProcess(x[:80], y[:80])
    model.optimize(50)
    learned, before = vars(model.hyperparameters), model.predict(QUERY)[0]
    model.append(x[80:], y[80:] + 100.0)
    assert vars(model.hyperparameters) == learned
    np.testing.assert_allclose(model.predict(QUERY)[0], before, atol=0.5)


def test_the_consistency_factor_restores_the_variance_of_trimmed_noise():
    noise = np.random.default_rng(1).normal(size=10**6)
    for share in (0.5, 0.9, 0.975):
        kept = noise[np.abs(noise) <= stats.norm.ppf(0.5 + share / 2)]
        assert consistency(share) * kept.var() == pytest.approx(1.0, rel=5e-3)


def test_few_data_and_none_are_taken():
    x, y = data(20, 0)
    model = IterativeTrimmingProcess(x, y)
    for n in (2, 1, 0):
        model.replace(x[:n], y[:n])
        model.optimize(2)
        mean, std = model.predict(QUERY)
        assert np.isfinite(mean).all()
        assert (std > 0).all()
    with pytest.raises(RunError, match="not finite"):
        model.append(x[:1], [np.nan])
