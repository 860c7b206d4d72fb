"""Waypoints of a track: the Douglas-Peucker algorithm, held against GEOS's."""

import numpy as np
import pytest
from matplotlib.path import Path as Outline

from infoplan.survey.area import Area
from infoplan.survey.thinning import thinned
from infoplan.survey.track_files import MOST_ITEMS, choose_waypoints

WIDE = Area(np.array([[-1e4, -1e4], [1e4, -1e4], [1e4, 1e4], [-1e4, 1e4]]))


def walk(seed, n=400):
    turns = np.cumsum(np.random.default_rng(seed).normal(0, 0.3, n))
    return np.cumsum(np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("tolerance", [0.05, 0.5, 3.0])
def test_it_chooses_what_geos_chooses(seed, tolerance):
    geometry = pytest.importorskip("shapely.geometry")
    x = walk(seed)
    line = geometry.LineString(x).simplify(tolerance, preserve_topology=False)
    assert x[thinned(x, tolerance)].tolist() == np.array(line.coords).tolist()


def test_lines_stay_in_the_area_though_it_takes_more_waypoints():
    turn = np.linspace(0, np.pi, 200)
    x = 20 * np.column_stack([np.cos(turn), np.sin(turn)])
    free, wanted = choose_waypoints(x, WIDE, 1.0)
    assert wanted == 1.0
    # A zone just within the arc, which chords would cut.
    zone = 19.8 * np.column_stack([np.cos(turn[20:-20]), np.sin(turn[20:-20])])
    kept, taken = choose_waypoints(x, Area(WIDE.border, (zone,)), 1.0)
    assert taken <= 0.25
    between = np.linspace(x[kept][:-1], x[kept][1:], 50).reshape(-1, 2)
    assert not Outline(zone).contains_points(between).any()
    assert len(kept) > len(free)


def test_a_mission_that_is_too_long_is_thinned_more():
    step = np.arange(4000)
    x = np.column_stack([step, 0.3 * (step % 2)])
    assert len(thinned(x, 0.2)) > 3900
    kept, taken = choose_waypoints(x, WIDE, 0.2)
    assert len(kept) <= MOST_ITEMS
    assert taken == 0.4
