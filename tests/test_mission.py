"""The mission loop, through its records."""

import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from infoplan.config import CopodConfig, DetectorConfig
from infoplan.detect import DETECTORS
from infoplan.mission import Mission


def fly(config, terrain, seed=0):
    mission = Mission(config, terrain, seed)
    return mission, list(mission.run())


@pytest.fixture
def copod(small):
    return replace(small, detector=CopodConfig(), budget=240)


def test_rows_count_what_was_collected(copod, volcano):
    mission, rows = fly(copod, volcano)
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
    mission, rows = fly(copod, volcano)
    assert [row.collected for row in rows] == [100, 103]
    assert len(mission.samples) == 103


def test_batch_scope_never_judges_the_pilot(copod, volcano):
    copod.pilot.outliers = True
    mission, _ = fly(copod, volcano)
    pilot = mission.samples[mission.samples.epoch == 0]
    assert pilot.is_outlier.sum() == 10
    assert not pilot.flagged.any()
    assert np.isnan(pilot.score).all()


def test_historical_scope_judges_everything_again(copod, volcano):
    copod.detector.scope = "historical"
    mission, rows = fly(copod, volcano)
    samples = mission.samples
    flagged, score = DETECTORS["copod"](samples.x, samples.measured, samples.is_outlier)
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
        missions.append(fly(config, volcano)[0])
    np.testing.assert_array_equal(missions[0].samples.x, missions[1].samples.x)
    np.testing.assert_array_equal(missions[0].mean, missions[1].mean)


def test_best_drops_exactly_the_spikes_and_none_drops_nothing(small, volcano):
    for name, dropped in (("best", True), ("none", False)):
        config = replace(small, detector=DetectorConfig(name=name))
        mission, rows = fly(config, volcano)
        spikes = mission.samples.is_outlier.sum()
        assert spikes > 0
        assert rows[-1].accepted == 160 - dropped * spikes


def test_epoch_scores_follow_their_definitions(copod, volcano):
    from scipy.stats import norm

    mission, rows = fly(copod, volcano)
    truth, mean, std = mission.grid_truth, mission.mean, mission.latent_std
    row = rows[-1]
    assert row.rmse == pytest.approx(np.sqrt(np.mean((mean - truth) ** 2)))
    assert row.mae == pytest.approx(np.mean(np.abs(mean - truth)))
    assert row.nlpd == pytest.approx(-np.mean(norm.logpdf(truth, mean, std)))
    inside = (truth >= norm.ppf(0.025, mean, std)) & (truth <= norm.ppf(0.975, mean, std))
    assert row.coverage95 == pytest.approx(np.mean(inside))


def test_a_corner_does_not_hold_the_car(small, volcano):
    # The pilot ends in a corner, heading out: the car turns on the spot until an action fits.
    small.pilot.control_points = [[0.3, 0.6], [0.9, 0.4], [1.0, 1.0]]
    mission, rows = fly(small, volcano)
    assert rows[-1].collected == 160
    x = mission.samples.x
    assert x.min() >= 0
    assert x.max() <= 50
