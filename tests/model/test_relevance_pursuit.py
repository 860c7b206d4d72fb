"""Relevance pursuit against its authors' implementation, SciPy's optimiser and differences."""

import warnings

import numpy as np
import pytest
from scipy import optimize, stats

from infoplan.model import GaussianProcess, RelevancePursuitProcess
from infoplan.model.inference.pursuit import pursue
from infoplan.model.inference.relevance import RelevanceInference
from infoplan.model.kernels.squared_exponential import KERNEL

JITTER = 1e-6
THETA = np.log([1.3, 0.4, 0.7, 0.02])
QUERY = np.array([[0.1, 0.2], [-0.7, 0.4], [0.9, -0.9]])


def data(n=50, spikes=6, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (2, n))
    y = np.sin(3 * x[0]) + x[1] + 0.1 * rng.standard_normal(n)
    y[:spikes] += rng.choice([-1.0, 1.0], spikes) * rng.uniform(2, 6, spikes)
    return x, y


def covariance(a, b):
    squares = (((a.T[:, None] - b.T) / np.exp(THETA[1:3])) ** 2).sum(axis=-1)
    return np.exp(2 * THETA[0]) * np.exp(-0.5 * squares)


def of_observations(x):
    return covariance(x, x) + (np.exp(THETA[3]) + JITTER) * np.eye(x.shape[1])


def log_likelihood(a, y):
    return stats.multivariate_normal(cov=a).logpdf(y)


def test_the_variances_are_those_of_the_authors_implementation():
    torch = pytest.importorskip("torch")
    pytest.importorskip("botorch")
    warnings.simplefilter("ignore")
    from botorch.models import SingleTaskGP
    from botorch.models.likelihoods.sparse_outlier_noise import SparseOutlierGaussianLikelihood
    from gpytorch.kernels import RBFKernel, ScaleKernel
    from gpytorch.likelihoods.noise_models import HomoskedasticNoise
    from gpytorch.means import ZeroMean
    from gpytorch.mlls import ExactMarginalLogLikelihood

    x, y = data()
    noise = HomoskedasticNoise().double()
    noise.noise = np.exp(THETA[3]) + JITTER
    likelihood = SparseOutlierGaussianLikelihood(base_noise=noise, dim=len(y)).double()
    kernel = ScaleKernel(RBFKernel(ard_num_dims=2)).double()
    kernel.outputscale = np.exp(2 * THETA[0])
    kernel.base_kernel.lengthscale = torch.tensor(np.exp(THETA[1:3]))
    for fixed in [*noise.parameters(), *kernel.parameters()]:
        fixed.requires_grad_(False)
    model = SingleTaskGP(
        torch.tensor(x.T), torch.tensor(y[:, None]), likelihood=likelihood, covar_module=kernel,
        mean_module=ZeroMean(), outcome_transform=None,
    )  # fmt: skip
    mll = ExactMarginalLogLikelihood(model.likelihood, model)
    module = likelihood.noise_covar
    for more in (2, 3, 4):
        assert module.support_expansion(mll, more)
        module.optimize_mll(mll)
    # They count rho in variances of an observation without it.
    found = of_observations(x)[0, 0] * module.rho.detach().numpy()
    rho = pursue(np.linalg.inv(of_observations(x)), y, [2, 5, 9], np.inf)
    assert (rho > 0).sum() >= 6
    np.testing.assert_allclose(rho, found, rtol=1e-3, atol=1e-4)


def test_the_variances_maximise_the_likelihood_of_their_support():
    x, y = data()
    a = of_observations(x)
    rho = pursue(np.linalg.inv(a), y, [8], np.inf)
    support = np.flatnonzero(rho)
    assert len(set(range(6)) & set(support)) >= 5

    def worth(values):
        more = np.zeros(len(y))
        more[support] = values
        return -log_likelihood(a + np.diag(more), y)

    best = optimize.minimize(worth, np.ones(len(support)), bounds=[(0, None)] * len(support))
    assert worth(rho[support]) <= best.fun + 1e-6
    np.testing.assert_allclose(rho[support], best.x, rtol=0.1)


def test_the_size_is_the_one_before_the_posterior_falls():
    x, y = data()
    a, sizes = of_observations(x), [1, 3, 5, 8]
    chosen = set()
    for mean in (0.004, 0.01, 10.0):
        tried = [np.zeros(len(y))]
        score = [log_likelihood(a, y)]
        for count, size in enumerate(sizes, start=1):
            tried.append(pursue(np.linalg.inv(a), y, sizes[:count], np.inf))
            score.append(log_likelihood(a + np.diag(tried[-1]), y) - size / mean)
        falls = np.flatnonzero(np.diff(score) < 0)
        best = int(falls[0]) if falls.size else len(sizes)
        chosen.add(best)
        np.testing.assert_allclose(pursue(np.linalg.inv(a), y, sizes, mean), tried[best])
    assert len(chosen) > 1
    assert not pursue(np.linalg.inv(a), y, sizes, 1e-6).any()


def test_prediction_and_likelihood_are_those_of_the_variances_found():
    x, y = data()
    made = RelevanceInference(KERNEL, JITTER, fractions=[0.1, 0.2], outlier_fraction=0.2)
    made.set_data(x, y)
    a = of_observations(x)
    a += np.diag(pursue(np.linalg.inv(a), y, [5, 10], 10.0))
    cross = covariance(QUERY.T, x)
    mean, variance = made.predict(THETA, np.ascontiguousarray(QUERY.T))
    np.testing.assert_allclose(mean, cross @ np.linalg.solve(a, y), rtol=1e-6)
    expected = np.exp(2 * THETA[0]) - np.sum(cross.T * np.linalg.solve(a, cross.T), axis=0)
    np.testing.assert_allclose(variance, expected, rtol=1e-6)
    value, gradient = made.lml_and_gradient(THETA)
    assert value == pytest.approx(log_likelihood(a, y), rel=1e-8)
    for k, step in enumerate(1e-5 * np.eye(4)):
        difference = (made.lml(THETA + step) - made.lml(THETA - step)) / 2e-5
        assert gradient[k] == pytest.approx(difference, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_outliers_do_not_move_it(optimizer):
    x, y = data(60, 0)
    worse = y.copy()
    worse[::8] += 30.0
    sound = GaussianProcess(x.T, y, noise_variance=0.05)
    model = RelevancePursuitProcess(x.T, y, noise_variance=0.05, optimizer=optimizer)
    gaussian = GaussianProcess(x.T, y, noise_variance=0.05, optimizer=optimizer)
    for one in (model, gaussian):
        one.replace(x.T, worse)
        one.optimize(15)
    truth = sound.predict(QUERY)[0]
    assert np.abs(model.predict(QUERY)[0] - truth).max() < 0.4
    assert np.abs(gaussian.predict(QUERY)[0] - truth).max() > 0.6


def test_without_data_the_prior_is_predicted():
    x, y = data(20, 0)
    model = RelevancePursuitProcess(x.T, y)
    for n in (1, 0):
        model.replace(x.T[:n], y[:n])
        model.optimize(2)
        assert np.isfinite(model.predict(QUERY)[0]).all()
    assert model.log_marginal_likelihood == 0.0
