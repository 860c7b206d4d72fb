"""The Dubins car against plain arithmetic, the Bezier path against SciPy's Bernstein basis."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from infoplan.config import PilotConfig
from infoplan.errors import UsageError
from infoplan.robot import (
    bezier_path,
    drive,
    inside,
    steering_angles,
    step,
    turn_on_the_spot,
)

EXTENT = (0.0, 50.0, -10.0, 20.0)
headings = st.floats(0.0, 2.0 * math.pi, exclude_max=True)


def angle_between(a, b):
    return np.abs((np.asarray(a) - b + np.pi) % (2.0 * np.pi) - np.pi)


@given(x=st.floats(-99, 99), y=st.floats(-99, 99), theta=headings, u=st.floats(-7, 7))
def test_step_moves_then_turns(x, y, theta, u):
    x1, y1, theta1 = step(x, y, theta, u, 0.7)
    assert x1 == x + 0.7 * math.cos(theta)
    assert y1 == y + 0.7 * math.sin(theta)
    assert 0.0 <= theta1 < 2.0 * math.pi
    assert angle_between(theta1, theta + u) < 1e-14


@pytest.mark.parametrize("u", [-1e-17, -1e-300, -5e-324])
def test_heading_never_rounds_to_two_pi(u):
    assert step(0.0, 0.0, 0.0, u, 1.0)[2] == 0.0


def test_drive_by_hand():
    # North, then two samples that turn right by a quarter each.
    quarter = math.pi / 2
    poses = drive((1.0, 2.0, quarter), [1, 0], [-quarter, 0.0], 0.5, 2)
    expected = [
        (1.0, 2.5, quarter),
        (1.0, 3.0, quarter),
        (1.0, 3.5, 0.0),
        (1.5, 3.5, 3 * quarter),
    ]
    np.testing.assert_allclose(poses, expected, atol=1e-15)


@settings(deadline=None)
@given(
    start=headings,
    actions=st.lists(st.integers(0, 4), max_size=6),
    samples=st.integers(1, 4),
)
def test_drive_is_plain_arithmetic(start, actions, samples):
    x, y, theta = 3.0, 4.0, start
    expected = []
    for action in actions:
        for _ in range(samples):
            x, y = x + 0.7 * math.cos(theta), y + 0.7 * math.sin(theta)
            theta = (theta + [-0.15, -0.075, 0.0, 0.075, 0.15][action]) % (2.0 * math.pi)
            theta = 0.0 if theta == 2.0 * math.pi else theta  # -1e-17 modulo 2 pi
            expected.append([x, y, theta])
    poses = drive((3.0, 4.0, start), actions, steering_angles(0.15, 5), 0.7, samples)
    assert poses.shape == (len(actions) * samples, 3)
    assert poses.tolist() == expected


def test_inside_includes_the_border():
    assert inside(0.0, -10.0, EXTENT)
    assert inside(50.0, 20.0, EXTENT)
    assert inside(25.0, 5.0, EXTENT)
    for x, y in [(-1e-9, 0.0), (50.1, 0.0), (5.0, -10.1), (5.0, 20.1)]:
        assert not inside(x, y, EXTENT)


def test_steering_angles():
    np.testing.assert_allclose(steering_angles(0.15, 5), [-0.15, -0.075, 0.0, 0.075, 0.15])
    assert steering_angles(0.15, 1).tolist() == [0.0]
    for count in range(2, 30):
        angles = steering_angles(0.17, count)
        assert (angles[0], angles[-1]) == (-0.17, 0.17)
        assert angles.tolist() == (-angles[::-1]).tolist()
        assert (0.0 in angles) == (count % 2 == 1)
        np.testing.assert_allclose(np.diff(angles), 0.34 / (count - 1))


def test_no_steering_angle_is_a_usage_error():
    with pytest.raises(UsageError, match="number of steering angles is 0"):
        steering_angles(0.15, 0)


def test_turn_on_the_spot():
    np.testing.assert_allclose(turn_on_the_spot((1.0, 2.0, 0.5)), [1.0, 2.0, 0.5 + math.pi / 8])
    pose = np.array([1.0, 2.0, 6.2])
    for _ in range(16):
        pose = turn_on_the_spot(pose)
        assert 0.0 <= pose[2] < 2.0 * math.pi
    np.testing.assert_allclose(pose, [1.0, 2.0, 6.2])


def bernstein(control_points, extent):
    """Return the curve as SciPy's polynomial in the Bernstein basis."""
    low, high = np.array(extent[0::2]), np.array(extent[1::2])
    points = low + np.asarray(control_points) * (high - low)
    return BPoly(points[:, None, :], [0.0, 1.0])


def test_pilot_curve_is_the_bernstein_polynomial():
    points = PilotConfig().control_points
    path = bezier_path(points, EXTENT, 100)
    curve = bernstein(points, EXTENT)
    parameter = np.linspace(0.0, 1.0, 100)
    np.testing.assert_allclose(path[:, :2], curve(parameter), rtol=1e-12, atol=1e-12)
    dx, dy = curve.derivative()(parameter).T
    np.testing.assert_allclose(path[:, 2], np.arctan2(dy, dx) % (2.0 * np.pi), rtol=1e-9)


def test_pilot_curve_goes_from_its_first_point_to_its_last():
    points = PilotConfig().control_points
    path = bezier_path(points, EXTENT, 100)
    assert len(points) == 18
    np.testing.assert_allclose(path[0], [12.5, -10.0, math.pi])
    np.testing.assert_allclose(path[-1], [25.0, 5.0, math.pi / 2])
    assert all(inside(x, y, EXTENT) for x, y in path[:, :2].tolist())


def test_heading_follows_the_curve():
    points = PilotConfig().control_points
    path = bezier_path(points, EXTENT, 2001)
    dx, dy = (path[2:, :2] - path[:-2, :2]).T
    assert angle_between(path[1:-1, 2], np.arctan2(dy, dx)).max() < 1e-4
    assert np.all((path[:, 2] >= 0.0) & (path[:, 2] < 2.0 * np.pi))


@settings(deadline=None)
@given(
    control_points=st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), min_size=2, max_size=20
    ),
    samples=st.integers(1, 30),
)
def test_any_curve_is_its_bernstein_polynomial_and_stays_inside(control_points, samples):
    path = bezier_path(control_points, EXTENT, samples)
    expected = bernstein(control_points, EXTENT)(np.linspace(0.0, 1.0, samples))
    assert path.shape == (samples, 3)
    np.testing.assert_allclose(path[:, :2], expected, atol=1e-11)
    assert all(inside(x, y, EXTENT) for x, y in path[:, :2].tolist())
    assert np.all((path[:, 2] >= 0.0) & (path[:, 2] < 2.0 * np.pi))


def test_rounding_does_not_carry_the_curve_out():
    low, high = -0.1, 0.2
    assert low + (high - low) > high
    path = bezier_path([(0, 1), (0.5, 1), (1, 1), (1, 0)], (low, high, low, high), 50)
    assert path[:, :2].max() == high
    assert path[:, :2].min() == low


def test_repeated_control_points_take_the_chord():
    unit = (0.0, 1.0, 0.0, 1.0)
    ends = bezier_path([(0, 0), (0, 0), (1, 1), (1, 1)], unit, 5)
    np.testing.assert_allclose(ends[:, 2], math.pi / 4)
    start = bezier_path([(1, 0), (1, 0), (0, 0)], unit, 3)
    np.testing.assert_allclose(start[:, 2], math.pi)
    # Forth and back: the middle sample has no tangent, and looks at the next one.
    back = bezier_path([(0, 0.5), (1, 0.5), (0, 0.5)], unit, 3)
    np.testing.assert_allclose(back, [[0, 0.5, 0], [0.5, 0.5, math.pi], [0, 0.5, math.pi]])
    point = bezier_path([(0.5, 0.5)] * 4, unit, 3)
    assert point.tolist() == [[0.5, 0.5, 0.0]] * 3


@pytest.mark.parametrize(
    ("control_points", "message"),
    [
        ([(0.5, 0.5)], r"shape \(1, 2\)"),
        ([(0.5, 0.5, 0.1), (1, 1, 1)], r"shape \(2, 3\)"),
        ([0.1, 0.2], r"shape \(2,\)"),
        ([(0.5, 0.5), (1.5, 0.5)], "reach from 0.5 to 1.5"),
        ([(0.5, -0.5), (1.0, 0.5)], "reach from -0.5 to 1"),
    ],
)
def test_bad_control_points_are_a_usage_error(control_points, message):
    with pytest.raises(UsageError, match=message):
        bezier_path(control_points, EXTENT, 10)


def test_a_vanishing_tangent_takes_the_next_sample_and_not_the_last():
    path = bezier_path([[0, 0], [0, 0], [1, 0], [1, 1]], (0.0, 10.0, 0.0, 10.0), 9)
    dx, dy = path[1, :2] - path[0, :2]
    assert path[0, 2] == pytest.approx(np.arctan2(dy, dx))
    dx, dy = path[-1, :2] - path[0, :2]
    assert abs(path[0, 2] - np.arctan2(dy, dx)) > 0.3
