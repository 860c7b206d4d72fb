"""The mission loop, through its records."""

import copy
import math
import warnings
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from flown import fly

from infoplan.belief import Belief
from infoplan.config import METHODS, CopodConfig, DetectorConfig, LocalConfig
from infoplan.detect import DETECTORS, Evidence
from infoplan.errors import RunError
from infoplan.mission import explore
from infoplan.model import MODELS
from infoplan.plan import PLANNERS
from infoplan.simulator import Simulator


def flown(config, terrain):
    """Rows and last state of a mission."""
    states = fly(config, terrain)
    return [state.row for state in states], states[-1]


@pytest.fixture
def copod(small):
    return replace(small, detector=CopodConfig(), budget=240)


def test_rows_count_what_was_collected(copod, volcano):
    rows, mission = flown(copod, volcano)
    assert rows[0].epoch == 0
    assert rows[0].collected == rows[0].accepted == 100
    assert (rows[0].tp, rows[0].fp, rows[0].fn, rows[0].tn) == (0, 0, 0, 0)
    assert rows[-1].collected == 240 == len(mission.samples)
    for before, row in pairwise(rows):
        batch = mission.samples[mission.samples.epoch == row.epoch]
        assert row.collected - before.collected == len(batch)
        assert row.tp + row.fp + row.fn + row.tn == len(batch)
        assert row.accepted - before.accepted == row.fn + row.tn
        assert row.tp + row.fn == batch.is_outlier.sum()


def test_the_batch_is_cut_to_the_budget(copod, volcano):
    copod.budget = 103
    rows, mission = flown(copod, volcano)
    assert [row.collected for row in rows] == [100, 103]
    assert len(mission.samples) == 103


def test_batch_scope_never_judges_the_pilot(copod, volcano):
    copod.pilot.outliers = True
    _, mission = flown(copod, volcano)
    pilot = mission.samples[mission.samples.epoch == 0]
    assert pilot.is_outlier.sum() == 10
    assert not pilot.flagged.any()
    assert np.isnan(pilot.score).all()


@pytest.mark.parametrize("scope", ["batch", "historical"])
def test_a_judged_pilot_teaches_the_model_what_is_not_flagged(copod, volcano, scope):
    copod.pilot.outliers = True
    copod.detector = CopodConfig(scope=scope, judge_pilot=True, contamination=0.2)
    states = fly(copod, volcano)
    pilot = states[0].samples
    told, scores = DETECTORS["copod"](
        Evidence(
            pilot.x, pilot.measured, pilot.epoch, np.zeros(100, dtype=bool),
            np.ones(100, dtype=bool), pilot.is_outlier,
        ),
        None, np.random.default_rng(0), contamination=0.2,
    )  # fmt: skip
    np.testing.assert_array_equal(pilot.flagged, told)
    np.testing.assert_array_equal(pilot.score, scores)
    row = states[0].row
    assert row.accepted == np.sum(~told) == row.fn + row.tn
    assert row.tp == np.sum(told & pilot.is_outlier) > 0
    assert row.tp + row.fp == told.sum()
    assert states[0].maps.outlier_density.sum() > 0

    model = MODELS["gp"](pilot.x, pilot.measured)  # scaled by all of them
    model.replace(pilot.x[~told], pilot.measured[~told])
    model.optimize(copod.model.pilot_iterations)
    learned = model.hyperparameters
    assert row.amplitude == pytest.approx(learned.amplitude, rel=1e-9)
    assert row.noise_std == pytest.approx(learned.noise_std, rel=1e-9)
    mean, _ = model.predict(states[0].maps.x)
    np.testing.assert_allclose(states[0].maps.mean, mean, rtol=1e-9)
    # At scope batch the verdict stays, at scope historical all is judged again.
    last = states[-1].samples.flagged[:100]
    assert np.array_equal(last, told) == (scope == "batch")


@pytest.mark.parametrize("optimizer", ["adam", "lbfgs"])
@pytest.mark.parametrize("model", ["gp", "student_t", "vecchia", "rcgp"])
def test_without_iterations_an_epoch_leaves_the_hyperparameters(small, volcano, model, optimizer):
    small.model = replace(
        METHODS["model"][model], pilot_iterations=10, iterations=0, optimizer=optimizer
    )
    small.budget = 150
    rows, _ = flown(small, volcano)
    learned = {(r.amplitude, r.lengthscale_1, r.lengthscale_2, r.noise_std) for r in rows}
    assert len(rows) > 1
    assert len(learned) == 1
    assert rows[-1].rmse != rows[0].rmse


def test_the_best_detector_judges_the_pilot_where_that_is_asked_for(small, volcano):
    small.pilot.outliers, small.budget = True, 160
    small.detector = DetectorConfig(name="best", judge_pilot=True)
    _, mission = flown(small, volcano)
    np.testing.assert_array_equal(mission.samples.flagged, mission.samples.is_outlier)
    assert mission.samples.flagged[:100].sum() == 10


def test_a_detector_of_a_judged_pilot_may_ask_the_model_of_all_of_it(small, volcano, monkeypatch):
    held, judge = [], DETECTORS["gp_residual"]

    def spy(samples, model, rng, **options):
        held.append(model.n_data)
        return judge(samples, model, rng, **options)

    monkeypatch.setitem(DETECTORS, "gp_residual", spy)
    small.pilot.outliers, small.budget = True, 130
    small.detector = replace(METHODS["detector"]["gp_residual"], judge_pilot=True, threshold=1.5)
    rows, _ = flown(small, volcano)
    assert held[0] == 100 > rows[0].accepted == held[1]


def test_a_pilot_of_which_nothing_is_left_fails_in_one_sentence(small, volcano, monkeypatch):
    def everything(samples, model, rng, **options):
        return np.ones(len(samples), dtype=bool), np.zeros(len(samples))

    monkeypatch.setitem(DETECTORS, "best", everything)
    small.detector = DetectorConfig(name="best", judge_pilot=True)
    with pytest.raises(RunError, match=r"best leaves 0 of the 100 samples of the pilot.*needs 3"):
        fly(small, volcano)


def test_historical_scope_judges_everything_again(copod, volcano):
    copod.detector.scope = "historical"
    rows, mission = flown(copod, volcano)
    samples = mission.samples
    nothing = np.zeros(len(samples), dtype=bool)
    evidence = Evidence(
        samples.x, samples.measured, samples.epoch, nothing, ~nothing, samples.is_outlier
    )
    flagged, score = DETECTORS["copod"](evidence, None, np.random.default_rng(0))
    np.testing.assert_array_equal(samples.flagged, flagged)
    np.testing.assert_array_equal(samples.score, score)
    for row in rows[1:]:
        assert row.tp + row.fp + row.fn + row.tn == row.collected
        assert row.accepted == row.fn + row.tn


@pytest.mark.parametrize("name", ["none", "best"])
def test_both_scopes_are_one_mission_for_detectors_that_need_no_data(small, volcano, name):
    missions = []
    for scope in ("batch", "historical"):
        config = replace(copy.deepcopy(small), detector=DetectorConfig(name=name, scope=scope))
        missions.append(fly(config, volcano)[-1])
    np.testing.assert_array_equal(missions[0].samples.x, missions[1].samples.x)
    np.testing.assert_array_equal(missions[0].maps.mean, missions[1].maps.mean)


def test_best_drops_exactly_the_spikes_and_none_drops_nothing(small, volcano):
    for name, dropped in (("best", True), ("none", False)):
        config = replace(small, detector=DetectorConfig(name=name))
        rows, mission = flown(config, volcano)
        spikes = mission.samples.is_outlier.sum()
        assert spikes > 0
        assert rows[-1].accepted == 160 - dropped * spikes


def test_epoch_scores_follow_their_definitions(copod, volcano):
    from scipy.stats import norm

    rows, mission = flown(copod, volcano)
    truth, mean, std = mission.maps.truth, mission.maps.mean, mission.maps.std
    row = rows[-1]
    assert row.rmse == pytest.approx(np.sqrt(np.mean((mean - truth) ** 2)))
    assert row.mae == pytest.approx(np.mean(np.abs(mean - truth)))
    assert row.nlpd == pytest.approx(-np.mean(norm.logpdf(truth, mean, std)))
    inside = (truth >= norm.ppf(0.025, mean, std)) & (truth <= norm.ppf(0.975, mean, std))
    assert row.coverage95 == pytest.approx(np.mean(inside))
    assert row.smse == pytest.approx(np.mean((mean - truth) ** 2) / np.var(truth))
    held = mission.samples.measured[~mission.samples.flagged]
    trivial = -np.mean(norm.logpdf(truth, held.mean(), held.std()))
    assert row.msll == pytest.approx(row.nlpd - trivial)
    x = mission.samples.x
    assert row.path_length == pytest.approx(sum(map(math.dist, x, x[1:])))
    assert rows[0].path_length < row.path_length
    squares = np.square([row.rmse_flat, row.rmse_middle, row.rmse_rugged])
    assert np.mean((mean - truth) ** 2) == pytest.approx(squares.mean(), rel=0.05)


@pytest.mark.parametrize("planner", [name for name in METHODS["planner"] if name != "own"])
def test_a_corner_does_not_hold_the_car(small, volcano, planner):
    # The pilot ends in a corner, heading out: the car turns on the spot until an action fits.
    small.pilot.control_points = [[0.3, 0.6], [0.9, 0.4], [1.0, 1.0]]
    small.planner = METHODS["planner"][planner]
    rows, mission = flown(small, volcano)
    assert rows[-1].collected == 160
    x = mission.samples.x
    assert x.min() >= 0
    assert x.max() <= 50


@pytest.mark.parametrize("planner", [name for name in METHODS["planner"] if name != "own"])
def test_whole_actions_and_no_more_than_asked_for(small, volcano, planner):
    small.planner = replace(METHODS["planner"][planner], execute_actions=2)
    small.budget = 190
    rows, _ = flown(small, volcano)
    sizes = np.diff([row.collected for row in rows])
    assert set(sizes[:-1].tolist()) <= {10, 20}
    assert sizes.sum() == 90


def test_no_way_out_is_an_error_and_no_endless_loop(small, volcano):
    # Not even half a side holds an action: `validate` refuses that, a mission alone must end.
    small.robot = replace(small.robot, speed=9.0)
    with pytest.raises(RunError, match="no action stays in the workspace, whatever the heading"):
        fly(small, volcano)


@pytest.mark.parametrize("scope", ["batch", "historical"])
def test_what_a_detector_is_given(small, volcano, scope, monkeypatch):
    small.detector = LocalConfig(scope=scope, threshold=1.0)
    small.budget = 260
    detector, seen = DETECTORS["local"], []

    def spy(samples, model, rng, **options):
        # The verdicts are shown, not given: later ones are seen there, too.
        samples = replace(samples, flagged=samples.flagged.copy())
        seen.append((samples, model.n_data, rng.random()))
        return detector(samples, model, rng, **options)

    monkeypatch.setitem(DETECTORS, "local", spy)
    rows, mission = flown(small, volcano)
    assert len(seen) == len(rows) - 1 > 1
    assert len({drawn for *_, drawn in seen}) == len(seen)
    for row, before, (samples, held, _) in zip(rows[1:], rows, seen, strict=False):
        n = row.collected
        whole = mission.samples
        np.testing.assert_array_equal(samples.measured, whole.measured[:n])
        np.testing.assert_array_equal(samples.x, whole.x[:n])
        np.testing.assert_array_equal(samples.is_outlier, whole.is_outlier[:n])
        new = samples.epoch == row.epoch
        np.testing.assert_array_equal(samples.judged, new | (scope == "historical"))
        assert held == before.accepted  # the model has not seen the batch
        candidates = n if scope == "historical" else before.accepted + new.sum()
        assert samples.candidates.sum() == candidates
        with pytest.raises(ValueError, match="read-only"):
            samples.measured[0] = 0.0
    assert mission.samples.flagged.sum() > 0


def test_what_a_planner_is_given(copod, volcano, monkeypatch):
    planner, seen = PLANNERS["puct"], []

    def spy(situation, rng, **options):
        seen.append(situation)
        return planner(situation, rng, **options)

    monkeypatch.setitem(PLANNERS, "puct", spy)
    states = fly(copod, volcano)
    rows, mission = [state.row for state in states], states[-1]
    # One that turns on the spot is asked again in the same epoch.
    assert sorted({situation.epoch for situation in seen}) == [row.epoch for row in rows[1:]]
    for situation in seen:
        maps = states[situation.epoch - 1].maps
        n = rows[situation.epoch - 1].collected
        np.testing.assert_array_equal(situation.visited, mission.samples.x[:n])
        np.testing.assert_array_equal(situation.pose[:2], mission.samples.x[n - 1])
        np.testing.assert_array_equal(situation.std.ravel(), maps.std)
        np.testing.assert_array_equal(situation.outlier_density.ravel(), maps.outlier_density)
        assert situation.std.shape == (12, 12)
        assert (situation.n_pilot, situation.budget) == (100, 240)
        assert situation.extent == volcano.extent


class Blind(Simulator):
    """A robot that nobody tells the truth."""

    def sample(self, epoch, trajectory):
        batch = super().sample(epoch, trajectory)
        return replace(batch, truth=np.full(len(batch), np.nan))


def test_a_belief_needs_no_truth(copod, volcano):
    seen = fly(copod, volcano)[-1]
    source = Blind(copod, volcano, 0)
    source.grid_truth = np.full_like(source.grid_truth, np.nan)
    *_, blind = explore(copod, source, 0)
    assert np.isnan([blind.row.rmse, blind.row.nlpd, *blind.samples.truth]).all()
    for name in ("x", "measured", "flagged", "score"):
        np.testing.assert_array_equal(getattr(blind.samples, name), getattr(seen.samples, name))
    np.testing.assert_array_equal(blind.maps.mean, seen.maps.mean)


def test_accepted_counts_what_the_model_holds(copod, volcano):
    for scope in ("batch", "historical"):
        copod.detector.scope = scope
        simulator = Simulator(copod, volcano, 0)
        belief = Belief(copod, volcano.extent, 0, simulator.pilot().readings())
        for epoch, state in enumerate(fly(copod, volcano)):
            if epoch:
                belief.learn(simulator.sample(epoch, belief.plan()).readings())
            assert state.row.accepted == belief.model.n_data


def test_detectors_that_draw_are_repeated_by_their_seed(small, volcano):
    small.detector = replace(METHODS["detector"]["pyod"], model="IForest", scope="historical")
    scores = [fly(small, volcano, seed)[-1].samples.score for seed in (1, 1, 2)]
    np.testing.assert_array_equal(scores[0], scores[1])
    assert (scores[0] != scores[2]).any()


class Beside:
    """A model that predicts one value everywhere; like one of the user's."""

    hyperparameters = SimpleNamespace(amplitude=1.0)

    def __init__(self, x, y, *, mean=0.0, std=1.0):
        self.answer = mean, std

    def append(self, x, y):
        pass

    replace = append

    def optimize(self, iterations):
        pass

    def predict(self, x):
        return tuple(np.full(len(x), value) for value in self.answer)


@pytest.mark.parametrize(
    ("mean", "std", "name"), [(1e200, 1.0, "rmse"), (-1e308, 1.0, "rmse"), (0.0, 1e-200, "nlpd")]
)
def test_an_error_that_overflows_fails_the_mission(small, volcano, mean, std, name, monkeypatch):
    monkeypatch.setitem(MODELS, "gp", lambda x, y, **_: Beside(x, y, mean=mean, std=std))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.raises(RunError, match=f"the {name} of the model gp overflows: it predicts"):
            fly(small, volcano)


def test_a_far_off_prediction_is_a_large_error(small, volcano, monkeypatch):
    monkeypatch.setitem(MODELS, "gp", lambda x, y, **_: Beside(x, y, mean=1e150, std=1e150))
    assert fly(small, volcano)[0].row.rmse == pytest.approx(1e150)


@pytest.mark.parametrize("amplitude", [[1e308, 1e308], [1e150, 1e150]])
def test_spikes_beyond_all_numbers_are_one_sentence(small, volcano, amplitude):
    small = replace(small, fault=replace(small.fault, amplitude=amplitude), rho=0.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.raises(RunError, match=r"fault\.amplitude"):
            fly(small, volcano)
