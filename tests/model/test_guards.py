"""Priors, floors and restarts against plain code: SciPy's distributions and optimisers, loops."""

import numpy as np
import pytest
from model.test_kernels import GIBBS
from scipy.optimize import minimize
from scipy.stats import norm

from infoplan.errors import UsageError
from infoplan.model import GaussianProcess, StudentTProcess, VecchiaProcess, log_marginal_likelihood
from infoplan.model.kernels import as_kernel
from infoplan.model.optimizers import Adam
from infoplan.model.prior import Prior
from infoplan.model.theta import bounds_of

MODELS = [GaussianProcess, StudentTProcess, VecchiaProcess]
LENGTHSCALE, NOISE = (0.3, 0.4), (0.05, 0.7)


def noise(n=40, seed=0):
    """Positions whose box is 50 by 20 units, and observations without any structure."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(0.0, 1.0, (n, 2)) * [50.0, 20.0]
    x[:2] = [0.0, 0.0], [50.0, 20.0]
    return x, rng.normal(size=n)


def scaled(x, y):
    return 2.0 * x / [50.0, 20.0] - 1.0, (y - y.mean()) / y.std()


def theta_of(model):
    *values, noise_std = vars(model.hyperparameters).values()
    return np.log([*values, noise_std**2])


def log_posterior(theta, x, y):
    """Log likelihood and the densities of the logarithms, by SciPy."""
    of_lengthscales = norm.logpdf(theta[1:3], np.log(LENGTHSCALE[0]), LENGTHSCALE[1]).sum()
    of_noise = norm.logpdf(theta[3], np.log(NOISE[0]), NOISE[1])
    return log_marginal_likelihood(x, y, theta)[0] + of_lengthscales + of_noise


@pytest.mark.parametrize("of_lengthscales", [None, LENGTHSCALE])
@pytest.mark.parametrize("of_noise", [None, NOISE])
def test_the_priors_are_log_normal_with_their_gradient(of_lengthscales, of_noise):
    kernel = as_kernel("rational_quadratic")
    prior = Prior(kernel, of_lengthscales, of_noise)
    rng = np.random.default_rng(1)

    def expected(theta):
        total = 0.0
        if of_lengthscales:
            total += norm.logpdf(theta[1:3], np.log(of_lengthscales[0]), of_lengthscales[1]).sum()
        if of_noise:
            total += norm.logpdf(theta[4], np.log(of_noise[0]), of_noise[1])
        return total

    a, b = rng.normal(size=(2, 5))
    difference = prior.log_density(a)[0] - prior.log_density(b)[0]
    assert difference == pytest.approx(expected(a) - expected(b), abs=1e-12)
    steps = 1e-6 * np.eye(5)
    slopes = [(expected(a + step) - expected(a - step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(prior.log_density(a)[1], slopes, atol=1e-7)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_learning_ends_at_the_maximum_a_posteriori(optimizer):
    x, y = noise(30)
    model = GaussianProcess(
        x, y, optimizer=optimizer, learning_rate=0.03, lengthscale_prior=LENGTHSCALE,
        noise_prior=NOISE,
    )  # fmt: skip
    model.optimize(1000 if optimizer == "adam" else 100)
    best = minimize(
        lambda theta: -log_posterior(theta, *scaled(x, y)), np.log([1.0, 0.5, 0.5, 1.0]),
        method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-10, "maxiter": 4000},
    )  # fmt: skip
    np.testing.assert_allclose(theta_of(model), best.x, atol=2e-3)
    likelihood = log_marginal_likelihood(*scaled(x, y), theta_of(model))[0]
    assert model.log_marginal_likelihood == pytest.approx(likelihood)  # without the priors


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_no_lengthscale_is_below_its_floor(model, optimizer):
    x, y = noise()
    options = {"optimizer": optimizer, "learning_rate": 0.3, "lengthscale": 0.1}
    floors = np.array([2.0 * 1.5 * 0.7 / 50.0, 2.0 * 1.5 * 0.7 / 20.0])  # 0.042 and 0.105
    guarded = model(x, y, min_lengthscale=1.5, spacing=0.7, **options)
    assert guarded.hyperparameters.lengthscale_2 == pytest.approx(floors[1])
    guarded.optimize(15)
    found = [guarded.hyperparameters.lengthscale_1, guarded.hyperparameters.lengthscale_2]
    assert (found >= floors * (1.0 - 1e-12)).all()
    free = GaussianProcess(x, y, **options)
    free.optimize(15)
    freely = [free.hyperparameters.lengthscale_1, free.hyperparameters.lengthscale_2]
    assert (np.array(freely) < floors).any()


def test_a_floor_beyond_all_lengthscales_fixes_them():
    x, y = noise()
    for optimizer in ("adam", "lbfgs"):
        model = GaussianProcess(x, y, optimizer=optimizer, min_lengthscale=500.0, spacing=0.7)
        model.optimize(5)
        assert model.hyperparameters.lengthscale_2 >= 35.0 * (1.0 - 1e-12)


def test_a_kernel_without_lengthscales_has_no_floor():
    with pytest.raises(UsageError, match="needs a kernel with a lengthscale_1, and this one learn"):
        GaussianProcess(*noise(), kernel=GIBBS, min_lengthscale=1.0)


def test_restarts_are_the_stated_ones_and_the_best_end_counts():
    x, y = noise()
    y = np.sin(x[:, 0] / 4.0) + np.cos(x[:, 1] / 3.0) + 0.1 * y
    data, first = scaled(x, y), np.log([1.0, 0.003, 0.003, 1.0])
    model = GaussianProcess(x, y, lengthscale=0.003, restarts=9, learning_rate=0.05)
    model.optimize(20)

    def evaluate(theta):
        return log_marginal_likelihood(*data, theta)

    bounds = bounds_of(as_kernel("squared_exponential"), 1e-4)
    drawn = [
        np.random.default_rng([0, number]).uniform(-np.log(10.0), np.log(10.0), 4)
        for number in range(9)
    ]
    ends = [
        Adam(0.05).ascend(evaluate, np.clip(start, bounds.lower, bounds.upper), 20, bounds)
        for start in [first, *(first + step for step in drawn)]
    ]
    values = [evaluate(end)[0] for end in ends]
    assert np.argmax(values) > 0
    np.testing.assert_allclose(theta_of(model), ends[int(np.argmax(values))], rtol=1e-9)
    again = GaussianProcess(x, y, lengthscale=0.003, restarts=9, learning_rate=0.05)
    again.optimize(0)
    np.testing.assert_allclose(theta_of(again), first)


@pytest.mark.parametrize("model", MODELS)
def test_restarts_never_end_lower(model):
    x, y = noise(20)
    alone, restarted = model(x, y, noise_prior=NOISE), model(x, y, noise_prior=NOISE, restarts=2)
    ends = []
    for one in (alone, restarted):
        one.optimize(8)
        theta = theta_of(one)
        prior = norm.logpdf(theta[-1], np.log(NOISE[0]), NOISE[1])
        ends.append(one.log_marginal_likelihood + prior)
    assert ends[1] >= ends[0] - 1e-9
