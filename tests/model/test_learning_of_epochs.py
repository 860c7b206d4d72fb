"""What an epoch's learning takes over from those before: noise, memory of the optimiser."""

import numpy as np
import pytest
from model.test_gp import dense_gradient, reference_theta, samples, scaled
from model.test_optimizers import BOUNDS, PEAK, Counted

from infoplan.model import GaussianProcess, RobustConjugateProcess, StudentTProcess, VecchiaProcess
from infoplan.model.optimizers import Adam, Lbfgs
from infoplan.model.relevance_pursuit import RelevancePursuitProcess

MODELS = [
    GaussianProcess, RobustConjugateProcess, StudentTProcess, VecchiaProcess,
    RelevancePursuitProcess,
]  # fmt: skip


def adam_by_hand(data, counts, noise, state):
    """Adam as in Kingma and Ba, epoch by epoch, each with noise and memory as it is said."""
    theta = np.log([1.0, 0.5, 0.5, 0.7])
    m, v, t = np.zeros(4), np.zeros(4), 0
    for (x, y), count in zip(data, counts, strict=True):
        if noise == "restarted":
            theta[3] = np.log(0.7)
        if state == "reset":
            m, v, t = np.zeros(4), np.zeros(4), 0
        for _ in range(count):
            gradient, t = dense_gradient(x, y, theta), t + 1
            m, v = 0.9 * m + 0.1 * gradient, 0.999 * v + 0.001 * gradient**2
            step = 0.05 * (m / (1 - 0.9**t)) / (np.sqrt(v / (1 - 0.999**t)) + 1e-8)
            theta = theta + step
    return theta


@pytest.mark.parametrize("state", ["carried", "reset"])
@pytest.mark.parametrize("noise", ["carried", "restarted"])
def test_adam_takes_over_what_it_is_said_to(noise, state):
    parts = [samples(35), samples(8, seed=3), samples(6, seed=4)]
    gp = GaussianProcess(
        *parts[0], noise_variance=0.7, learning_rate=0.05, noise_start=noise, optimizer_state=state
    )
    gp.optimize(30)
    for part in parts[1:]:
        gp.append(*part)
        gp.optimize(6)
    data = []
    for n in (1, 2, 3):
        x, y = (np.concatenate(column) for column in zip(*parts[:n], strict=True))
        data.append(scaled(*parts[0], x, y))
    expected = adam_by_hand(data, [30, 6, 6], noise, state)
    np.testing.assert_allclose(reference_theta(gp.hyperparameters), expected, atol=1e-8)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_starts_an_epoch_at_the_first_noise(model):
    x, y = samples(30)
    noises = []
    for start in ("carried", "restarted"):
        one = model(
            x, y, noise_variance=0.3, learning_rate=0.01, noise_start=start, optimizer="adam"
        )
        one.optimize(25)
        one.optimize(1)
        noises.append(one.hyperparameters.noise_std**2)
    carried, restarted = noises
    # Of a start at 0.3 one step of 0.01 leads away.
    assert restarted == pytest.approx(0.3, rel=0.0101)
    assert abs(np.log(carried / 0.3)) > 0.1


@pytest.mark.parametrize("model", MODELS)
def test_no_iterations_leave_the_hyperparameters_alone(model):
    x, y = samples(30)
    one = model(x, y, noise_start="restarted", optimizer_state="reset")
    one.optimize(5)
    before = vars(one.hyperparameters)
    one.append(*samples(5, seed=1))
    one.optimize(0)
    assert vars(one.hyperparameters) == before


def test_a_noise_that_starts_below_its_floor_starts_at_it():
    gp = GaussianProcess(
        *samples(20), noise_variance=0.01, min_noise_variance=0.5, noise_start="restarted"
    )
    gp.optimize(3)
    gp.optimize(1)
    assert 0.5 <= gp.hyperparameters.noise_std**2 * (1 + 1e-12) <= 0.51


class Gentle(Counted):
    """One whose steps are short of where L-BFGS bounds them."""

    curvature = np.array([1.0, 3.0, 2.0, 0.5])


@pytest.mark.parametrize("reset", [True, False])
def test_optimisers_that_are_reset_do_as_new_ones(reset):
    start = PEAK + np.array([0.5, -0.4, 0.3, 0.6])
    for used, new in ((Adam(0.05), Adam(0.05)), (Lbfgs(), Lbfgs())):
        used.ascend(Gentle(), start, 4, BOUNDS)
        points, of_new = Gentle(), Gentle()
        if reset:
            used.reset()
        used.ascend(points, start, 4, BOUNDS)
        new.ascend(of_new, start, 4, BOUNDS)
        assert np.array_equal(points.points, of_new.points) == reset


def test_lbfgs_that_is_reset_still_moves_a_bounded_way():
    used, far = Lbfgs(), PEAK + np.array([0.0, 0.0, 0.0, 8.0])
    used.ascend(Counted(), PEAK, 5, BOUNDS)
    used.reset()
    assert used.ascend(Counted(), far, 60, BOUNDS)[3] == pytest.approx(far[3] - 3.0)
    assert Lbfgs().ascend(Counted(), far, 60, BOUNDS)[3] == pytest.approx(PEAK[3], abs=1e-4)
