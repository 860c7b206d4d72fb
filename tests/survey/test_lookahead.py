"""A track ahead: what it gathers, how it turns, and what a survey along it is worth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.path import Path as Outline
from plan_scenes import situation

from infoplan.belief import Belief
from infoplan.config import METHODS, MissionConfig, SurveyedConfig
from infoplan.lookahead import can_circle, gain, look_ahead, near
from infoplan.plan import Situation
from infoplan.robot import tightest_turn
from infoplan.samples import Readings
from infoplan.study.surveys import headings
from infoplan.survey.area import Area
from infoplan.survey.vehicle import steered
from infoplan.terrain import load_terrain

SIDE, NOISE, SAMPLES = 60.0, 0.05, 150
BORDER = np.array([[0.0, 0.0], [SIDE, 0.0], [SIDE, SIDE], [0.0, SIDE]])
ZONE = np.array([[34.0, 20.0], [42.0, 22.0], [38.0, 40.0]])
AREA = Area(BORDER, (ZONE,))
RADIUS, STEP = 4.0, 1.0
SEEDS = range(4)


def lines() -> np.ndarray:
    """Where a survey has been: the west alone, up and down."""
    legs = []
    for number, x in enumerate((4.0, 10.0, 16.0, 22.0)):
        y = np.arange(4.0, 57.0)[:: -1 if number % 2 else 1]
        legs.append(np.column_stack([np.full(len(y), x), y]))
    return np.concatenate(legs)


@cache
def floor(seed):
    return load_terrain(
        "random_field", extent=[0, SIDE, 0, SIDE], lengthscale=[9, 9], amplitude=2, mean=10,
        shape=[61, 61], seed=seed,
    )  # fmt: skip


def config(planner="puct", **options) -> MissionConfig:
    made = MissionConfig(
        planner=replace(METHODS["planner"][planner], **options),
        detector=METHODS["detector"]["gp_residual"],
        model=replace(METHODS["model"]["gp"], pilot_iterations=60),
        terrain=SurveyedConfig(name="survey-simulated", extent=[0, SIDE, 0, SIDE]),
        grid=[21, 21],
        robot=steered(RADIUS, STEP, 15.0),
    )
    return replace(made, detector=replace(made.detector, scope="historical"))


def sensed(x, seed, stream):
    rng = np.random.default_rng([seed, stream])
    return floor(seed).elevation_at(*x.T) + rng.normal(0, NOISE, len(x))


def believed(seed, **changes) -> Belief:
    """Teach a belief a survey of the west, two spikes in it."""
    x = lines()
    depth = sensed(x, seed, 0)
    depth[[30, 130]] += 8.0
    mission = replace(config(), **changes)
    all_but_last, last = slice(0, -1), slice(-1, None)
    pilot, end = (
        Readings(x[part], headings(x)[part], depth[part], None) for part in (all_but_last, last)
    )
    belief = Belief(mission, (0.0, SIDE, 0.0, SIDE), seed, pilot, AREA.obstacles)
    belief.learn(end)
    return belief


def ahead(planner, seed, samples=SAMPLES, belief=None, plans=1, **options):
    belief = belief or believed(seed)
    pose = np.append(belief.readings.x[-1], belief.readings.heading[-1])
    made = config(planner, **options)
    return look_ahead(belief, made, pose, samples, plans=plans, any_heading=True)


@cache
def flown(planner, seed):
    return ahead(planner, seed, plans=8 if planner == "puct" else 1)


def gathered(track, seed):
    """Deviation before anything was driven, summed over the samples: by the belief alone."""
    std = believed_once(seed).model.predict(track.poses[1:, :2])[1]
    return float(std.sum())


@cache
def believed_once(seed):
    return believed(seed)


def test_a_track_has_its_length_and_keeps_to_the_area():
    for planner in ("puct", "random", "lawnmower"):
        track = flown(planner, 0)
        x = track.poses[:, :2]
        assert len(x) == SAMPLES + 1
        assert np.hypot(*np.diff(x, axis=0).T) == pytest.approx(STEP)
        assert x[0].tolist() == lines()[-1].tolist()
        between = np.linspace(x[:-1], x[1:], 11).reshape(-1, 2)
        assert Outline(BORDER).contains_points(between[1:]).all()
        assert not Outline(ZONE).contains_points(between).any()


def test_no_three_samples_lie_on_a_circle_tighter_than_the_turning_radius():
    for planner in ("puct", "random"):
        a, b, c = (flown(planner, 0).poses[i : SAMPLES - 1 + i, :2] for i in range(3))
        sides = [np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (c, a))]
        double_area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        radius = np.prod(sides, axis=0) / np.maximum(2 * double_area, 1e-300)
        assert radius.min() > RADIUS * (1 - 1e-6)
        assert radius.min() < 1.25 * RADIUS  # what the vehicle can do is made use of


@pytest.mark.parametrize(("radius", "speed"), [(5, 1), (4, 0.7), (30, 1), (1, 0.99), (0.2, 1)])
def test_the_tightest_turn_closes_a_circle_of_at_least_the_radius(radius, speed):
    turn = tightest_turn(radius, speed)
    share = 2 * np.pi / turn
    assert share == pytest.approx(round(share), abs=1e-9)
    assert speed / (2 * np.sin(turn / 2)) >= radius * (1 - 1e-9)
    assert turn <= np.pi / 3 + 1e-9
    if speed < radius:  # and hardly wider than needed
        assert 2 * np.pi / (share - 1) > 2 * np.arcsin(speed / (2 * radius))


def test_the_deviation_shrinks_where_the_track_has_been_and_as_the_model_says():
    belief = believed(0)
    mean = belief.mean.copy()
    track = ahead("puct", 0, belief=belief)
    free = ~np.isnan(track.std_after)
    assert free.ravel().tolist() == AREA.holds(belief.nodes).tolist()
    fall = (track.std_before - track.std_after)[free]
    assert fall.min() > -1e-6
    passed = near(belief.nodes[free.ravel()], track.poses[:, :2], 1.5)
    assert fall[passed].mean() > 2 * fall[~passed].mean()
    # The deviation does not depend on what is measured: that of any measurements is the same.
    again = believed(0)
    again.model.append(track.poses[1:, :2], np.zeros(SAMPLES))
    expected = again.model.predict(belief.nodes)[1]
    assert track.std_after[free] == pytest.approx(expected[free.ravel()], rel=1e-6)
    # What is believed does not move the mean.
    moved = np.abs(belief.model.predict(belief.nodes)[0] - mean).max()
    assert moved < 1e-3 * np.ptp(mean)


def test_flags_attract_until_they_are_met():
    one = ahead("puct", 0, samples=60)
    assert {tuple(place) for place in one.flagged.tolist()} >= {
        tuple(place) for place in lines()[[30, 130]].tolist()
    }
    off = np.hypot(*(one.flagged[:, None] - one.poses[None, 1:, :2]).transpose(2, 0, 1)).min(axis=1)
    assert one.revisited.tolist() == (off <= STEP).tolist()
    density = []

    def recorded(scene: Situation, rng):
        assert scene.visited[scene.n_pilot - 1].tolist() == start[:2].tolist()
        density.append(float(scene.outlier_density.sum()))
        return [2]

    belief = believed(0)
    belief.flagged[:] = False
    start = np.append(belief.readings.x[-1], 0.0)
    # One flag straight ahead, one far away.
    belief.readings.x[[5, 6]] = [[start[0] + 3.0, start[1]], [4.0, 40.0]]
    belief.flagged[[5, 6]] = True
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("infoplan.lookahead.find", lambda group, options: recorded)
        straight = look_ahead(belief, config(), start, 18)
    assert straight.revisited.tolist() == [True, False]
    assert len(density) == 3
    assert density[1:] == pytest.approx([density[0] / 2] * 2, rel=0.02)


def test_puct_gathers_more_than_a_random_walk_and_a_lawnmower():
    sums, falls = {}, {}
    for planner in ("puct", "random", "lawnmower"):
        tracks = [flown(planner, seed) for seed in SEEDS]
        pairs = zip(tracks, SEEDS, strict=True)
        sums[planner] = np.array([gathered(track, seed) for track, seed in pairs])
        falls[planner] = np.array([np.nanmean(t.std_before - t.std_after) for t in tracks])
    for other in ("random", "lawnmower"):
        # Each floor is another survey; the tracks on it are of one length.
        assert (sums["puct"] > sums[other]).sum() >= len(SEEDS) - 1
        assert sums["puct"].mean() > 1.15 * sums[other].mean()
        assert (falls["puct"] > falls[other]).sum() >= len(SEEDS) - 1
        assert falls["puct"].mean() > 1.2 * falls[other].mean()


def test_of_several_plans_the_best_is_driven():
    one, many = (ahead("puct", 0, samples=60, plans=plans) for plans in (1, 8))
    assert gathered(many, 0) > gathered(one, 0)
    scene = situation(std=np.ones((15, 20)), outlier_density=np.zeros((15, 20)))
    # Nodes are 50 / 19 by 40 / 14 apart: along a row of them there are two in five units.
    along = np.column_stack([np.linspace(0, 5, 6), np.full(6, -10.0), np.zeros(6)])
    assert gain(scene, along) == pytest.approx(3 / 6)
    assert gain(scene, np.concatenate([along, along[::-1]])) == pytest.approx(3 / 12)


def test_a_survey_along_it_lowers_the_error_more_than_a_random_one():
    changes = []
    for seed in SEEDS:
        belief = believed(seed)
        free = AREA.holds(belief.nodes)
        truth = floor(seed).elevation_at(*belief.nodes[free].T)
        errors = {}
        for planner in ("puct", "random"):
            x = flown(planner, seed).poses[1:, :2]
            later = believed(seed)
            later.model.append(x, sensed(x, seed, 1))
            errors[planner] = rmse(later.model.predict(belief.nodes[free])[0], truth)
        before = rmse(belief.mean[free], truth)
        changes.append((errors["puct"] - before, errors["puct"] - errors["random"]))
    gain, beside = np.array(changes).T
    assert gain.max() < 0
    # Paired by seed, on the same floor and noise.
    assert beside.mean() < -0.15
    assert (beside < 0).sum() >= len(SEEDS) - 1


def rmse(told, truth):
    return float(np.sqrt(np.mean((told - truth) ** 2)))


@pytest.mark.parametrize("model", ["gp", "vecchia", "student_t", "rcgp", "itgp",
                                   "relevance_pursuit"])  # fmt: skip
def test_every_model_can_be_planned_with(model):
    options = replace(METHODS["model"][model], pilot_iterations=15)
    belief = believed(0, model=options, detector=METHODS["detector"]["none"])
    track = ahead("puct", 0, samples=40, belief=belief, iterations=50)
    assert len(track.poses) == 41
    assert np.nanmean(track.std_after) < np.nanmean(track.std_before)


@pytest.mark.parametrize("planner", ["uct", "weighted", "greedy", "bayes_opt", "rig_tree",
                                     "lawnmower"])  # fmt: skip
def test_every_planner_can_be_used(planner):
    track = ahead(planner, 0, samples=60)
    assert len(track.poses) == 61
    x = track.poses[:, :2]
    assert AREA.obstacles.meet(x) is None


@pytest.mark.parametrize("reward", ["ucb", "mutual_information", "variance_reduction"])
def test_every_reward_can_be_gathered(reward):
    assert len(ahead("uct", 0, samples=30, reward=reward, iterations=50).poses) == 31


def test_it_is_the_same_twice():
    first, second = ahead("puct", 1, samples=50), ahead("puct", 1, samples=50)
    assert first.poses.tolist() == second.poses.tolist()


def test_where_there_is_no_way_the_track_is_its_start():
    belief = believed(0)
    corner = np.array([59.0, 59.0, np.pi / 4])
    stuck = look_ahead(belief, config(), corner, 50, any_heading=False)
    assert len(stuck.poses) == 1
    free = look_ahead(belief, config(), corner, 50, any_heading=True)
    assert len(free.poses) == 51
    assert free.poses[0, :2].tolist() == corner[:2].tolist()
    turned = (free.poses[0, 2] - corner[2]) / (np.pi / 8)
    assert turned == pytest.approx(round(turned))


def test_a_circle_is_free_or_not():
    robot = config().robot
    scene = Situation(
        pose=np.zeros(3), std=np.ones((3, 3)), mean=np.ones((3, 3)), reward_map=np.ones((3, 3)),
        outlier_density=np.ones((3, 3)), extent=(0.0, SIDE, 0.0, SIDE), speed=robot.speed,
        samples_per_action=robot.samples_per_action,
        steering=np.array([-robot.max_steering, 0.0, robot.max_steering]),
        visited=np.zeros((1, 2)), n_pilot=1, epoch=1, budget=2,
    )  # fmt: skip
    assert can_circle(scene, np.array([30.0, 30.0, 1.0]))
    # Along the western border a circle to the right of one who goes north is free.
    assert can_circle(scene, np.array([0.5, 30.0, np.pi / 2]))
    assert not can_circle(scene, np.array([0.5, 30.0, np.pi]))
