"""Pictures of a place: to scale, and coloured by what was measured."""

import numpy as np
import pytest

from infoplan.draw.place_layout import (
    FLATTEST,
    TALLEST,
    beyond,
    end_of_deviation,
    ends_of_mean,
    picture_height,
    with_unit,
)

KEPT = np.array([2.0, 5.0, 3.0, np.nan])


def test_a_mean_far_off_the_track_does_not_stretch_the_colours():
    mean = np.array([[-90.0, 3.0], [4.0, 128.0]])
    assert ends_of_mean(mean, KEPT) == (2.0, 5.0)
    assert beyond(mean, 2.0, 5.0) == "both"
    assert beyond(np.array([2.0, 9.0]), 2.0, 5.0) == "max"
    assert beyond(np.array([1.0, 5.0]), 2.0, 5.0) == "min"
    assert beyond(np.array([2.0, np.nan, 5.0]), 2.0, 5.0) == "neither"


@pytest.mark.parametrize("kept", [np.empty(0), np.full(4, 3.0), np.full(2, np.nan)])
def test_values_that_have_no_range_leave_it_to_the_mean(kept):
    assert ends_of_mean(np.array([1.0, 4.0]), kept) == (1.0, 4.0)


def test_a_deviation_ends_where_nothing_is_known():
    spread = np.std([2.0, 5.0, 3.0])
    assert end_of_deviation(np.array([0.1, 60.0]), KEPT) == pytest.approx(spread)
    assert end_of_deviation(np.array([0.1, 0.5]), KEPT) == 0.5
    assert end_of_deviation(np.array([0.1, 0.5]), np.empty(0)) == 0.5


def test_a_picture_is_as_high_as_its_place_within_bounds():
    assert picture_height((0, 10, 0, 20), 2.0, 0.5) == 4.5
    assert picture_height((0, 10, 0, 1), 2.0, 0.5) == FLATTEST
    assert picture_height((0, 1, 0, 100), 2.0, 0.5) == TALLEST


def test_an_unknown_unit_is_left_out():
    assert with_unit("mean", "m") == "mean (m)"
    assert with_unit("mean", "") == "mean"
    assert with_unit("mean", "$m$") == r"mean (\$m\$)"
