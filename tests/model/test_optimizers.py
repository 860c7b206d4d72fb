"""The optimisers on functions whose maximum is known."""

import numpy as np
import pytest

from infoplan.model.kernels.squared_exponential import KERNEL
from infoplan.model.optimizers import Adam, Lbfgs
from infoplan.model.theta import bounds_of

BOUNDS = bounds_of(KERNEL, 1e-4)
PEAK = np.array([0.3, -1.0, 0.5, -2.0])


class Counted:
    """A concave function of very different curvatures that counts its evaluations."""

    curvature = np.array([1.0, 300.0, 20.0, 5.0])

    def __init__(self):
        self.points = []

    def __call__(self, theta):
        self.points.append(theta.copy())
        away = theta - PEAK
        return -0.5 * away @ (self.curvature * away), -self.curvature * away


@pytest.mark.parametrize("iterations", [0, 1, 4])
def test_number_of_evaluations(iterations):
    for optimizer in (Adam(0.01), Lbfgs()):
        f = Counted()
        optimizer.ascend(f, np.zeros(4), iterations, BOUNDS)
        assert len(f.points) == iterations


def test_both_find_the_maximum_and_stay_within_bounds():
    for optimizer, iterations in ((Adam(0.05), 2000), (Lbfgs(), 60)):
        f = Counted()
        theta = optimizer.ascend(f, np.zeros(4), iterations, BOUNDS)
        np.testing.assert_allclose(theta, PEAK, atol=1e-4)
        assert (np.array(f.points) >= BOUNDS.lower).all()
        assert (np.array(f.points) <= BOUNDS.upper).all()


def test_a_maximum_beyond_the_bounds_is_met_at_the_bound():
    lower = BOUNDS.lower.copy()
    lower[3] = -1.5
    for optimizer, iterations in ((Adam(0.05), 2000), (Lbfgs(), 60)):
        theta = optimizer.ascend(Counted(), np.zeros(4), iterations, BOUNDS._replace(lower=lower))
        assert theta[3] == -1.5
        np.testing.assert_allclose(theta[:3], PEAK[:3], atol=1e-4)


def test_lbfgs_returns_the_best_point_it_evaluated():
    for iterations in range(1, 12):
        f = Counted()
        theta = Lbfgs().ascend(f, np.zeros(4), iterations, BOUNDS)
        values = [f(point)[0] for point in list(f.points)]
        assert f(theta)[0] == max(values)


def test_lbfgs_keeps_the_curvature_of_earlier_calls():
    optimizer = Lbfgs()
    optimizer.ascend(Counted(), np.zeros(4), 60, BOUNDS)
    start = PEAK + np.array([0.5, -0.4, 0.3, 0.6])
    warm, cold = Counted(), Counted()
    optimizer.ascend(warm, start, 60, BOUNDS)
    Lbfgs().ascend(cold, start, 60, BOUNDS)
    assert len(warm.points) < len(cold.points)


def test_lbfgs_learns_no_scale_where_the_likelihood_is_hollow():
    def wave(theta):  # its valley at pi is hollow, its peak at 0 round
        return np.cos(theta).sum(), -np.sin(theta)

    optimizer = Lbfgs()
    optimizer.ascend(wave, np.full(4, 2.9), 2, BOUNDS)  # two points, both in the valley
    theta = optimizer.ascend(wave, np.full(4, 0.5), 60, BOUNDS)
    np.testing.assert_allclose(theta, 0.0, atol=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_never_taken(bad):
    def broken(theta):
        f = Counted()
        value, gradient = f(theta)
        return (value, gradient) if abs(theta).max() < 0.05 else (bad, gradient * bad)

    for optimizer in (Adam(0.02), Lbfgs()):
        theta = optimizer.ascend(broken, np.zeros(4), 30, BOUNDS)
        assert np.isfinite(broken(theta)[0])
        assert broken(theta)[0] >= broken(np.zeros(4))[0]


def test_lengthscales_of_lbfgs_stay_where_the_likelihood_is_not_flat():
    def rising(theta):
        return theta[1], np.array([0.0, 1.0, 0.0, 0.0])

    theta = Lbfgs().ascend(rising, np.zeros(4), 50, BOUNDS)
    assert theta[1] == pytest.approx(np.log(10.0))


def test_lbfgs_moves_a_bounded_way_on_new_data():
    # The second function is steep towards amplitudes of nothing and flat there, as new spikes are.
    def noise_explains_all(theta):
        points.append(theta.copy())
        return -1e4 * np.exp(theta[0]), np.array([-1e4 * np.exp(theta[0]), 0.0, 0.0, 0.0])

    points = []
    optimizer = Lbfgs()
    start = optimizer.ascend(Counted(), np.zeros(4), 60, BOUNDS)
    optimizer.ascend(noise_explains_all, start, 10, BOUNDS)
    moved = np.abs(np.array(points) - start).max(axis=0)
    np.testing.assert_allclose(moved, [3.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_a_floor_of_zero_has_a_finite_logarithm():
    assert np.isfinite(bounds_of(KERNEL, 0.0).lower).all()
    assert np.isfinite(bounds_of(KERNEL, 0.0).upper).all()
    assert bounds_of(KERNEL, 0.25).lower[3] == np.log(0.25)
