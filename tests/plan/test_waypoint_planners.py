"""Planners that look for places and drive there: against brute force and each other."""

import itertools

import numpy as np
import pytest
from plan_scenes import poses_of, situation

import infoplan
from infoplan.cli import main
from infoplan.mission_cost import memory_of, seconds_of
from infoplan.plan import PLANNERS
from infoplan.plan.waypoints import follow

ROWS, COLUMNS = 15, 20


def rng(seed=0):
    return np.random.default_rng(seed)


def peak(x, y, width=4.0):
    """A reward with one summit in the workspace of `situation`."""
    y_nodes, x_nodes = np.meshgrid(
        np.linspace(-10, 30, ROWS), np.linspace(0, 50, COLUMNS), indexing="ij"
    )
    return np.exp(-((x_nodes - x) ** 2 + (y_nodes - y) ** 2) / (2 * width**2))


def gathered(scene, actions):
    """Sum of the reward at the nodes that a plan passes, each once."""
    x, y = poses_of(scene, actions).T
    i = np.rint((y + 10) / 40 * (ROWS - 1)).astype(int)
    j = np.rint(x / 50 * (COLUMNS - 1)).astype(int)
    return sum(scene.reward_map[place] for place in set(zip(i.tolist(), j.tolist(), strict=True)))


@pytest.mark.parametrize("seed", range(5))
def test_following_waypoints_takes_the_action_that_comes_nearest(seed):
    scene = situation(seed=seed)
    target = rng(seed).uniform([5, -5], [45, 25])
    plan, gain = follow(scene, target[None], 4)
    assert gain == pytest.approx(gathered(scene, plan))
    for k, action in enumerate(plan):
        away = {
            a: np.hypot(*(poses_of(scene, [*plan[:k], a])[10 * k :] - target).T).min()
            for a in range(5)
            if scene.stays_inside(scene.drive([*plan[:k], a]))
        }
        assert action == min(away, key=away.get)
    reached = np.hypot(*(poses_of(scene, plan) - target).T) <= 3.5
    assert len(plan) == 4 or reached[-10:].any()
    assert not reached[:-10].any()


def test_bayes_opt_drives_to_the_best_place_and_stops_there():
    scene = situation(reward_map=peak(42.0, 22.0))
    plan = PLANNERS["bayes_opt"](scene, rng(), actions=20)
    away = np.hypot(*(poses_of(scene, plan) - [42.0, 22.0]).T)
    assert away.min() < 5.0
    assert away[:-10].min() > 3.0
    assert len(PLANNERS["bayes_opt"](scene, rng(), actions=2)) == 2


def test_bayes_opt_weighs_the_way():
    near, far = peak(24.0, 14.0, 1.5), 2 * peak(46.0, -6.0, 1.5)
    scene = situation((20.0, 5.0, 1.0), reward_map=near + far)
    ends = [
        poses_of(scene, PLANNERS["bayes_opt"](scene, rng(), distance_penalty=penalty))[-1]
        for penalty in (0.0, 0.1)
    ]
    assert np.hypot(*(ends[0] - [46.0, -6.0])) < 6.0
    assert np.hypot(*(ends[1] - [24.0, 14.0])) < 6.0


def test_bayes_opt_passes_over_what_lies_in_an_obstacle():
    from infoplan.obstacles import obstacles_of

    square = obstacles_of([[[40, 18], [46, 18], [46, 28], [40, 28]]])
    scene = situation(reward_map=peak(43.0, 23.0, 1.0) + 0.5 * peak(5.0, -5.0), obstacles=square)
    plan = PLANNERS["bayes_opt"](scene, rng(), actions=20)
    assert np.hypot(*(poses_of(scene, plan) - [5.0, -5.0]).T).min() < 6.0


@pytest.mark.parametrize("name", ["rig_tree", "cmaes"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_planned_is_nearly_the_best_there_is(name, seed):
    """The best of all sequences of three actions, by brute force."""
    scene = situation(seed=seed)
    best = max(
        gathered(scene, plan)
        for plan in itertools.product(range(5), repeat=3)
        if scene.stays_inside(scene.drive(plan))
    )
    plan = PLANNERS[name](scene, rng(seed), actions=3)
    assert len(plan) <= 3
    assert 0.9 * best < gathered(scene, plan) <= best * (1 + 1e-12)


@pytest.mark.parametrize("name", ["rig_tree", "cmaes"])
def test_more_tries_find_more(name):
    few, many = ({"samples": n} if name == "rig_tree" else {"evaluations": n} for n in (10, 300))
    gains = [
        np.mean([
            gathered(scene, PLANNERS[name](scene, rng(seed), **tries))
            for seed in range(6) for scene in [situation(seed=seed)]
        ])
        for tries in (few, many)
    ]  # fmt: skip
    assert gains[1] > 1.05 * gains[0]


def test_pruning_costs_little_and_none_is_pruned_for_less():
    gains = {
        prune: np.array([
            gathered(scene, PLANNERS["rig_tree"](scene, rng(seed), samples=200, prune=prune))
            for seed in range(6) for scene in [situation(seed=seed)]
        ])
        for prune in (0.0, 1.0, 30.0)
    }  # fmt: skip
    assert not np.array_equal(gains[0.0], gains[30.0])
    assert gains[1.0].mean() > 0.9 * gains[0.0].mean()


@pytest.mark.parametrize("name", ["rig_tree", "cmaes", "bayes_opt"])
def test_where_there_is_nothing_to_gather_the_car_drives_on(name):
    scene = situation(reward_map=np.zeros((ROWS, COLUMNS)))
    assert len(PLANNERS[name](scene, rng())) >= 1


def test_cmaes_leaves_the_global_generator_alone():
    np.random.seed(5)  # noqa: NPY002
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    PLANNERS["cmaes"](situation(), rng())
    np.testing.assert_array_equal(before, np.random.get_state()[1])  # noqa: NPY002


def test_without_its_package_cmaes_is_refused(monkeypatch, tmp_path, capsys):
    from infoplan import methods

    monkeypatch.setattr(methods, "find_spec", lambda name: None)
    command = ["run", "planner=cmaes", "terrain=volcano", f"results_dir={tmp_path}"]
    assert main(command) == 2
    assert "pip install 'infoplan[cmaes]'" in capsys.readouterr().err


def test_bayes_opt_begins_with_the_upper_confidence_bound():
    planners = {name: infoplan.configure(f"planner={name}").planner.reward for name in PLANNERS
                if name in ("bayes_opt", "rig_tree", "cmaes")}  # fmt: skip
    assert planners == {"bayes_opt": "ucb", "rig_tree": "std", "cmaes": "std"}


def test_what_they_need_is_reckoned_with():
    small, large = (
        infoplan.configure("planner=rig_tree", f"planner.samples={n}") for n in (1, 1_000_000)
    )
    assert memory_of(large) - memory_of(small) > 1e9
    few, many = (
        infoplan.configure("planner=cmaes", f"planner.evaluations={n}") for n in (1, 1_000_000)
    )
    assert seconds_of(many) > seconds_of(few) + 60
