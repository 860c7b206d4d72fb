"""Kernels beside the built-in one, through the seam: one hyperparameter more, and two places."""

import math

import numba
import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, RationalQuadratic

from infoplan.config import KERNELS, METHODS
from infoplan.detect.evidence import Evidence
from infoplan.detect.gp_residual import gp_residual
from infoplan.errors import RunError
from infoplan.model import (
    GaussianProcess,
    Hyperparameter,
    Kernel,
    StudentTProcess,
    log_marginal_likelihood,
)
from infoplan.model.inference.laplace import LaplaceInference
from infoplan.model.kernels import as_kernel


@numba.njit
def rational_quadratic(constants, a1, a2, b1, b2):
    s = constants[0] * (a1 - b1) ** 2 + constants[1] * (a2 - b2) ** 2
    return (1.0 + s / constants[2]) ** -constants[2]


@numba.njit
def rational_quadratic_gradient(weight, constants, a1, a2, b1, b2):
    s1, s2 = constants[0] * (a1 - b1) ** 2, constants[1] * (a2 - b2) ** 2
    shape, base = constants[2], 1.0 + (s1 + s2) / constants[2]
    c = weight * base**-shape
    by_shape = shape * ((base - 1.0) / base - math.log(base))
    return c, 2.0 * c * s1 / base, 2.0 * c * s2 / base, c * by_shape


# The rational quadratic with a lengthscale an axis: theta has five entries.
RATIONAL = Kernel(
    hyperparameters=(
        Hyperparameter("lengthscale_1", flat=10.0),
        Hyperparameter("lengthscale_2", flat=10.0),
        Hyperparameter("shape", start=2.0, lower=0.5, upper=3.0),
    ),
    constants=lambda theta: (*(0.5 * np.exp(-2.0 * theta[:2])).tolist(), math.exp(theta[2])),
    correlation=rational_quadratic,
    gradient=rational_quadratic_gradient,
    reference=lambda h: RationalQuadratic(h["lengthscale_1"], h["shape"]),
)


@numba.njit
def gibbs(constants, a1, a2, b1, b2):
    la, lb = constants[0] * math.exp(constants[1] * a1), constants[0] * math.exp(constants[1] * b1)
    total = la**2 + lb**2
    return 2.0 * la * lb / total * math.exp(-((a1 - b1) ** 2 + (a2 - b2) ** 2) / total)


@numba.njit
def gibbs_gradient(weight, constants, a1, a2, b1, b2):
    slope = constants[1]
    la, lb = constants[0] * math.exp(slope * a1), constants[0] * math.exp(slope * b1)
    total, square = la**2 + lb**2, (a1 - b1) ** 2 + (a2 - b2) ** 2
    c = weight * gibbs(constants, a1, a2, b1, b2)
    change = 2.0 * slope * (la**2 * a1 + lb**2 * b1)
    by_slope = slope * (a1 + b1) - change / total + square * change / total**2
    return c, 2.0 * c * square / total, c * by_slope


# Gibbs' kernel: its lengthscale grows along the first axis.
GIBBS = Kernel(
    hyperparameters=(Hyperparameter("lengthscale"), Hyperparameter("slope", start=0.5)),
    constants=lambda theta: (math.exp(theta[0]), math.exp(theta[1])),
    correlation=gibbs,
    gradient=gibbs_gradient,
    reference=lambda h: None,
)


def samples(n, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0.0, 50.0, (n, 2))
    return x, 100.0 + 30.0 * np.sin(x[:, 0] / 6.0) * np.cos(x[:, 1] / 9.0) + rng.normal(size=n)


def dense(kernel, theta, a, b):
    """Evaluate a kernel pair by pair."""
    constants = kernel.constants(np.asarray(theta))
    return np.array([[kernel.correlation(constants, *p, *q) for q in b] for p in a])


def test_a_kernel_of_one_hyperparameter_more_equals_scikit_learns():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-1, 1, (30, 2)), rng.normal(size=30)
    reference = ConstantKernel(1.3**2) * RATIONAL.reference({"lengthscale_1": 0.4, "shape": 1.7})
    regressor = GaussianProcessRegressor(reference, alpha=0.04 + 1e-6, optimizer=None).fit(x, y)
    expected, by_theta = regressor.log_marginal_likelihood(
        regressor.kernel_.theta, eval_gradient=True
    )
    theta = np.log([1.3, 0.4, 0.4, 1.7, 0.04])
    value, gradient = log_marginal_likelihood(x, y, theta, kernel=RATIONAL)
    assert value == pytest.approx(expected, rel=1e-10)
    # scikit-learn derives by log alpha^2, log shape and one lengthscale.
    ours = [gradient[0] / 2.0, gradient[3], gradient[1] + gradient[2]]
    np.testing.assert_allclose(ours, by_theta, rtol=1e-8)


@pytest.mark.parametrize("kernel", [RATIONAL, GIBBS])
@pytest.mark.parametrize("n", [2, 25, 40])
def test_the_gradient_equals_finite_differences(kernel, n):
    rng = np.random.default_rng(n)
    x, y = rng.uniform(-1, 1, (n, 2)), rng.normal(size=n)
    theta = np.log([1.2, *rng.uniform(0.3, 1.5, len(kernel.hyperparameters)), 0.1])
    _, gradient = log_marginal_likelihood(x, y, theta, kernel=kernel)
    assert gradient.shape == theta.shape
    for k, step in enumerate(1e-5 * np.eye(len(theta))):
        above, _ = log_marginal_likelihood(x, y, theta + step, kernel=kernel)
        below, _ = log_marginal_likelihood(x, y, theta - step, kernel=kernel)
        assert gradient[k] == pytest.approx((above - below) / 2e-5, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("kernel", [RATIONAL, GIBBS])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_learning_and_prediction_are_those_of_the_kernel(kernel, dtype, optimizer):
    x, y = samples(60)
    gp = GaussianProcess(x, y, kernel=kernel, dtype=dtype, optimizer=optimizer)
    before = gp.log_marginal_likelihood
    gp.optimize(20)
    assert gp.log_marginal_likelihood > before
    gp.append(*samples(21, seed=1))
    x, y = (np.concatenate(parts) for parts in zip(samples(60), samples(21, seed=1), strict=True))
    h = vars(gp.hyperparameters)
    names = [one.name for one in kernel.hyperparameters]
    assert list(h) == ["amplitude", *names, "noise_std"]

    low, high = samples(60)[0].min(axis=0), samples(60)[0].max(axis=0)
    pilot = samples(60)[1]
    scaled, targets = 2.0 * (x - low) / (high - low) - 1.0, (y - pilot.mean()) / pilot.std()
    query = 2.0 * (x[:7] + 0.5 - low) / (high - low) - 1.0
    theta = np.log([h[name] for name in names])
    noise = h["noise_std"] ** 2 + gp.jitter
    covariance = h["amplitude"] ** 2 * dense(kernel, theta, scaled, scaled)
    inverse = np.linalg.inv(covariance + noise * np.eye(81))
    cross = h["amplitude"] ** 2 * dense(kernel, theta, query, scaled)
    variance = h["amplitude"] ** 2 - np.einsum("ij,jk,ik->i", cross, inverse, cross)
    close = 1e-7 if dtype == "float64" else 2e-2
    mean, std = gp.predict(x[:7] + 0.5)
    np.testing.assert_allclose(mean, pilot.mean() + pilot.std() * (cross @ inverse @ targets),
                               rtol=close)  # fmt: skip
    np.testing.assert_allclose(std, pilot.std() * np.sqrt(variance), rtol=close)
    weights, precision = gp.weights_and_inverse(x, y, np.arange(len(y)))
    np.testing.assert_allclose(precision, inverse, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(weights, inverse @ targets, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_bounds_are_the_kernels(optimizer):
    x, y = samples(50)
    gp = GaussianProcess(x, y, kernel=RATIONAL, optimizer=optimizer, learning_rate=0.5)
    gp.optimize(40)
    assert 0.5 * (1 - 1e-12) <= gp.hyperparameters.shape <= 3.0 * (1 + 1e-12)


@pytest.mark.parametrize("kernel", [RATIONAL, GIBBS])
def test_the_gradient_under_student_t_noise_equals_finite_differences(kernel):
    rng = np.random.default_rng(8)
    x, y = rng.uniform(-1, 1, (2, 30)), rng.normal(size=30)
    y[::10] += 5.0
    inference = LaplaceInference(kernel, 4.0, 1e-6)
    inference.set_data(x, y)
    theta = np.log([1.2, *rng.uniform(0.4, 1.5, len(kernel.hyperparameters)), 0.1])
    _, gradient = inference.lml_and_gradient(theta)
    for k, step in enumerate(1e-5 * np.eye(len(theta))):
        above, below = inference.lml(theta + step), inference.lml(theta - step)
        assert gradient[k] == pytest.approx((above - below) / 2e-5, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_student_t_noise_learns_with_any_kernel(optimizer):
    x, y = samples(50)
    model = StudentTProcess(x, y, kernel=RATIONAL, optimizer=optimizer)
    before = model.log_marginal_likelihood
    model.optimize(25)
    assert model.log_marginal_likelihood > before
    assert list(vars(model.hyperparameters)) == [
        "amplitude", "lengthscale_1", "lengthscale_2", "shape", "noise_std",
    ]  # fmt: skip


def test_an_outlier_is_found_by_its_residual_under_any_kernel():
    x, y = samples(60)
    gp = GaussianProcess(x, y, kernel=GIBBS)
    gp.optimize(200)
    x, y = samples(80, seed=5)
    y[70] += 500.0
    n = len(y)
    judged = np.arange(n) >= 60
    evidence = Evidence(x, y, np.where(judged, 1, 0), np.zeros(n, bool), judged, np.zeros(n, bool))
    flagged, _ = gp_residual(evidence, gp, np.random.default_rng(0))
    assert np.flatnonzero(flagged).tolist() == [70]


def test_a_failed_factorisation_names_the_kernels_hyperparameters():
    x, y = samples(20)
    with pytest.raises(RunError, match=r"amplitude 1e\+200, lengthscale 0\.5, slope 0\.5 and"):
        GaussianProcess(x, y, kernel=GIBBS, amplitude=1e200).optimize(1)


@pytest.mark.parametrize("name", KERNELS)
def test_every_choice_is_a_kernel_that_agrees_with_its_reference(name):
    kernel = as_kernel(name)
    values = np.linspace(0.3, 0.8, len(kernel.hyperparameters))
    named = dict(zip([one.name for one in kernel.hyperparameters], values, strict=True))
    a, b = np.random.default_rng(1).uniform(-1, 1, (2, 9, 2))
    np.testing.assert_allclose(
        dense(kernel, np.log(values), a, b), kernel.reference(named)(a, b), rtol=1e-12
    )


def test_the_models_of_missions_have_the_kernel_by_name():
    x, y = samples(30)
    for name, model in {"gp": GaussianProcess, "student_t": StudentTProcess}.items():
        chosen = model(x, y, kernel=METHODS["model"][name].kernel)
        assert chosen.log_marginal_likelihood == model(x, y).log_marginal_likelihood
