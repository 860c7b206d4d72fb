"""Whatever the numbers: every model answers with finite numbers or one sentence, and ends."""

import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, StudentTProcess, log_marginal_likelihood

POSITIVE = st.floats(5e-324, 1.7e308)
MODELS = st.sampled_from(
    [
        (GaussianProcess, {"dtype": "float64"}),
        (GaussianProcess, {"dtype": "float32"}),
        (StudentTProcess, {}),
    ]
)


def data(n=12):
    rng = np.random.default_rng(3)
    x = rng.uniform(0.0, 50.0, (n, 2))
    x[n // 2] = x[0]  # singular without noise
    return x, rng.normal(size=n)


@settings(max_examples=60)
@given(
    MODELS, POSITIVE, POSITIVE, POSITIVE, st.one_of(st.just(0.0), POSITIVE),
    st.one_of(st.just(0.0), POSITIVE), st.sampled_from(["adam", "lbfgs"]),
)  # fmt: skip
@example((GaussianProcess, {"dtype": "float64"}), 1e308, 0.5, 1.0, 1e-6, 1e-4, "adam")
@example((GaussianProcess, {"dtype": "float32"}), 1e20, 0.5, 1.0, 1e-6, 1e-4, "adam")
@example((StudentTProcess, {}), 1e308, 0.5, 1.0, 1e-6, 1e-4, "adam")
@example((StudentTProcess, {}), 1.0, 0.5, 1.410950773530581e102, 1e-6, 1e-4, "adam")
@example((StudentTProcess, {}), 1.0, 1.0, 1.4990384980306045e153, 0.0, 0.0, "adam")
@example((StudentTProcess, {}), 1.0, 1.0, 6.785374567578366e305, 0.0, 0.0, "adam")
@example((GaussianProcess, {"dtype": "float64"}), 1.0, 1e-308, 1e-300, 0.0, 0.0, "adam")
@example((GaussianProcess, {"dtype": "float64"}), 1.0, 1.0, 1e308, 1e308, 1e308, "lbfgs")
def test_any_start_values(kind, amplitude, lengthscale, noise, jitter, floor, optimizer):
    model, dtype = kind
    x, y = data()
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            process = model(
                x, y, amplitude=amplitude, lengthscale=lengthscale, noise_variance=noise,
                jitter=jitter, min_noise_variance=floor, optimizer=optimizer, **dtype,
            )  # fmt: skip
            process.optimize(3)
            mean, std = process.predict(x[:5] + 1.0)
        except RunError:
            return
    assert np.isfinite(mean).all()
    assert (std > 0.0).all() or amplitude < 1e-100


@pytest.mark.parametrize(("amplitude", "dtype"), [(1e308, "float64"), (1e20, "float32")])
def test_an_infinite_covariance_is_one_sentence(amplitude, dtype):
    x, y = data()
    process = GaussianProcess(x, y, amplitude=amplitude, dtype=dtype)
    with pytest.raises(RunError, match="Gaussian process cannot factorise") as caught:
        process.optimize(1)
    assert f"amplitude {amplitude:.3g}" in str(caught.value)
    assert ("model.dtype=float64" in str(caught.value)) == (dtype == "float32")


def test_the_student_t_process_says_the_same():
    x, y = data()
    with pytest.raises(RunError, match=r"Student-t process cannot factorise.*model.amplitude"):
        StudentTProcess(x, y, amplitude=1e200).optimize(1)


@pytest.mark.parametrize("theta", [[np.nan, 0, 0, 0], [0, 0, 0, np.nan]])
def test_nan_ends_too(theta):
    x, y = data()
    with pytest.raises(RunError, match="cannot factorise"):
        log_marginal_likelihood(x, y, np.array(theta, dtype=float))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_jitter_grows_as_far_as_is_needed(dtype):
    # Equal positions without noise: singular. Positive definite from some n eps alpha^2 on, which
    # for alpha = 1000 and single precision is 1e6 times the first jitter.
    x = np.zeros((40, 2))
    _, gradient = log_marginal_likelihood(
        x, np.zeros(40), np.array([np.log(1000.0), 0.0, 0.0, -46.0]), dtype=dtype
    )
    assert np.isfinite(gradient).all()


@pytest.mark.parametrize("scale", [1e308, 1e200, 1e-200])
def test_measurements_without_a_standard_deviation(scale):
    x, y = data()
    with pytest.raises(RunError, match="use another unit"):
        GaussianProcess(x, scale * (y / np.abs(y).max()))


@pytest.mark.parametrize(
    ("model", "options"),
    [
        (GaussianProcess, {"dtype": "float64"}),
        (GaussianProcess, {"dtype": "float32"}),
        (StudentTProcess, {}),
    ],
)
def test_a_variance_below_rounding_is_the_floor_itself(model, options):
    """At the data of an all but noise-free model the variance is 1e-20: less than rounding."""
    axis = np.linspace(0.0, 10.0, 6)
    x = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    y = np.sin(x[:, 0]) + x[:, 1]
    process = model(
        x, y, lengthscale=0.3, noise_variance=1e-20, min_noise_variance=0.0, jitter=0.0, **options
    )
    _, std = process.predict(x)
    floor = np.finfo(options.get("dtype", "float64")).eps
    variance = (std / y.std()) ** 2
    assert variance.min() == pytest.approx(floor, rel=1e-6)
    assert np.mean(np.isclose(variance, floor, rtol=1e-6, atol=0.0)) > 0.8
