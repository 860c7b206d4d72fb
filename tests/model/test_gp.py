"""The regression against scikit-learn, finite differences and a reference optimiser."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, log_marginal_likelihood

START = {"amplitude": 1.0, "lengthscale": 0.5, "noise_variance": 1.0}


def surface(x):
    """Evaluate a smooth map in workspace units, far from zero mean and unit variance."""
    return 3000.0 + 400.0 * np.sin(x[:, 0] / 6.0) * np.cos(x[:, 1] / 9.0) + 12.0 * x[:, 1]


def samples(n, seed=0, noise=5.0):
    """Noisy measurements at random places of a 50 x 30 workspace."""
    rng = np.random.default_rng(seed)
    x = rng.uniform([0.0, 10.0], [50.0, 40.0], (n, 2))
    return x, surface(x) + noise * rng.normal(size=n)


def scaled(x_pilot, y_pilot, x, y):
    """Scale data as the pilot defines, written out."""
    low, high = x_pilot.min(axis=0), x_pilot.max(axis=0)
    return -1.0 + 2.0 * (x - low) / (high - low), (y - np.mean(y_pilot)) / np.std(y_pilot)


def sklearn_regressor(hyperparameters, jitter=1e-6):
    """Build scikit-learn's regressor with the same, fixed hyperparameters."""
    h = hyperparameters
    kernel = ConstantKernel(h.amplitude**2) * RBF([h.lengthscale_1, h.lengthscale_2])
    alpha = h.noise_std**2 + jitter
    return GaussianProcessRegressor(kernel, alpha=alpha, optimizer=None)


def reference_theta(hyperparameters):
    h = hyperparameters
    return np.log([h.amplitude, h.lengthscale_1, h.lengthscale_2, h.noise_std**2])


# Odd and even sizes have different packed layouts; 1 and 2 are their smallest.
@pytest.mark.parametrize("n", [1, 2, 3, 40, 61])
def test_likelihood_and_gradient_equal_sklearn(n):
    rng = np.random.default_rng(n)
    x, y = rng.uniform(-1, 1, (n, 2)), rng.normal(size=n)
    h = SimpleNamespace(amplitude=1.3, lengthscale_1=0.4, lengthscale_2=0.7, noise_std=0.2)
    regressor = sklearn_regressor(h).fit(x, y)
    expected, by_kernel = regressor.log_marginal_likelihood(
        regressor.kernel_.theta, eval_gradient=True
    )

    value, gradient = log_marginal_likelihood(x, y, reference_theta(h))

    assert value == pytest.approx(expected, rel=1e-10)
    # scikit-learn derives by log alpha^2.
    np.testing.assert_allclose(gradient[:3], by_kernel * [2.0, 1.0, 1.0], rtol=1e-8, atol=1e-8 * n)


log_values = st.floats(-2.0, 1.0)


@settings(max_examples=40, deadline=None)
@given(st.tuples(log_values, log_values, log_values, st.floats(-5.0, 1.0)), st.integers(2, 30))
def test_gradient_equals_finite_differences(theta, n):
    rng = np.random.default_rng(n)
    x, y = rng.uniform(-1, 1, (n, 2)), rng.normal(size=n)
    theta = np.array(theta)

    _, gradient = log_marginal_likelihood(x, y, theta)

    for k, step in enumerate(1e-5 * np.eye(4)):
        above, _ = log_marginal_likelihood(x, y, theta + step)
        below, _ = log_marginal_likelihood(x, y, theta - step)
        assert gradient[k] == pytest.approx((above - below) / 2e-5, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("n", [30, 121])
def test_prediction_equals_sklearn_inside_and_outside_the_pilot_box(n):
    x, y = samples(n)
    gp = GaussianProcess(x, y)
    gp.optimize(60)
    # More queries than one block, reaching far out of the box.
    query = np.random.default_rng(5).uniform([-20.0, -10.0], [70.0, 60.0], (1100, 2))
    query_scaled, _ = scaled(x, y, query, y)
    mean, std = (
        sklearn_regressor(gp.hyperparameters)
        .fit(*scaled(x, y, x, y))
        .predict(query_scaled, return_std=True)
    )

    got_mean, got_std = gp.predict(query)

    assert np.abs(query_scaled).max() > 1.5
    np.testing.assert_allclose(got_mean, y.mean() + y.std() * mean, rtol=1e-8)
    np.testing.assert_allclose(got_std, y.std() * std, rtol=1e-7)


def test_likelihood_of_the_model_is_that_of_its_scaled_data():
    x, y = samples(50)
    more_x, more_y = samples(9, seed=1)
    gp = GaussianProcess(x, y)
    gp.optimize(20)
    gp.append(more_x, more_y)
    all_x, all_y = np.concatenate([x, more_x]), np.concatenate([y, more_y])
    regressor = sklearn_regressor(gp.hyperparameters).fit(*scaled(x, y, all_x, all_y))
    expected = regressor.log_marginal_likelihood_value_

    assert gp.log_marginal_likelihood == pytest.approx(expected, rel=1e-10)
    assert gp.n_data == 59


def test_noisy_std_adds_the_noise_and_not_the_jitter():
    x, y = samples(40)
    gp = GaussianProcess(x, y, jitter=0.1, noise_variance=0.3)
    mean, latent = gp.predict(x[:7])
    noisy_mean, noisy = gp.predict(x[:7], noisy=True)

    np.testing.assert_array_equal(mean, noisy_mean)
    np.testing.assert_allclose(noisy**2, latent**2 + 0.3 * y.std() ** 2, rtol=1e-12)


def test_start_values_are_the_ones_given():
    x, y = samples(20)
    gp = GaussianProcess(x, y, amplitude=2.0, lengthscale=0.25, noise_variance=0.09)
    h = gp.hyperparameters
    np.testing.assert_allclose(
        [h.amplitude, h.lengthscale_1, h.lengthscale_2, h.noise_std], [2.0, 0.25, 0.25, 0.3]
    )


def dense_gradient(x, y, theta, jitter=1e-6):
    """Gradient of the log marginal likelihood with dense NumPy matrices (R & W, eq. 5.9)."""
    amplitude, l1, l2, noise = np.exp(theta)
    d1 = ((x[:, None, 0] - x[None, :, 0]) / l1) ** 2
    d2 = ((x[:, None, 1] - x[None, :, 1]) / l2) ** 2
    k = amplitude**2 * np.exp(-0.5 * (d1 + d2))
    identity = np.eye(len(y))
    inverse = np.linalg.inv(k + (noise + jitter) * identity)
    w = inverse @ y
    outer = np.outer(w, w) - inverse
    return np.array([0.5 * np.sum(outer * d) for d in (2 * k, k * d1, k * d2, noise * identity)])


def reference_adam(theta, data, counts, learning_rate, floor):
    """Adam as in Kingma and Ba, its state kept while the data grow."""
    m, v, t = np.zeros(4), np.zeros(4), 0
    for (x, y), count in zip(data, counts, strict=True):
        for _ in range(count):
            g = -dense_gradient(x, y, theta)
            t += 1
            m = 0.9 * m + 0.1 * g
            v = 0.999 * v + 0.001 * g * g
            step = learning_rate * (m / (1 - 0.9**t)) / (np.sqrt(v / (1 - 0.999**t)) + 1e-8)
            theta = theta - step
            theta[3] = max(theta[3], np.log(floor))
    return theta


@pytest.mark.parametrize("floor", [1e-4, 0.5])
def test_adam_equals_the_reference_and_keeps_its_state(floor):
    x, y = samples(35)
    more_x, more_y = samples(8, seed=3)
    gp = GaussianProcess(x, y, learning_rate=0.05, min_noise_variance=floor)
    gp.optimize(30)
    gp.append(more_x, more_y)
    gp.optimize(0)
    gp.optimize(7)
    data = [
        scaled(x, y, x, y),
        scaled(x, y, np.concatenate([x, more_x]), np.concatenate([y, more_y])),
    ]
    expected = reference_adam(np.log([1.0, 0.5, 0.5, 1.0]), data, [30, 7], 0.05, floor)

    np.testing.assert_allclose(reference_theta(gp.hyperparameters), expected, atol=1e-8)


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_noise_variance_stops_at_its_floor(optimizer):
    x, y = samples(60, noise=0.0)
    gp = GaussianProcess(
        x, y, optimizer=optimizer, learning_rate=0.2, min_noise_variance=0.04, noise_variance=0.1
    )
    gp.optimize(60)
    assert gp.hyperparameters.noise_std == pytest.approx(0.2, rel=1e-12)


def test_append_replace_and_a_fresh_model_agree():
    x, y = samples(40)
    more_x, more_y = samples(21, seed=2)
    all_x, all_y = np.concatenate([x, more_x]), np.concatenate([y, more_y])
    query = samples(50, seed=9)[0]

    appended = GaussianProcess(x, y)
    appended.optimize(15)
    appended.predict(query)  # leaves a factor that the appended rows extend
    appended.append(more_x[:1], more_y[:1])
    appended.predict(query)
    appended.append(more_x[1:], more_y[1:])
    appended.append(more_x[:0], more_y[:0])

    replaced = GaussianProcess(x, y)
    replaced.optimize(15)
    replaced.replace(more_x, more_y)
    replaced.predict(query)
    replaced.replace(all_x, all_y)

    regressor = sklearn_regressor(appended.hyperparameters).fit(*scaled(x, y, all_x, all_y))
    fresh = regressor.predict(scaled(x, y, query, y[:0])[0])
    for gp in (appended, replaced):
        assert gp.n_data == 61
        np.testing.assert_allclose(gp.predict(query)[0], y.mean() + y.std() * fresh, rtol=1e-9)
    np.testing.assert_allclose(appended.predict(query), replaced.predict(query), rtol=1e-9)
    assert appended.log_marginal_likelihood == pytest.approx(replaced.log_marginal_likelihood)


def test_grown_factor_serves_the_gradient():
    x, y = samples(40)
    more_x, more_y = samples(6, seed=2)
    gp = GaussianProcess(x, y)
    gp.optimize(3)
    gp.predict(x)
    gp.append(more_x, more_y)
    gp.optimize(1)
    other = GaussianProcess(x, y)
    other.optimize(3)
    other.replace(np.concatenate([x, more_x]), np.concatenate([y, more_y]))
    other.optimize(1)
    np.testing.assert_allclose(
        reference_theta(gp.hyperparameters), reference_theta(other.hyperparameters), atol=1e-10
    )


def test_replaced_measurements_at_the_same_places_are_used():
    x, y = samples(30)
    gp = GaussianProcess(x, y)
    before = gp.predict(x)[0]
    gp.replace(x, y + 100.0)
    after, _ = gp.predict(x)
    other = GaussianProcess(x, y)
    other.replace(x[::-1], (y + 100.0)[::-1])
    np.testing.assert_allclose(after, other.predict(x)[0], rtol=1e-10)
    assert np.abs(after - before).min() > 1.0


def test_fewer_data_one_and_none():
    x, y = samples(30)
    gp = GaussianProcess(x, y, amplitude=2.0)
    query = samples(5, seed=1)[0]
    for n in (12, 1):
        gp.replace(x[:n], y[:n])
        regressor = sklearn_regressor(gp.hyperparameters).fit(*scaled(x, y, x[:n], y[:n]))
        mean, std = regressor.predict(scaled(x, y, query, y)[0], return_std=True)
        np.testing.assert_allclose(gp.predict(query)[0], y.mean() + y.std() * mean)
        np.testing.assert_allclose(gp.predict(query)[1], y.std() * std)
    gp.replace(x[:0], y[:0])
    gp.optimize(2)
    assert gp.log_marginal_likelihood == 0.0
    mean, std = gp.predict(query)
    np.testing.assert_allclose(mean, y.mean())
    np.testing.assert_allclose(std, 2.0 * y.std())
    gp.append(x, y)
    np.testing.assert_allclose(
        gp.predict(query), GaussianProcess(x, y, amplitude=2.0).predict(query), rtol=1e-10
    )


@pytest.mark.parametrize("jitter", [0.0, 1e-17])
def test_duplicated_points_without_noise_raise_the_jitter_and_are_reported(jitter):
    x, y = samples(30, noise=0.0)
    gp = GaussianProcess(
        np.repeat(x, 4, axis=0),
        np.repeat(y, 4),
        noise_variance=0.0,
        min_noise_variance=0.0,
        jitter=jitter,
        lengthscale=2.0,
    )
    mean, std = gp.predict(x)
    assert gp.jitter > 1e-16
    assert np.isfinite(mean).all()
    assert (std > 0.0).all()
    np.testing.assert_allclose(mean, y, atol=0.05 * y.std())
    # The next factorisation starts from the configured jitter again.
    gp.replace(x[:2], y[:2])
    gp.predict(x)
    assert gp.jitter == jitter


def test_the_reported_jitter_is_the_one_in_the_likelihood():
    x, y = np.repeat(samples(8)[0], 5, axis=0), samples(40)[1]
    gp = GaussianProcess(x, y, noise_variance=0.0, min_noise_variance=0.0, jitter=1e-18)
    value = gp.log_marginal_likelihood
    regressor = sklearn_regressor(gp.hyperparameters, gp.jitter).fit(*scaled(x, y, x, y))
    assert gp.jitter > 1e-18
    assert value == pytest.approx(regressor.log_marginal_likelihood_value_, rel=1e-2)
    gp.optimize(1)  # a gradient of 1e16 and more
    assert np.isfinite(reference_theta(gp.hyperparameters)).all()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_near_singular_models_stay_finite(optimizer, dtype):
    x, y = samples(60, noise=0.0)
    gp = GaussianProcess(
        x,
        y,
        amplitude=50.0,
        lengthscale=20.0,
        noise_variance=1e-12,
        min_noise_variance=1e-12,
        jitter=1e-15,
        optimizer=optimizer,
        dtype=dtype,
    )
    for iterations in (0, 5):
        gp.optimize(iterations)
        mean, std = gp.predict(x)
        assert np.isfinite(gp.log_marginal_likelihood)
        assert np.isfinite(mean).all()
        assert (std > 0.0).all()
        assert iterations or gp.jitter > 1e-15


@pytest.mark.parametrize("learning_rate", [50.0, 1e300])
def test_a_huge_learning_rate_ends_nothing(learning_rate):
    x, y = samples(30)
    gp = GaussianProcess(x, y, learning_rate=learning_rate)
    for _ in range(4):
        gp.optimize(3)
        mean, std = gp.predict(x)
        assert np.isfinite(reference_theta(gp.hyperparameters)).all()
        assert np.isfinite(gp.log_marginal_likelihood)
        assert np.isfinite(mean).all()
        assert (std > 0.0).all()


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
@pytest.mark.parametrize("huge", [1e90, 1e160])
def test_a_gradient_that_overflows_is_rejected(optimizer, huge):
    x, y = samples(30)
    gp = GaussianProcess(x, y, optimizer=optimizer)
    gp.replace(x, y * huge)
    gp.optimize(3)
    before = gp.hyperparameters
    assert np.isfinite(reference_theta(before)).all()
    gp.replace(x, y)
    gp.optimize(3)
    assert np.isfinite(reference_theta(gp.hyperparameters)).all()
    assert gp.hyperparameters != before


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_equal_measurements_after_the_pilot(optimizer):
    x, y = samples(30)
    gp = GaussianProcess(x, y, optimizer=optimizer)
    gp.replace(x, np.full(30, y.mean()))
    gp.optimize(50)
    mean, std = gp.predict(x)
    np.testing.assert_allclose(mean, y.mean())
    assert (std > 0.0).all()


def test_the_variance_is_never_zero_where_rounding_eats_it():
    x, y = samples(80, noise=0.0)
    gp = GaussianProcess(
        x, y, lengthscale=3.0, noise_variance=0.0, min_noise_variance=0.0, jitter=1e-14
    )
    _, std = gp.predict(x)
    assert std.min() >= y.std() * np.sqrt(np.finfo(float).eps)


def mission_like(gp_options, epochs, pilot_iterations, iterations):
    """Likelihoods of a model that gets 15 samples an epoch."""
    x, y = samples(60 + 15 * epochs, seed=4, noise=20.0)
    gp = GaussianProcess(x[:60], y[:60], **gp_options)
    gp.optimize(pilot_iterations)
    values = [gp.log_marginal_likelihood]
    for start in range(60, y.size, 15):
        gp.append(x[start : start + 15], y[start : start + 15])
        gp.optimize(iterations)
        values.append(gp.log_marginal_likelihood)
    return np.array(values)


@pytest.mark.long
def test_lbfgs_reaches_adam_with_a_fifth_of_the_evaluations():
    adam = mission_like({"optimizer": "adam"}, 8, 500, 50)
    lbfgs = mission_like({"optimizer": "lbfgs"}, 8, 100, 10)
    assert (lbfgs >= adam - 1e-3).all()
    assert lbfgs[-1] > mission_like({"optimizer": "adam"}, 8, 100, 10)[-1]


def test_lbfgs_never_lowers_the_likelihood():
    x, y = samples(50)
    gp = GaussianProcess(x, y, optimizer="lbfgs")
    last = gp.log_marginal_likelihood
    for iterations in (1, 2, 3, 5, 8, 40):
        gp.optimize(iterations)
        assert gp.log_marginal_likelihood >= last - 1e-9
        last = gp.log_marginal_likelihood


def test_single_precision_is_near_double():
    x, y = samples(150, noise=30.0)
    query = samples(200, seed=8)[0]
    double, single = (GaussianProcess(x, y, dtype=dtype) for dtype in ("float64", "float32"))
    for gp in (double, single):
        gp.optimize(100)
    np.testing.assert_allclose(
        reference_theta(single.hyperparameters), reference_theta(double.hyperparameters), atol=0.01
    )
    assert single.log_marginal_likelihood == pytest.approx(double.log_marginal_likelihood, abs=0.2)
    mean, std = double.predict(query)
    single_mean, single_std = single.predict(query)
    np.testing.assert_allclose(single_mean, mean, atol=0.01 * y.std())
    np.testing.assert_allclose(single_std, std, rtol=0.02)
    # It is another computation, not the same one under another name.
    assert single.log_marginal_likelihood != double.log_marginal_likelihood


def test_single_precision_raises_the_jitter_where_double_needs_none():
    x, y = samples(100)
    options = {"lengthscale": 2.0, "noise_variance": 1e-9, "jitter": 1e-9}
    jitters = {}
    for dtype in ("float64", "float32"):
        gp = GaussianProcess(x, y, dtype=dtype, **options)
        gp.predict(x)
        jitters[dtype] = gp.jitter
    assert jitters["float64"] == 1e-9
    assert jitters["float32"] > 1e-9


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
def test_the_same_calls_give_the_same_bits(optimizer):
    results = []
    for _ in range(2):
        x, y = samples(45)
        gp = GaussianProcess(x, y, optimizer=optimizer)
        gp.optimize(12)
        gp.append(*samples(7, seed=6))
        gp.optimize(5)
        mean, std = gp.predict(x)
        results.append((gp.hyperparameters, mean.tobytes(), std.tobytes()))
    assert results[0] == results[1]


def test_data_are_copied():
    x, y = samples(20)
    gp = GaussianProcess(x, y)
    before = gp.predict(x[:3].copy())[0]
    query = x[:3].copy()
    x += 1.0
    y *= 2.0
    gp.append(x[:0], y[:0])
    np.testing.assert_array_equal(gp.predict(query)[0], before)


def test_pilot_that_cannot_scale():
    x, y = samples(20)
    with pytest.raises(RunError, match="measurements are all equal"):
        GaussianProcess(x, np.full(20, 3.3))
    for flat in ([1.0, 0.0], [0.0, 1.0]):
        with pytest.raises(RunError, match="span no area"):
            GaussianProcess(x * flat, y)
    with pytest.raises(RunError, match="span no area"):
        GaussianProcess(x[:0], y[:0])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_data_that_are_not_finite_are_refused(bad):
    x, y = samples(20)
    gp = GaussianProcess(x, y)
    with pytest.raises(RunError, match="not finite"):
        gp.append(x[:1], [bad])
    with pytest.raises(RunError, match="not finite"):
        gp.replace([[bad, 0.0]], [1.0])
    assert gp.n_data == 20
