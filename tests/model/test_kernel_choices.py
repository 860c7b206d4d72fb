"""The kernels that `model.kernel` chooses from, in every inference, against scikit-learn."""

import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, RationalQuadratic

from infoplan.config import KERNELS
from infoplan.model import GaussianProcess, StudentTProcess, VecchiaProcess, log_marginal_likelihood
from infoplan.model.inference.laplace import LaplaceInference
from infoplan.model.inference.vecchia import VecchiaInference
from infoplan.model.kernels import as_kernel

MODELS = {"gp": GaussianProcess, "student_t": StudentTProcess, "vecchia": VecchiaProcess}

# Of distances in lengthscales: scikit-learn's rational quadratic has but one.
TRUTH = {
    "squared_exponential": lambda: RBF(1.0, "fixed"),
    "matern12": lambda: Matern(1.0, "fixed", nu=0.5),
    "matern32": lambda: Matern(1.0, "fixed", nu=1.5),
    "matern52": lambda: Matern(1.0, "fixed", nu=2.5),
    "rational_quadratic": lambda: RationalQuadratic(1.0, 0.7, "fixed", "fixed"),
}
UNITS = np.array([0.4, 0.6])


def theta_of(name):
    """Log hyperparameters: amplitude 1.3, lengthscales UNITS, shape 0.7, noise variance 0.04."""
    own = [0.7] * (len(as_kernel(name).hyperparameters) - 2)
    return np.log([1.3, *UNITS, *own, 0.04])


def data(n, seed=0):
    """Positions in scaled units, two of them equal, and observations."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (n, 2))
    x[n // 2] = x[0]
    return x, rng.normal(size=n)


def likelihoods(name, x, y):
    """Likelihood and gradient as functions of theta, by inference."""
    kernel = as_kernel(name)
    laplace = LaplaceInference(kernel, 4.0, 1e-6)
    vecchia = VecchiaInference(
        kernel, 1e-6, neighbours=6, block=3, prediction_neighbours=9, ordering="collected"
    )
    for inference in (laplace, vecchia):
        inference.set_data(np.ascontiguousarray(x.T), y)
    return {
        "exact": lambda theta: log_marginal_likelihood(x, y, theta, kernel=name),
        "laplace": laplace.lml_and_gradient,
        "vecchia": vecchia.lml_and_gradient,
    }


@pytest.mark.parametrize("name", sorted(TRUTH))
def test_values_likelihood_and_prediction_are_scikit_learns(name):
    kernel, truth, theta = as_kernel(name), TRUTH[name](), theta_of(name)
    (a, _), (b, _) = data(9), data(7, seed=1)
    constants = kernel.constants(theta[1:-1])
    values = [[kernel.correlation(constants, *p, *q) for q in b] for p in a]
    np.testing.assert_allclose(values, truth(a / UNITS, b / UNITS), rtol=1e-13)

    x, y = data(40)
    regressor = GaussianProcessRegressor(
        ConstantKernel(1.3**2, "fixed") * truth, alpha=0.04 + 1e-6, optimizer=None
    ).fit(x / UNITS, y)
    value, _ = log_marginal_likelihood(x, y, theta, kernel=name)
    assert value == pytest.approx(regressor.log_marginal_likelihood_value_, rel=1e-10)


@pytest.mark.parametrize("name", sorted(TRUTH))
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_model_predicts_as_scikit_learn(name, dtype):
    x, y = data(60)
    x[:2] = [-1.0, -1.0], [1.0, 1.0]  # scaled as they are
    y = (y - y.mean()) / y.std()
    own = {one.name: one for one in as_kernel(name).hyperparameters}
    model = GaussianProcess(
        x, y, kernel=name, amplitude=1.3, lengthscale=0.5, noise_variance=0.04, dtype=dtype
    )
    truth = TRUTH[name]()
    if "shape" in own:
        truth = RationalQuadratic(1.0, own["shape"].start, "fixed", "fixed")
    regressor = GaussianProcessRegressor(
        ConstantKernel(1.3**2, "fixed") * truth, alpha=0.04 + 1e-6, optimizer=None
    ).fit(x / 0.5, y)
    query, _ = data(20, seed=3)
    mean, std = regressor.predict(query / 0.5, return_std=True)
    close = {"float64": 1e-9, "float32": 1e-4}[dtype]
    np.testing.assert_allclose(model.predict(query), (mean, std), rtol=close, atol=close)


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("inference", ["exact", "laplace", "vecchia"])
def test_gradients_are_finite_differences(name, inference):
    x, y = data(24, seed=2)
    y[::8] += 4.0
    evaluate, theta = likelihoods(name, x, y)[inference], theta_of(name)
    _, gradient = evaluate(theta)
    assert gradient.shape == theta.shape
    for k, step in enumerate(1e-5 * np.eye(len(theta))):
        slope = (evaluate(theta + step)[0] - evaluate(theta - step)[0]) / 2e-5
        assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize(
    ("model", "optimizer"),
    [("gp", "adam"), ("gp", "lbfgs"), ("student_t", "adam"), ("vecchia", "lbfgs")],
)
def test_every_model_learns_with_every_kernel(name, model, optimizer):
    x, noise = data(40)
    x *= 25.0
    y = 100.0 + 30.0 * np.sin(x[:, 0] / 6.0) * np.cos(x[:, 1] / 9.0) + noise
    learner = MODELS[model](x, y, kernel=name, optimizer=optimizer)
    before = learner.log_marginal_likelihood
    learner.optimize(10)
    assert learner.log_marginal_likelihood > before
    names = [one.name for one in as_kernel(name).hyperparameters]
    assert list(vars(learner.hyperparameters)) == ["amplitude", *names, "noise_std"]
    mean, std = learner.predict(x[:5])
    assert np.abs(mean - y[:5]).max() < 30.0
    assert (std > 0.0).all()


@pytest.mark.parametrize("name", KERNELS)
def test_with_all_neighbours_the_nearest_ones_give_the_exact_process(name):
    x, y = data(30)
    exact, near = (
        model(x, y, kernel=name, noise_variance=0.1, **options)
        for model, options in ((GaussianProcess, {}), (VecchiaProcess, {"neighbours": 30}))
    )
    assert near.log_marginal_likelihood == pytest.approx(exact.log_marginal_likelihood, rel=1e-10)
    np.testing.assert_allclose(near.predict(x[:9]), exact.predict(x[:9]), rtol=1e-8)


def test_of_a_large_shape_the_rational_quadratic_is_the_gaussian():
    x, y = data(20)
    theta = np.log([1.3, 0.4, 0.6, 1e6, 0.04])
    value, gradient = log_marginal_likelihood(x, y, theta, kernel="rational_quadratic")
    expected, by_theta = log_marginal_likelihood(x, y, np.delete(theta, 3))
    assert value == pytest.approx(expected, rel=1e-5)
    np.testing.assert_allclose(np.delete(gradient, 3), by_theta, rtol=1e-4)
    assert abs(gradient[3]) < 1e-3


def gibbs_by_loops(a, b, units, growths):
    """Gibbs' kernel by its definition (Rasmussen & Williams, eq. 4.32), pair by pair."""

    def lengthscale(x, axis):
        x = [min(1.0, max(-1.0, x[0])), min(1.0, max(-1.0, x[1]))]
        return units[axis] * math.exp(
            x[0] * math.log(growths[0])
            + x[1] * math.log(growths[1])
            + (x[0] ** 2 + x[1] ** 2) * math.log(growths[2])
        )

    values = np.empty((len(a), len(b)))
    for i, p in enumerate(a):
        for j, q in enumerate(b):
            value = 1.0
            for axis in (0, 1):
                lp, lq = lengthscale(p, axis), lengthscale(q, axis)
                total = lp**2 + lq**2
                value *= math.sqrt(2.0 * lp * lq / total)
                value *= math.exp(-((p[axis] - q[axis]) ** 2) / total)
            values[i, j] = value
    return values


def test_gibbs_kernel_is_its_definition():
    growths = [0.6, 1.7, 1.4]
    (a, y), (b, _) = data(25), data(9, seed=1)
    a, b = 1.3 * a, 1.3 * b  # some beyond the pilot's box
    kernel, theta = as_kernel("gibbs"), np.log([1.3, *UNITS, *growths, 0.04])
    constants = kernel.constants(theta[1:-1])
    values = [[kernel.correlation(constants, *p, *q) for q in b] for p in a]
    np.testing.assert_allclose(values, gibbs_by_loops(a, b, UNITS, growths), rtol=1e-12)
    covariance = 1.3**2 * gibbs_by_loops(a, a, UNITS, growths) + (0.04 + 1e-6) * np.eye(25)
    expected = multivariate_normal(np.zeros(25), covariance).logpdf(y)
    assert log_marginal_likelihood(a, y, theta, kernel="gibbs")[0] == pytest.approx(expected)


def test_gibbs_kernel_starts_as_the_gaussian_and_learns_where_it_is_rough():
    rng = np.random.default_rng(5)
    x = rng.uniform(0.0, 50.0, (70, 2))
    y = np.sin((x[:, 0] / 16.0) ** 3) + 0.05 * rng.normal(size=70)
    gaussian, gibbs = (
        GaussianProcess(x, y, kernel=name, learning_rate=0.05) for name in (KERNELS[0], "gibbs")
    )
    assert gibbs.log_marginal_likelihood == pytest.approx(gaussian.log_marginal_likelihood)
    for model in (gaussian, gibbs):
        model.optimize(60)
    assert gibbs.log_marginal_likelihood > gaussian.log_marginal_likelihood + 5.0
    assert gibbs.hyperparameters.growth_1 < 0.7  # rougher to the east
