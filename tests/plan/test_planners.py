"""Planners against brute force, geometry and each other."""

import itertools

import numpy as np
import pytest
from plan_scenes import EXTENT, poses_of, situation
from scipy import stats

from infoplan.plan import PLANNERS, normalise
from infoplan.plan.lawnmower import advance, coverage_path, nearest_action
from infoplan.robot import turn_on_the_spot


def rng(seed=0):
    return np.random.default_rng(seed)


def is_inside(scene, actions):
    xmin, xmax, ymin, ymax = scene.extent
    x, y = poses_of(scene, actions).T
    return (x >= xmin).all() and (x <= xmax).all() and (y >= ymin).all() and (y <= ymax).all()


def value(scene, actions):
    """Sum of the deviation along a plan, at the nearest nodes."""
    x, y = poses_of(scene, actions).T
    xmin, xmax, ymin, ymax = scene.extent
    rows, cols = scene.std.shape
    i = np.rint((y - ymin) / (ymax - ymin) * (rows - 1)).astype(int)
    j = np.rint((x - xmin) / (xmax - xmin) * (cols - 1)).astype(int)
    return scene.std[i, j].sum()


POSES = [(20.0, 5.0, 0.3), (46.0, 26.0, 0.9), (2.0, -8.0, 4.0), (40.0, 20.0, 5.5)]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_stays_inside(name, pose):
    scene = situation(pose)
    while not scene.valid_actions():
        scene = situation(turn_on_the_spot(scene.pose))
    plan = PLANNERS[name](scene, rng())
    assert len(plan) >= 1
    assert is_inside(scene, plan)
    np.testing.assert_allclose(scene.drive(plan)[:, :2], poses_of(scene, plan))


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_gives_nothing_where_nothing_is_left(name):
    scene = situation((49.9, 29.9, 0.7))
    assert scene.valid_actions() == []
    assert len(PLANNERS[name](scene, rng())) == 0


@pytest.mark.parametrize("name", PLANNERS)
def test_the_same_generator_gives_the_same_plan(name):
    plans = [PLANNERS[name](situation(), rng(3)).tolist() for _ in range(2)]
    assert plans[0] == plans[1]


@pytest.mark.parametrize("name", ["random", "greedy", "lawnmower"])
@pytest.mark.parametrize("actions", [1, 3])
def test_a_plan_has_as_many_actions_as_asked_for(name, actions):
    assert len(PLANNERS[name](situation(), rng(), actions=actions)) == actions


def test_valid_actions_are_those_that_stay_inside():
    for pose in POSES:
        scene = situation(pose)
        assert scene.valid_actions() == [a for a in range(5) if is_inside(scene, [a])]


@pytest.mark.parametrize("name", ["uct", "puct", "weighted", "greedy"])
def test_planners_gather_the_reward_and_not_the_deviation(name):
    worth = np.random.default_rng(5).uniform(0, 1, (15, 20))
    found, expected, other = (
        PLANNERS[name](scene, rng(2)).tolist()
        for scene in (situation(reward_map=worth), situation(std=worth), situation())
    )
    assert found == expected != other


def test_weighted_with_all_weight_on_one_reward_is_uct_on_it():
    options = {"iterations": 200, "exploration": 0.5}
    for weight, reward in ((0.0, "std"), (1.0, "outlier_density")):
        scene = situation()
        alone = situation(std=getattr(scene, reward))
        expected = PLANNERS["uct"](alone, rng(2), **options)
        found = PLANNERS["weighted"](scene, rng(2), weight=weight, **options)
        np.testing.assert_array_equal(found, expected)


def test_weighted_is_uct_on_the_sum_of_normalised_rewards():
    scene = situation()
    total = 0.7 * normalise(scene.std) + 0.3 * normalise(scene.outlier_density)
    expected = PLANNERS["uct"](situation(std=total), rng(2))
    np.testing.assert_array_equal(PLANNERS["weighted"](scene, rng(2), weight=0.3), expected)


def test_puct_looks_at_both_rewards():
    one = PLANNERS["puct"](situation(), rng(2))
    other = PLANNERS["puct"](situation(outlier_density=np.ones((15, 20))), rng(2))
    assert one.tolist() != other.tolist()


@pytest.mark.parametrize("seed", range(5))
def test_greedy_takes_the_best_single_action_each_time(seed):
    scene, plan = situation(seed=seed), []
    for _ in range(5):
        if valid := [a for a in range(5) if is_inside(scene, [*plan, a])]:
            plan.append(max(valid, key=lambda a: value(scene, [*plan, a])))
    np.testing.assert_array_equal(PLANNERS["greedy"](scene, rng(), actions=5), plan)


def test_greedy_draws_among_equals():
    flat = situation(std=np.ones((15, 20)))
    firsts = {int(PLANNERS["greedy"](flat, rng(seed), actions=1)[0]) for seed in range(40)}
    assert firsts == {0, 1, 2, 3, 4}


def test_random_draws_evenly_from_what_stays_inside():
    scene = situation((20.0, 28.0, 0.6))
    valid = scene.valid_actions()
    assert 1 < len(valid) < 5
    drawn = [int(PLANNERS["random"](scene, rng(seed), actions=1)[0]) for seed in range(600)]
    assert set(drawn) == set(valid)
    assert stats.chisquare([drawn.count(action) for action in valid]).pvalue > 1e-3


def fly(name, samples, **options):
    """Positions of a mission of one planner alone."""
    scene = situation((25.0, 10.0, 1.0), budget=samples)
    generator = rng()
    while len(scene.visited) < samples:
        plan = PLANNERS[name](scene, generator, **options)
        if len(plan):
            poses = scene.drive(plan)
            pose, visited = poses[-1], np.vstack([scene.visited, poses[:, :2]])
        else:
            pose, visited = turn_on_the_spot(scene.pose), scene.visited
        scene = situation(pose, visited=visited, budget=samples)
    return scene.visited


def gaps(visited):
    """Distance from each point of a fine grid to the nearest sample."""
    x, y = np.meshgrid(np.linspace(0, 50, 60), np.linspace(-10, 30, 60))
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    return np.hypot(*(grid[:, None] - visited).transpose(2, 0, 1)).min(axis=1)


def test_the_lawnmower_leaves_no_large_gap():
    covered = gaps(fly("lawnmower", 1400))
    assert covered.mean() < 1.2
    assert covered.max() < 9.0


def test_narrow_tracks_take_longer_to_the_other_side():
    wide, narrow = (fly("lawnmower", 600, spacing=s) for s in (8.0, 4.0))
    assert (wide[400:, 1] > 10).mean() > 0.5 > (narrow[:400, 1] > 10).mean()
    assert gaps(wide).max() < gaps(narrow).max()


@pytest.mark.parametrize("spacing", [3.0, 7.0, 45.0])
def test_the_path_of_tracks(spacing):
    path = coverage_path(np.array([25.0, 10.0]), EXTENT, spacing, 0.5, 2000.0)
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps.max() <= 0.5 + 1e-9
    assert 0.5 * len(path) >= 2000.0 - 1
    low, high = path[200:].min(axis=0), path[200:].max(axis=0)
    assert (low >= [0, -10]).all()
    assert (high <= [50, 30]).all()
    once = path[: int(2.2 * 2000 / spacing / 0.5)]
    y, x = np.meshgrid(np.linspace(-10, 30, 40), np.linspace(0, 50, 50), indexing="ij")
    nodes = np.stack([x.ravel(), y.ravel()], axis=1)
    distance = np.hypot(*(nodes[:, None] - once).transpose(2, 0, 1)).min(axis=1)
    assert distance.max() <= max(spacing, 25.0 * (spacing > 40)) * 0.75 + 0.5


@pytest.mark.parametrize("side", [5e4, 1e12])
def test_no_more_of_the_path_than_is_needed(side):
    """All tracks of so wide a workspace, or the points on them, would take all memory."""
    path = coverage_path(np.array([0.0, 0.0]), (0.0, side, 0.0, side), 0.7, 0.7, 2000.0)
    assert (np.hypot(*np.diff(path[:2900], axis=0).T) <= 0.7 + 1e-9).all()
    assert len(path) >= 2000


def test_progress_along_a_path():
    path = np.column_stack([np.arange(100.0), np.zeros(100)])
    way = np.column_stack([np.arange(0.0, 30.0), np.sin(np.arange(30.0))])
    assert advance(path, 0, way, 10) == 29
    assert advance(path, 40, way, 10) == 40  # never back
    assert advance(path, 0, path[50:51], 10) == 9  # nor further than the window at once


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("lookahead", [1, 2, 3])
def test_nearest_action_against_all_sequences(pose, lookahead):
    scene = situation(pose)
    target = np.array(pose[:2]) + np.arange(1, 10 * lookahead + 1)[:, None] * [0.3, -0.55]
    found = nearest_action(scene, scene.pose, target, lookahead)
    for length in range(lookahead, 0, -1):
        costs = {
            plan: ((poses_of(scene, plan) - target[: 10 * length]) ** 2).sum()
            for plan in itertools.product(range(5), repeat=length)
            if is_inside(scene, plan)
        }
        if costs:
            assert found == min(costs, key=costs.get)[0]
            return
    assert found is None


def test_wide_spacing_keeps_tracks_a_quarter_off_the_borders():
    path = coverage_path(np.array([25.0, 25.0]), (0.0, 50.0, 0.0, 50.0), 40.0, 0.5, 400.0)
    for corner in itertools.product((12.5, 37.5), repeat=2):
        assert np.hypot(*(path - corner).T).min() < 0.5


def test_one_track_may_be_longer_than_all_that_is_driven():
    path = coverage_path(np.zeros(2), (0.0, 1000.0, 0.0, 1000.0), 5.0, 0.7, 10.0)
    assert 10.0 <= 0.7 * (len(path) - 1) <= 10.0 + 2 * 0.7


@pytest.mark.parametrize("outside", [0, 1, 2])
def test_one_pose_outside_is_enough(outside):
    scene = situation(extent=(0.0, 10.0, 0.0, 10.0))
    poses = np.array([[5.0, 5.0, 0.0], [5.0, 10.0, 0.0], [0.0, 5.0, 0.0]])
    assert scene.stays_inside(poses)
    poses[outside, 1] = 10.1
    assert not scene.stays_inside(poses)
