"""The tree search against a plain-Python version of the paper's text, and by hand."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import reference_search
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from infoplan.plan import most_visited_actions, pareto_ucb, search, ucb
from infoplan.robot import drive, steering_angles, turn_on_the_spot

SQUARE = (0.0, 10.0, 0.0, 10.0)
DEFAULTS = {
    "speed": 0.7,
    "samples_per_action": 10,
    "steering": steering_angles(0.15, 5),
    "iterations": 500,
    "rollouts": 5,
    "exploration": 0.3,
}
STRAIGHT = {
    "speed": 1.0,
    "samples_per_action": 1,
    "steering": [0.0],
    "iterations": 1,
    "rollouts": 0,
    "exploration": 0.3,
}


def make_maps(seed, kind, shape):
    rng = np.random.default_rng(seed)
    if kind == "smooth":
        return rng.random(shape)
    if kind == "ties":
        return rng.integers(0, 3, shape).astype(float)
    if kind == "sparse":
        return (rng.random(shape) < 0.1).astype(float)
    return np.zeros(shape)


@st.composite
def problems(draw):
    """Draw a pose, often in a corner or at a border, and all arguments of a search."""
    pareto = draw(st.booleans())
    extent = draw(
        st.sampled_from([SQUARE, (0.0, 50.0, 0.0, 50.0), (-3.0, 4.0, 2.5, 21.0), (0.1, 0.7, 0, 3)])
    )
    shape = (
        draw(st.integers(1, 3)) if pareto else 1,
        draw(st.integers(1, 12)),
        draw(st.integers(1, 12)),
    )
    kind = draw(st.sampled_from(["smooth", "ties", "sparse", "zero"]))
    maps = make_maps(draw(st.integers(0, 1000)), kind, shape)
    fraction = st.one_of(st.sampled_from([0.0, 0.02, 0.5, 0.98, 1.0]), st.floats(0.0, 1.0))
    xmin, xmax, ymin, ymax = extent
    heading = st.one_of(
        st.sampled_from([k * math.pi / 4 for k in range(8)]),
        st.floats(0.0, 2.0 * math.pi, exclude_max=True),
    )
    pose = (
        min(xmax, xmin + draw(fraction) * (xmax - xmin)),
        min(ymax, ymin + draw(fraction) * (ymax - ymin)),
        draw(heading),
    )
    step = draw(st.floats(0.01, 0.3)) * (xmax - xmin)
    samples = draw(st.integers(1, 4))
    options = {
        "speed": step / samples,
        "samples_per_action": samples,
        "steering": steering_angles(draw(st.floats(0.0, 1.2)), draw(st.integers(1, 6))),
        "iterations": draw(st.integers(1, 60)),
        "rollouts": draw(st.integers(0, 4)),
        "exploration": draw(st.sampled_from([0.0, 0.1, 0.3, 1.0, 5.0])),
        "pareto": pareto,
        "rollout_step": draw(st.sampled_from(["action", "sample"])),
        "average": draw(st.sampled_from(["driven", "planned"])),
        "border": draw(st.sampled_from(["struck", "visit", "terminal"])),
    }
    return pose, maps, extent, options


def reference(pose, maps, extent, options, rng):
    """Run the plain-Python search and lay its tree out as arrays."""
    lists = {"reward_maps": maps.tolist(), "steering": list(map(float, options["steering"]))}
    nodes = reference_search.search(
        reference_search.Settings(extent=extent, **{**options, **lists}), pose, rng
    )
    index = {node: i for i, node in enumerate(nodes)}
    child = [
        [
            -1 if action in node.untried else index.get(node.children.get(action), -2)
            for action in range(len(lists["steering"]))
        ]
        for node in nodes
    ]
    arrays = {
        "pose": [node.pose for node in nodes],
        "parent": [index.get(node.parent, -1) for node in nodes],
        "action": [node.action for node in nodes],
        "child": child,
        "terminal": [node.is_terminal for node in nodes],
        "visits": [node.visits for node in nodes],
        "reward": [node.rewards for node in nodes],
    }
    return nodes[0], arrays


def assert_same_as_reference(pose, maps, extent, options, seed):
    rng, reference_rng = np.random.default_rng(seed), np.random.default_rng(seed)
    tree = search(pose, maps, extent, rng=rng, **options)
    root, expected = reference(pose, maps, extent, options, reference_rng)
    assert tree.size[0] == len(expected["visits"])
    for name, value in expected.items():
        np.testing.assert_array_equal(getattr(tree, name), value, err_msg=name)
    plan = most_visited_actions(tree, rng)
    assert plan.tolist() == reference_search.most_visited_actions(root, reference_rng)
    assert rng.random() == reference_rng.random()


@settings(max_examples=300, deadline=None)
@given(problem=problems(), seed=st.integers(0, 2**32 - 1))
def test_same_tree_as_the_plain_python_search(problem, seed):
    assert_same_as_reference(*problem, seed)


@pytest.mark.parametrize("pareto", [False, True])
@pytest.mark.parametrize("pose", [(25.0, 25.0, 1.0), (49.0, 30.0, 1.3)])
def test_same_tree_at_the_default_settings(pareto, pose):
    maps = make_maps(3, "smooth", (2 if pareto else 1, 50, 50))
    assert_same_as_reference(pose, maps, (0.0, 50.0, 0.0, 50.0), {**DEFAULTS, "pareto": pareto}, 7)


@settings(max_examples=100, deadline=None)
@given(problem=problems(), seed=st.integers(0, 1000))
def test_tree_is_consistent(problem, seed):
    pose, maps, extent, options = problem
    tree = search(pose, maps, extent, rng=np.random.default_rng(seed), **options)
    n = tree.size[0]
    assert all(len(array) == n for array in tree[:-1])
    assert tree.visits[0] == options["iterations"]
    inside = (tree.pose[:, 0] >= extent[0]) & (tree.pose[:, 0] <= extent[1])
    inside &= (tree.pose[:, 1] >= extent[2]) & (tree.pose[:, 1] <= extent[3])
    np.testing.assert_array_equal(tree.terminal, ~inside)
    assert options["border"] == "terminal" or not tree.terminal.any()
    assert np.all((tree.pose[:, 2] >= 0.0) & (tree.pose[:, 2] < 2.0 * math.pi))
    for node in range(n):
        children = tree.child[node][tree.child[node] > 0]
        passed_on = tree.visits[children].sum()
        if tree.terminal[node]:
            assert len(children) == 0
            assert not tree.reward[node].any()
        # A node's first visit is its own expansion; a dead end keeps all its visits.
        if len(children):
            spent = (tree.child[node] == -2).sum() if options["border"] == "visit" else 0
            assert tree.visits[node] == passed_on + (node != 0) + spent
    for node in range(1, n):
        parent, action = tree.parent[node], tree.action[node]
        assert parent < node
        assert tree.child[parent, action] == node
        driven = drive(
            tree.pose[parent],
            [action],
            options["steering"],
            options["speed"],
            options["samples_per_action"],
        )
        if not tree.terminal[node]:
            assert driven[-1].tolist() == tree.pose[node].tolist()


@settings(max_examples=50, deadline=None)
@given(problem=problems(), seed=st.integers(0, 1000))
def test_unit_of_the_rewards_does_not_matter(problem, seed):
    pose, maps, extent, options = problem
    tree = search(pose, maps, extent, rng=np.random.default_rng(seed), **options)
    scaled = search(pose, 4.0 * maps, extent, rng=np.random.default_rng(seed), **options)
    np.testing.assert_array_equal(scaled.visits, tree.visits)
    np.testing.assert_array_equal(scaled.reward, 4.0 * tree.reward)


def test_pareto_search_of_one_objective_is_the_plain_one():
    maps = make_maps(1, "smooth", (1, 50, 50))
    trees = [
        search(
            (20.0, 30.0, 2.0),
            maps,
            (0, 50, 0, 50),
            rng=np.random.default_rng(2),
            pareto=pareto,
            **DEFAULTS,
        )
        for pareto in (False, True)
    ]
    for plain, pareto_array in zip(*trees, strict=True):
        np.testing.assert_array_equal(plain, pareto_array)


def test_ucb_by_hand():
    assert ucb(1.0, 0.5, 10, 4) == pytest.approx(1.0 + 0.5 * 1.0729830131446737)
    assert ucb(2.0, 3.0, 1, 1) == 2.0
    assert ucb(0.25, 0.0, 100, 1) == 0.25


def test_pareto_ucb_by_hand():
    # (4 ln 10 + ln 2) / (2 * 4) = (9.210340372 + 0.693147181) / 8 = 1.237935944
    assert pareto_ucb(1.0, 0.5, 10, 4, 2) == pytest.approx(1.0 + 0.5 * math.sqrt(1.237935944))
    assert pareto_ucb(2.0, 3.0, 1, 1, 1) == 2.0
    assert pareto_ucb(0.7, 0.3, 37, 5, 1) == ucb(0.7, 0.3, 37, 5)


def columns_map():
    """Return one map whose value is the column's index: the reward at x is round(x)."""
    return np.tile(np.arange(11.0), (11, 1))[None]


@pytest.mark.parametrize(
    ("start", "rollouts", "samples", "expected"),
    [
        (0.0, 0, 1, 1.0),
        (0.0, 3, 1, (1 + 2 + 3 + 4) / 4),
        (8.0, 3, 1, (9 + 10) / 2),  # the border itself is inside
        (0.0, 2, 2, ((1 + 2) + (3 + 4) + (5 + 6)) / 3),
        (6.0, 5, 3, 7 + 8 + 9),  # a rollout that would leave half-way counts nothing
    ],
)
def test_reward_is_the_mean_over_the_actions_driven(start, rollouts, samples, expected):
    options = {**STRAIGHT, "rollouts": rollouts, "samples_per_action": samples}
    tree = search(
        (start, 5.0, 0.0),
        columns_map(),
        SQUARE,
        pareto=False,
        rng=np.random.default_rng(0),
        **options,
    )
    assert tree.reward.tolist() == [[expected], [expected]]
    assert tree.visits.tolist() == [1, 1]


@pytest.mark.parametrize(
    ("start", "rollouts", "samples", "average", "step", "expected"),
    [
        (8.0, 3, 1, "planned", "action", (9 + 10) / 4),
        (6.0, 5, 3, "planned", "action", (7 + 8 + 9) / 6),
        (0.0, 3, 1, "planned", "action", (1 + 2 + 3 + 4) / 4),  # no border, no difference
        (0.0, 2, 2, "driven", "sample", (1 + 2 + 3 + 4) / 2),  # 2 samples and 2 more: 2 actions
        (6.0, 5, 3, "driven", "sample", (7 + 8 + 9 + 10) / (4 / 3)),
        (6.0, 5, 3, "planned", "sample", (7 + 8 + 9 + 10) / (8 / 3)),
    ],
)
def test_reward_of_the_other_readings(start, rollouts, samples, average, step, expected):
    options = {**STRAIGHT, "rollouts": rollouts, "samples_per_action": samples}
    tree = search(
        (start, 5.0, 0.0), columns_map(), SQUARE, pareto=False, rng=np.random.default_rng(0),
        average=average, rollout_step=step, **options,
    )  # fmt: skip
    np.testing.assert_allclose(tree.reward, [[expected], [expected]], rtol=1e-15)


def test_rollouts_go_straight_even_without_a_straight_action():
    options = {**STRAIGHT, "steering": [-0.5, 0.5], "rollouts": 2}
    tree = search(
        (0.0, 5.0, 0.0),
        columns_map(),
        SQUARE,
        pareto=False,
        rng=np.random.default_rng(0),
        **options,
    )
    # One step ahead, then two along the turned heading: x = 1, 1.88, 2.76, so columns 1, 2, 3.
    assert tree.reward[0].tolist() == [2.0]


def test_dead_end_down_the_tree_counts_visits_without_reward():
    options = {**STRAIGHT, "iterations": 15}
    tree = search(
        (0.0, 5.0, 0.0),
        np.ones((1, 11, 11)),
        SQUARE,
        pareto=False,
        rng=np.random.default_rng(0),
        **options,
    )
    # Ten steps reach the border; the last node has one visit as a leaf and five as a dead end.
    assert tree.size[0] == 11
    assert tree.visits.tolist() == [15, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6]
    assert tree.reward[:, 0].tolist() == [10, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1]
    assert tree.child[-1].tolist() == [-2]


def search_at_the_border(border, **changes):
    """Search from where straight ahead only the border awaits."""
    return search(
        (49.0, 25.0, math.pi / 4),
        make_maps(0, "smooth", (1, 50, 50)),
        (0, 50, 0, 50),
        pareto=False,
        border=border,
        rng=np.random.default_rng(0),
        **{**DEFAULTS, "iterations": 20, "steering": steering_angles(0.5, 5), **changes},
    )


def test_struck_actions_cost_no_iteration():
    tree = search_at_the_border("struck")
    assert (tree.child == -2).any()
    assert tree.size[0] == 21
    assert not tree.terminal.any()


def test_each_border_action_costs_one_visit():
    tree = search_at_the_border("visit")
    struck = (tree.child == -2).sum()
    assert struck > 0
    assert tree.size[0] == 21 - struck
    assert tree.visits[0] == 20


def test_a_terminal_node_is_visited_again_and_never_planned():
    tree = search_at_the_border("terminal", iterations=400, exploration=2.0)
    assert tree.terminal.any()
    assert not tree.reward[tree.terminal].any()
    assert tree.visits[tree.terminal].max() > 1
    assert not (tree.child[~tree.terminal] == -2).any()
    plan = most_visited_actions(tree, np.random.default_rng(1))
    track = drive(np.array([49.0, 25.0, math.pi / 4]), plan, steering_angles(0.5, 5), 0.7, 10)
    assert len(plan)
    assert np.all((track[:, :2] >= 0.0) & (track[:, :2] <= 50.0))


def test_root_whose_actions_are_all_terminal_has_no_plan():
    rng = np.random.default_rng(0)
    tree = search(
        (50.0, 50.0, math.pi / 4), np.ones((1, 50, 50)), (0, 50, 0, 50), pareto=False, rng=rng,
        border="terminal", **DEFAULTS,
    )  # fmt: skip
    assert tree.terminal.tolist() == [False] + 5 * [True]
    assert tree.visits.sum() == 2 * 500
    assert len(most_visited_actions(tree, rng)) == 0


def test_root_that_is_a_dead_end_has_no_plan_until_turned():
    pose = np.array([50.0, 50.0, math.pi / 4])
    turns = 0
    while turns < 16:
        rng = np.random.default_rng(turns)
        tree = search(pose, np.ones((1, 50, 50)), (0, 50, 0, 50), pareto=False, rng=rng, **DEFAULTS)
        actions = most_visited_actions(tree, rng)
        if len(actions):
            break
        assert tree.size[0] == 1
        assert tree.visits.tolist() == [500]
        assert tree.reward.tolist() == [[0.0]]
        assert tree.child.tolist() == [[-2] * 5]
        pose = turn_on_the_spot(pose)
        turns += 1
    assert 1 <= turns < 16
    trajectory = drive(pose, actions, DEFAULTS["steering"], 0.7, 10)
    assert np.all((trajectory[:, :2] >= 0.0) & (trajectory[:, :2] <= 50.0))


def draws(count, choice):
    """Count what a choice gives over many seeds, as observed frequencies."""
    chosen = [choice(np.random.default_rng(seed)) for seed in range(count)]
    return np.bincount(chosen, minlength=5)


def zero_reward_search(iterations, rng, pareto):
    maps = np.zeros((2 if pareto else 1, 50, 50))
    options = {**DEFAULTS, "iterations": iterations, "pareto": pareto}
    return search((25.0, 25.0, 0.0), maps, (0, 50, 0, 50), rng=rng, **options)


@pytest.mark.parametrize("pareto", [False, True])
def test_ties_are_drawn_uniformly(pareto):
    def first_expanded(rng):
        return zero_reward_search(1, rng, pareto).action[1]

    def first_selected(rng):
        tree = zero_reward_search(6, rng, pareto)
        return tree.action[tree.parent[6]]

    def first_planned(rng):
        return most_visited_actions(zero_reward_search(5, rng, pareto), rng)[0]

    for choice in (first_expanded, first_selected, first_planned):
        frequencies = draws(2000, choice)
        assert len(frequencies) == 5
        assert chisquare(frequencies).pvalue > 1e-3


def test_best_reward_is_found():
    # Reward lies to the left of the car: most visits and the plan's first action turn left.
    maps = np.zeros((1, 50, 50))
    maps[0, 30:, :] = 1.0
    rng = np.random.default_rng(0)
    tree = search((10.0, 25.0, 0.0), maps, (0, 50, 0, 50), pareto=False, rng=rng, **DEFAULTS)
    assert most_visited_actions(tree, rng)[0] == 4


def test_pareto_search_serves_both_objectives_and_leaves_the_dominated():
    # One objective to the left, one to the right, nothing ahead.
    maps = np.zeros((2, 50, 50))
    maps[0, 32:, :] = 1.0
    maps[1, :18, :] = 1.0
    tree = search(
        (10.0, 25.0, 0.0),
        maps,
        (0, 50, 0, 50),
        pareto=True,
        rng=np.random.default_rng(0),
        **{**DEFAULTS, "exploration": 0.05},
    )
    right, ahead, left = tree.visits[tree.child[0][[0, 2, 4]]]
    assert min(right, left) > 5 * ahead


def test_golden_tree():
    golden = json.loads((Path(__file__).parent / "golden_tree.json").read_text())
    tree = search(
        golden["pose"],
        make_maps(5, "smooth", (2, 20, 20)),
        SQUARE,
        rng=np.random.default_rng(11),
        **{**DEFAULTS, "speed": 0.2, "iterations": 40, "pareto": True},
    )
    for name in ("parent", "action", "child", "visits"):
        assert getattr(tree, name).tolist() == golden[name]
    np.testing.assert_allclose(tree.reward, golden["reward"], rtol=1e-12)
    np.testing.assert_allclose(tree.pose[-1], golden["last_pose"], rtol=1e-12)


def test_ucb_refuses_several_objectives():
    with pytest.raises(ValueError, match="one reward map, not 2"):
        search(
            (5.0, 5.0, 0.0),
            np.ones((2, 5, 5)),
            SQUARE,
            pareto=False,
            rng=np.random.default_rng(0),
            **DEFAULTS,
        )


def test_start_outside_the_workspace_is_refused():
    with pytest.raises(ValueError, match="outside the workspace"):
        search(
            (10.5, 5.0, 0.0),
            np.ones((1, 5, 5)),
            SQUARE,
            pareto=False,
            rng=np.random.default_rng(0),
            **DEFAULTS,
        )
