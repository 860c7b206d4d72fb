"""The robust and conjugate process against the formulas of its paper and data really left out."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial import KDTree

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, RobustConjugateProcess
from infoplan.model.inference.robust_conjugate import RobustConjugateInference, medians
from infoplan.model.kernels.squared_exponential import KERNEL

JITTER = 1e-6
THETA = np.log([1.3, 0.4, 0.7, 0.05])
QUERY = np.array([[0.0, 0.8, 2.5], [0.0, -0.4, 2.5]])


def covariance(a, b, theta):
    squares = (((a.T[:, None] - b.T) / np.exp(theta[1:3])) ** 2).sum(axis=-1)
    return np.exp(2 * theta[0]) * np.exp(-0.5 * squares)


def data(n=40, spikes=5, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (2, n))
    y = np.sin(3 * x[0]) + x[1] + 0.1 * rng.standard_normal(n)
    y[:spikes] += rng.choice([-1.0, 1.0], spikes) * rng.uniform(3, 8, spikes)
    return x, y


def inference(x, y, outlier_fraction=0.2, neighbours=None, weighted=False):
    made = RobustConjugateInference(
        KERNEL, JITTER, outlier_fraction=outlier_fraction, neighbours=neighbours, weighted=weighted
    )
    made.set_data(x, y)
    return made


def imq(y, centre, c, beta):
    return beta * (1 + (y - centre) ** 2 / c**2) ** -0.5


def posterior(x, y, centre, c, theta, query):
    """Proposition 3.1, the derivative of the log weight by differences; mean and variance."""
    noise = np.exp(theta[3])
    beta = np.sqrt(noise / 2)
    step = 1e-6
    slope = np.log(imq(y + step, centre, c, beta) ** 2 / imq(y - step, centre, c, beta) ** 2)
    shift = noise * slope / (2 * step)
    added = np.diag(noise * (noise / 2) * imq(y, centre, c, beta) ** -2.0 + JITTER)
    solved = np.linalg.solve(covariance(x, x, theta) + added, covariance(x, query, theta))
    variance = np.exp(2 * theta[0]) - np.sum(solved * covariance(x, query, theta), axis=0)
    return solved.T @ (y - shift), variance


def centres(x, y, neighbours):
    if neighbours is None:
        return np.zeros(len(y))
    _, near = KDTree(x.T).query(x.T, neighbours + 1)
    return np.median(y[near[:, 1:]], axis=1)


@pytest.mark.parametrize("neighbours", [None, 6])
def test_the_posterior_is_that_of_the_paper(neighbours):
    x, y = data()
    centre = centres(x, y, neighbours)
    c = np.quantile(np.abs(y - centre), 0.8)
    mean, variance = inference(x, y, neighbours=neighbours).predict(THETA, QUERY)
    expected_mean, expected_variance = posterior(x, y, centre, c, THETA, QUERY)
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-6)
    np.testing.assert_allclose(variance, expected_variance, rtol=1e-6)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("neighbours", [None, 6])
def test_the_criterion_is_the_density_of_data_that_are_left_out(neighbours, weighted):
    x, y = data()
    centre, noise = centres(x, y, neighbours), np.exp(THETA[3])
    c = np.quantile(np.abs(y - centre), 0.8)
    total = 0.0
    for i in range(len(y)):
        rest = np.delete(np.arange(len(y)), i)
        mean, variance = posterior(x[:, rest], y[rest], centre[rest], c, THETA, x[:, [i]])
        share = imq(y[i], centre[i], c, 1.0) ** 2 if weighted else 1.0
        total += share * stats.norm.logpdf(y[i], mean[0], np.sqrt(variance[0] + noise + JITTER))
    assert inference(x, y, 0.2, neighbours, weighted).lml(THETA) == pytest.approx(total, rel=1e-7)


@pytest.mark.parametrize("weighted", [False, True])
def test_the_gradient_equals_finite_differences(weighted):
    made = inference(*data(), neighbours=6, weighted=weighted)
    value, gradient = made.lml_and_gradient(THETA)
    assert value == made.lml(THETA)
    for k, step in enumerate(1e-5 * np.eye(4)):
        difference = (made.lml(THETA + step) - made.lml(THETA - step)) / 2e-5
        assert gradient[k] == pytest.approx(difference, rel=1e-5, abs=1e-5)


def test_the_centre_is_the_median_of_the_nearest_others_and_of_equally_near_ones():
    line = np.array([[0.0, 1.0, 2.0, 3.0], np.zeros(4)])
    values = np.array([0.0, 10.0, 1.0, 5.0])
    # At 1 the neighbours at 0 and 2 are equally near.
    np.testing.assert_array_equal(medians(line, values, 1), [10.0, 0.5, 7.5, 1.0])
    np.testing.assert_array_equal(medians(line, values, 99), [5.0, 1.0, 5.0, 1.0])
    assert medians(line[:, :1], values[:1], 5) == [0.0]


def test_a_far_outlier_moves_it_no_more_than_a_near_one():
    x, y = data(60, 0)
    x, moved = x.T, []
    for size in [3.0, 30.0, 3000.0]:
        models = [model(x, y) for model in (RobustConjugateProcess, GaussianProcess)]
        worse = np.append(y[:-1], y[-1] + size)
        before = [model.predict(x)[0] for model in models]
        for model in models:
            model.replace(x, worse)
        moved.append(
            [np.abs(model.predict(x)[0] - b).max() for model, b in zip(models, before, strict=True)]
        )
    robust, gaussian = np.array(moved).T
    assert max(robust) < 1.2 * min(robust)
    assert max(robust) < 0.2 * gaussian[1]
    assert gaussian[2] > 90 * gaussian[1] > 800 * gaussian[0]


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_it_learns(optimizer):
    x, y = data(60, 6)
    model = RobustConjugateProcess(x.T, y, optimizer=optimizer)
    before = model.log_marginal_likelihood
    model.optimize(30)
    assert model.log_marginal_likelihood > before


def test_data_that_cannot_be_conditioned_on_are_told():
    x, y = data(20, 0)
    with pytest.raises(RunError, match="robust conjugate Gaussian process cannot factorise"):
        RobustConjugateProcess(x.T, y, amplitude=1e200).optimize(1)


def test_without_data_the_prior_is_predicted():
    x, y = data(20, 0)
    model = RobustConjugateProcess(x.T, y)
    model.replace(np.empty((0, 2)), np.empty(0))
    mean, std = model.predict(np.zeros((1, 2)))
    assert (mean[0], std[0]) == (pytest.approx(y.mean()), pytest.approx(y.std()))
    assert model.log_marginal_likelihood == 0.0
    model.optimize(2)
