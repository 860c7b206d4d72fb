"""The Student-t process against numerical integration, SciPy, and the Gaussian process."""

import itertools

import numpy as np
import pytest
from scipy import optimize, stats

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, StudentTProcess
from infoplan.model.inference.laplace import LaplaceInference
from infoplan.model.kernels.squared_exponential import KERNEL

JITTER = 1e-6


def covariance(a, b, theta):
    alpha, lengthscales = np.exp(theta[0]), np.exp(theta[1:3])
    squares = (((a[:, None] - b) / lengthscales) ** 2).sum(axis=-1)
    return alpha**2 * np.exp(-0.5 * squares)


def data(n, spikes, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (n, 2))
    y = np.sin(3 * x[:, 0]) + x[:, 1] + 0.1 * rng.standard_normal(n)
    y[:spikes] += rng.choice([-1.0, 1.0], spikes) * rng.uniform(3, 8, spikes)
    return x, y


def likelihood(x, y, dof=4.0):
    made = LaplaceInference(KERNEL, dof, JITTER)
    made.set_data(np.ascontiguousarray(x.T), y)
    return made


def log_joint(latent, x, y, theta, dof):
    """Log density of observations and latent values, by SciPy."""
    prior = stats.multivariate_normal(cov=covariance(x, x, theta) + JITTER * np.eye(len(y)))
    return prior.logpdf(latent) + stats.t.logpdf(y, dof, latent, np.exp(theta[3] / 2)).sum(axis=-1)


def integrated(x, y, theta, dof, query):
    """Log marginal likelihood, mean and deviation at `query` by a sum over a fine grid."""
    k = covariance(x, x, theta) + JITTER * np.eye(len(y))
    half = 6 * np.sqrt(k[0, 0])
    axis = np.linspace(-half, half, 801 if len(y) == 2 else 121)
    latent = np.stack(np.meshgrid(*[axis] * len(y), indexing="ij"), axis=-1).reshape(-1, len(y))
    density = np.exp(log_joint(latent, x, y, theta, dof))
    evidence = density.sum() * (axis[1] - axis[0]) ** len(y)
    cross = covariance(query, x, theta)
    weights = np.linalg.solve(k, cross.T)
    means = latent @ weights
    share = density / density.sum()
    mean = share @ means
    rest = covariance(query, query, theta).diagonal() - np.sum(cross.T * weights, axis=0)
    return np.log(evidence), mean, np.sqrt(rest + share @ (means - mean) ** 2)


QUERY = np.array([[0.0, 0.0], [0.8, -0.4], [2.5, 2.5]])


@pytest.mark.parametrize(("dof", "allowed"), [(3.0, 0.5), (6.0, 0.3), (30.0, 0.1)])
@pytest.mark.parametrize("spikes", [0, 1])
@pytest.mark.parametrize("n", [2, 3])
def test_laplace_comes_near_the_integral(n, spikes, dof, allowed):
    x, y = data(n, spikes, seed=n)
    theta = np.log([1.2, 0.8, 1.1, 0.05])
    made = likelihood(x, y, dof)
    evidence, mean, std = integrated(x, y, theta, dof, QUERY)
    assert made.lml(theta) == pytest.approx(evidence, abs=allowed)
    found, variance = made.predict(theta, QUERY.T.copy())
    np.testing.assert_allclose(found, mean, atol=0.08)
    np.testing.assert_allclose(np.sqrt(variance), std, rtol=0.1)


@pytest.mark.parametrize(("n", "spikes"), [(1, 0), (6, 0), (8, 2), (12, 5)])
def test_value_and_prediction_are_laplace_s(n, spikes):
    """Mode by SciPy's minimiser, curvature by differences of the joint density."""
    x, y = data(n, spikes)
    theta, dof = np.log([1.3, 0.7, 0.9, 0.1]), 4.0
    k = covariance(x, x, theta) + JITTER * np.eye(n)
    root = np.linalg.cholesky(k)
    whitened = optimize.minimize(
        lambda v: -log_joint(root @ v, x, y, theta, dof), np.linalg.solve(root, 0.5 * y), tol=1e-12
    )
    latent = root @ whitened.x

    def slope(f):
        r = y - f
        return (dof + 1) * r / (dof * np.exp(theta[3]) + r**2)

    step = 1e-5
    w = -(slope(latent + step) - slope(latent - step)) / (2 * step)
    assert (w < 0).sum() == spikes
    _, log_determinant = np.linalg.slogdet(np.eye(n) + k * w)
    prior = -0.5 * latent @ np.linalg.solve(k, latent)
    density = stats.t.logpdf(y, dof, latent, np.exp(theta[3] / 2)).sum()
    made = likelihood(x, y)
    assert made.lml(theta) == pytest.approx(prior + density - 0.5 * log_determinant, abs=1e-5)
    cross = covariance(QUERY, x, theta)
    posterior = np.linalg.inv(np.linalg.inv(k) + np.diag(w))
    inward = np.linalg.solve(k, cross.T)
    prior_variance = covariance(QUERY, QUERY, theta).diagonal()
    variance = prior_variance + np.sum(inward * ((posterior - k) @ inward), axis=0)
    found = made.predict(theta, QUERY.T.copy())
    np.testing.assert_allclose(found[0], cross @ np.linalg.solve(k, latent), atol=1e-4)
    np.testing.assert_allclose(found[1], variance, atol=1e-4)


@pytest.mark.parametrize("theta", [[1, 0.5, 0.5, 0.02], [2, 0.3, 0.8, 0.3], [1, 0.05, 0.05, 1e-3]])
@pytest.mark.parametrize(("n", "spikes"), [(1, 0), (5, 1), (60, 20)])
def test_gradient_against_differences(n, spikes, theta):
    made, theta, step = likelihood(*data(n, spikes)), np.log(theta), 1e-5
    gradient = made.lml_and_gradient(theta)[1]
    for i in range(4):
        aside = step * np.eye(4)[i]
        expected = (made.lml(theta + aside) - made.lml(theta - aside)) / (2 * step)
        assert gradient[i] == pytest.approx(expected, rel=1e-5, abs=1e-5)


def field(n=60, spikes=0):
    rng = np.random.default_rng(3)
    x = rng.uniform(0, 20, (n, 2))
    y = 100 * np.sin(x[:, 0] / 4) + 40 * np.cos(x[:, 1] / 5) + rng.standard_normal(n)
    y[n - spikes :] += 600.0
    return x, y


def test_many_degrees_of_freedom_give_the_gaussian_process():
    x, y = field()
    made = [GaussianProcess(x[:40], y[:40]), StudentTProcess(x[:40], y[:40], dof=1e8)]
    for model in made:
        model.optimize(30)
        model.append(x[40:], y[40:])
        model.optimize(3)
    for name in ("amplitude", "lengthscale_1", "lengthscale_2", "noise_std"):
        values = [getattr(model.hyperparameters, name) for model in made]
        assert values[1] == pytest.approx(values[0], rel=1e-5)
    gaussian, student = made
    assert student.log_marginal_likelihood == pytest.approx(
        gaussian.log_marginal_likelihood, rel=1e-5
    )
    assert student.observation_noise_std == pytest.approx(gaussian.observation_noise_std, rel=1e-5)
    query = np.random.default_rng(0).uniform(-3, 23, (30, 2))
    for noisy in (False, True):
        for a, b in zip(*(m.predict(query, noisy=noisy) for m in made), strict=True):
            np.testing.assert_allclose(b, a, rtol=1e-4, atol=1e-3)


def test_the_likelihood_approaches_the_gaussian_one_as_the_tails_thin_out():
    x, y = data(40, 2)
    theta = np.log([1.0, 0.5, 0.5, 0.1])
    k = covariance(x, x, theta) + (0.1 + JITTER) * np.eye(40)
    gaussian = stats.multivariate_normal(cov=k).logpdf(y)
    away = [abs(likelihood(x, y, dof).lml(theta) - gaussian) for dof in (1e2, 1e4, 1e6, 1e8)]
    assert all(later < earlier / 20 for earlier, later in itertools.pairwise(away))


def test_an_outlier_hardly_moves_the_prediction():
    x, y = field()
    spiked = y.copy()
    spiked[20] += 900.0
    moved = {}
    for kind in (GaussianProcess, StudentTProcess):
        means = []
        for values in (y, spiked):
            model = kind(x[:15], y[:15], noise_variance=0.01)
            model.append(x[15:], values[15:])
            means.append(model.predict(x[20:21])[0][0])
        moved[kind] = abs(means[1] - means[0])
    assert moved[StudentTProcess] < 0.02 * moved[GaussianProcess]
    assert moved[GaussianProcess] > 200


def test_the_mode_does_not_depend_on_the_way_to_it():
    x, y = field(80, spikes=6)
    at_once = StudentTProcess(x[:30], y[:30])
    at_once.optimize(40)
    at_once.append(x[30:], y[30:])
    step_by_step = StudentTProcess(x[:30], y[:30])
    step_by_step.optimize(40)
    for start in range(30, 80, 10):
        step_by_step.append(x[start : start + 10], y[start : start + 10])
        step_by_step.predict(x)
    again = StudentTProcess(x[:30], y[:30])
    again.optimize(40)
    again.replace(x, y)
    for other in (step_by_step, again):
        assert other.log_marginal_likelihood == pytest.approx(at_once.log_marginal_likelihood)
        np.testing.assert_allclose(other.predict(x), at_once.predict(x), rtol=1e-6)


def test_learning_raises_the_likelihood_and_keeps_the_floor():
    x, y = field(60, spikes=3)
    for optimizer in ("adam", "lbfgs"):
        model = StudentTProcess(x, y, optimizer=optimizer, min_noise_variance=0.3)
        before = model.log_marginal_likelihood
        model.optimize(60)
        assert model.log_marginal_likelihood > before + 10
        assert model.hyperparameters.noise_std**2 >= 0.3 * (1 - 1e-12)
        assert model.n_data == 60


def test_noisy_predictions_have_the_variance_of_the_t_distribution():
    x, y = field()
    model = StudentTProcess(x, y, dof=5.0, noise_variance=0.04)
    latent, noisy = model.predict(x)[1], model.predict(x, noisy=True)[1]
    scale = y.std() * 0.2
    expected = stats.t.std(5.0, scale=scale)
    assert model.observation_noise_std == pytest.approx(expected)
    np.testing.assert_allclose(noisy**2 - latent**2, expected**2)


def test_repeated_positions_and_no_jitter_are_no_obstacle():
    x, y = field()
    model = StudentTProcess(x, y, jitter=0.0)
    model.append(np.repeat(x[:5], 3, axis=0), np.repeat(y[:5], 3) + 500.0)
    mean, std = model.predict(x)
    assert np.isfinite(mean).all()
    assert (std > 0).all()
    assert model.jitter > 0


def test_without_data_the_prior_is_left():
    x, y = field()
    model = StudentTProcess(x, y, amplitude=2.0)
    model.replace(np.empty((0, 2)), np.empty(0))
    model.optimize(3)
    mean, std = model.predict(x[:4])
    np.testing.assert_allclose(mean, y.mean())
    np.testing.assert_allclose(std, 2.0 * y.std())
    assert model.log_marginal_likelihood == 0.0


def test_measurements_beyond_all_measure_are_refused():
    x, y = field()
    model = StudentTProcess(x, y)
    model.append(x[:1], np.array([1e200]))
    with pytest.raises(RunError, match="cannot factorise"):
        model.predict(x)
