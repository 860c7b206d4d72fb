"""Counting, smoothing and normalising against brute force."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from infoplan.plan import count_flags, normalise, smooth

EXTENT = (-2.0, 6.0, 1.0, 4.0)


def nodes(extent, shape):
    """Positions of all nodes as (row, column, x, y), by the grid's definition."""
    xmin, xmax, ymin, ymax = extent
    rows, cols = shape
    return [
        (i, j, xmin + j * (xmax - xmin) / (cols - 1), ymin + i * (ymax - ymin) / (rows - 1))
        for i, j in itertools.product(range(rows), range(cols))
    ]


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(0, 40),
    shape=st.tuples(st.integers(2, 9), st.integers(2, 9)),
)
def test_flags_are_counted_at_the_nearest_nodes(seed, count, shape):
    rng = np.random.default_rng(seed)
    x = rng.uniform((-2.0, 1.0), (6.0, 4.0), (count, 2))
    spacing_x, spacing_y = 8.0 / (shape[1] - 1), 3.0 / (shape[0] - 1)
    expected = np.zeros(shape)
    for x1, x2 in x:
        row, col, *_ = min(
            nodes(EXTENT, shape),
            key=lambda node: max(abs(node[2] - x1) / spacing_x, abs(node[3] - x2) / spacing_y),
        )
        expected[row, col] += 1
    counts = count_flags(x, EXTENT, shape)
    np.testing.assert_array_equal(counts, expected)
    assert counts.sum() == count


def test_borders_half_way_and_repeats():
    x = [(0.0, 0.0), (4.0, 2.0), (4.0, 2.0), (1.5, 0.5), (1.49, 0.49), (4.2, -1.0)]
    counts = count_flags(x, (0.0, 4.0, 0.0, 2.0), (3, 5))
    expected = np.zeros((3, 5))
    expected[0, 0], expected[2, 4], expected[1, 2], expected[0, 1], expected[0, 4] = 1, 2, 1, 1, 1
    np.testing.assert_array_equal(counts, expected)


def test_no_flags_and_a_single_row():
    assert count_flags(np.empty((0, 2)), EXTENT, (3, 4)).tolist() == [[0] * 4] * 3
    assert count_flags([(6.0, 2.0)], EXTENT, (1, 3)).tolist() == [[0, 0, 1]]


def brute_force_smooth(counts, sigma, extent):
    """Weigh all nodes within 4 sigma by distance; past the border the nearest node goes on."""
    rows, cols = counts.shape
    step_x, step_y = (extent[1] - extent[0]) / (cols - 1), (extent[3] - extent[2]) / (rows - 1)
    reach_x, reach_y = (int(4.0 * sigma / step + 0.5) for step in (step_x, step_y))
    result = np.zeros(counts.shape)
    for i, j in itertools.product(range(rows), range(cols)):
        total = weights = 0.0
        for di in range(-reach_y, reach_y + 1):
            for dj in range(-reach_x, reach_x + 1):
                squared = (di * step_y) ** 2 + (dj * step_x) ** 2
                weight = math.exp(-0.5 * squared / sigma**2)
                row, col = min(max(i + di, 0), rows - 1), min(max(j + dj, 0), cols - 1)
                total += weight * counts[row, col]
                weights += weight
        result[i, j] = total / weights
    return result


@pytest.mark.parametrize("sigma", [0.1, 0.6, 2.0])
@pytest.mark.parametrize("extent", [EXTENT, (0.0, 10.0, 0.0, 10.0)])
def test_smoothing_is_a_gaussian_convolution(sigma, extent):
    counts = np.random.default_rng(0).integers(0, 4, (7, 11))
    expected = brute_force_smooth(counts, sigma, extent)
    np.testing.assert_allclose(smooth(counts, sigma, extent), expected, rtol=1e-10)


def test_no_smoothing_and_a_single_row():
    counts = np.array([[0, 2, 1], [5, 0, 3]])
    np.testing.assert_array_equal(smooth(counts, 0.0, EXTENT), counts)
    row = np.array([[0.0, 0.0, 4.0, 0.0, 0.0]])
    two_rows = smooth(np.vstack([row, row]), 1.0, EXTENT)
    np.testing.assert_allclose(smooth(row, 1.0, EXTENT), two_rows[:1])


def test_smoothing_leaves_its_input_alone():
    counts = np.eye(4)
    smooth(counts, 1.0, EXTENT)
    np.testing.assert_array_equal(counts, np.eye(4))


def test_normalise():
    assert normalise([[1.0, 4.0], [0.0, 2.0]]).tolist() == [[0.25, 1.0], [0.0, 0.5]]
    assert normalise(np.zeros((2, 3))).tolist() == [[0.0] * 3] * 2


@pytest.mark.parametrize("sigma", [700.0, 20000.0])
@pytest.mark.parametrize("shape", [(12, 9), (2, 40)])
def test_a_kernel_far_longer_than_the_map(sigma, shape):
    counts = np.random.default_rng(3).poisson(0.3, shape)
    nodes = [sigma * (shape[0] - 1) / 50, sigma * (shape[1] - 1) / 50]
    expected = gaussian_filter(counts.astype(float), nodes, mode="nearest")
    np.testing.assert_allclose(smooth(counts, sigma, (0, 50, 0, 50)), expected, rtol=1e-11)


def test_without_end_it_is_the_mean_of_the_corners():
    counts = np.random.default_rng(3).poisson(2, (12, 9))
    smoothed = smooth(counts, 1e12, (0, 50, 0, 50))
    corners = counts[[0, 0, -1, -1], [0, -1, 0, -1]].mean()
    np.testing.assert_allclose(smoothed, np.full((12, 9), corners), rtol=1e-9)
