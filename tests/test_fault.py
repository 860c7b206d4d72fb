"""Noise, spikes and the seam of faults against the paper's description."""

from dataclasses import dataclass

import numpy as np
import pytest
from flown import store
from hypothesis import given
from hypothesis import strategies as st

import infoplan
from infoplan.analyse.audit import audit
from infoplan.analyse.configurations import stored_options
from infoplan.config import METHODS, FaultConfig, SpikeConfig
from infoplan.fault import FAULTS, Corrupted, Sensed, spike
from infoplan.method_identity import method_of
from infoplan.options import option
from infoplan.simulator import Simulator, measure
from infoplan.study.identity import config_from_science, identify


def add_spikes(measured, rho, rng, **options):
    n = len(measured)
    sensed = Sensed(
        np.zeros((n, 2)), np.zeros(n), measured, measured, np.arange(n) * 1.0, 1, 0.0, 1.0
    )
    said = spike(sensed, None, rho, rng, **options)
    return said.measured, said.is_outlier


batches = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=60).map(np.array)


def test_noise_has_the_stated_deviation():
    truth = np.full(100_000, 500.0)
    measured = measure(truth, 3.0, np.random.default_rng(0))
    assert abs(np.mean(measured - truth)) < 0.05
    assert np.std(measured - truth) == pytest.approx(3.0, rel=0.02)


@given(batches, st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_spikes_are_the_stated_share_and_size(batch, rho, seed):
    spiked, is_outlier = add_spikes(batch, rho, np.random.default_rng(seed))
    assert abs(is_outlier.sum() - rho * len(batch)) <= 0.5
    np.testing.assert_array_equal(spiked[~is_outlier], batch[~is_outlier])
    low, high = np.quantile(batch, [0.05, 0.95])
    size = np.abs(spiked - batch)[is_outlier]
    slack = 1e-9 * np.abs(batch).max()
    assert np.all(size >= 1 * (high - low) - slack)
    assert np.all(size <= 2 * (high - low) + slack)


@pytest.mark.parametrize(
    ("rule", "rho", "n", "expected"),
    [
        ("round", 0.05, 10, 0),
        ("round", 0.05, 11, 1),
        ("round", 0.15, 10, 2),
        ("round", 0.15, 30, 4),
        ("floor", 0.05, 19, 0),
        ("floor", 0.15, 20, 3),
        ("floor", 0.29, 100, 29),
        ("round", 1.0, 7, 7),
        ("bernoulli", 1.0, 7, 7),
        ("bernoulli", 0.0, 7, 0),
    ],
)
def test_number_of_spikes(rule, rho, n, expected):
    _, is_outlier = add_spikes(np.arange(n) * 1.0, rho, np.random.default_rng(0), count=rule)
    assert is_outlier.sum() == expected


def test_signs_and_places_are_even_and_bernoulli_has_its_rate():
    rng = np.random.default_rng(1)
    batch = np.linspace(0, 100, 50)
    ups, places, numbers = [], np.zeros(50), []
    for _ in range(2000):
        spiked, is_outlier = add_spikes(batch, 0.2, rng, count="bernoulli")
        ups.extend(spiked[is_outlier] > batch[is_outlier])
        places += is_outlier
        numbers.append(is_outlier.sum())
    assert np.mean(ups) == pytest.approx(0.5, abs=0.02)
    assert np.mean(numbers) == pytest.approx(10, abs=0.3)
    assert np.all(np.abs(places / 2000 - 0.2) < 0.05)


def test_amplitude_and_quantiles_are_used():
    batch = np.linspace(0, 100, 101)
    spiked, is_outlier = add_spikes(
        batch, 0.5, np.random.default_rng(0), amplitude=(3.0, 3.0), quantiles=(0.25, 0.75)
    )
    np.testing.assert_allclose(np.abs(spiked - batch)[is_outlier], 150.0)


def test_spikes_of_a_batch_may_share_amplitude_and_sign():
    batch, rng, sizes = np.zeros(40) + np.arange(40), np.random.default_rng(0), []
    for _ in range(200):
        spiked, is_outlier = add_spikes(batch, 0.25, rng, draw="batch")
        size = (spiked - batch)[is_outlier]
        np.testing.assert_allclose(size, size[0])
        sizes.append(size[0])
    low, high = np.quantile(batch, [0.05, 0.95])
    assert (high - low) <= np.abs(sizes).min() < 1.05 * (high - low)
    assert 1.95 * (high - low) < np.abs(sizes).max() <= 2 * (high - low)
    assert 70 < np.sum(np.array(sizes) > 0) < 130


@dataclass
class HoldConfig(FaultConfig):
    """A sensor that holds its last value, batch after batch."""

    name: str = option("hold", "fault", choices=("hold",))
    every: int = option(7, "samples between two that are held", at_least=2)


def hold(sensed, state, rho, rng, *, every):
    """Say again what was said before at each multiple of a time; the state is the last word."""
    assert rho == 0.25
    measured, is_outlier = sensed.measured.copy(), sensed.time % every == 0
    for i in np.flatnonzero(is_outlier):
        measured[i] = measured[i - 1] if i else (measured[0] if state is None else state)
    return Corrupted(measured, is_outlier, state=measured[-1])


@pytest.fixture
def holding(monkeypatch):
    monkeypatch.setitem(METHODS["fault"], "hold", HoldConfig())
    monkeypatch.setitem(FAULTS, "hold", hold)
    config = infoplan.configure("terrain=volcano", "rho=0.25", "pilot.samples=40", "budget=200")
    config.fault = HoldConfig(every=5)
    return config


def test_a_fault_remembers_from_batch_to_batch_and_knows_the_time(holding):
    simulator = Simulator(holding, infoplan.load_terrain("volcano"), seed=3)
    pilot = simulator.pilot()
    assert not pilot.is_outlier.any()
    poses = np.column_stack([np.linspace(10, 20, 7), np.full(7, 25.0), np.zeros(7)])
    first, second, third = (simulator.sample(epoch, poses) for epoch in (1, 2, 3))
    # Samples 40 to 46, 47 to 53 and 54 to 60 of the mission.
    assert np.flatnonzero(first.is_outlier).tolist() == [0, 5]
    assert np.flatnonzero(second.is_outlier).tolist() == [3]
    assert np.flatnonzero(third.is_outlier).tolist() == [1, 6]
    assert second.measured[3] == second.measured[2]
    holding.fault.every = 42
    simulator = Simulator(holding, infoplan.load_terrain("volcano"), seed=3)
    simulator.pilot()
    before, held = simulator.sample(1, poses[:2]), simulator.sample(2, poses)
    assert held.measured[0] == before.measured[-1]


def test_the_audit_tells_that_another_fault_is_not_recomputed(holding, tmp_path):
    terrain = infoplan.load_terrain("volcano")
    holding.budget, holding.grid = 70, [12, 12]
    holding.planner.iterations, holding.model.pilot_iterations = 20, 20
    store(tmp_path, holding, terrain)
    findings = list(audit(tmp_path, terrains={terrain.sha256: terrain.elevation}))
    assert [finding for finding in findings if not finding.holds] == []
    partial = {finding.check: finding.omitted for finding in findings if finding.omitted}
    assert partial == {
        "outlier share": "the share: nothing is known of fault=hold",
        "outlier errors": "the errors: nothing is known of fault=hold",
    }


def test_a_mission_with_another_fault_is_a_run_of_its_own(holding):
    terrain = infoplan.load_terrain("volcano")
    run = identify(holding, terrain)
    assert "-hold-" in run.name
    assert run.science["fault"] == {"name": "hold", "every": 5}
    assert "outliers" not in run.science
    assert config_from_science(run.science).fault == holding.fault
    method = method_of(stored_options(run.science))
    assert method.label == "PUCT-COPOD-HOLD"
    spiky = identify(infoplan.configure("terrain=volcano"), terrain)
    assert method_of(stored_options(spiky.science)).label == "PUCT-COPOD"
    assert spiky.science["outliers"] == {
        "count": "round", "amplitude": [1.0, 2.0], "quantiles": [0.05, 0.95],
    }  # fmt: skip
    assert "fault" not in spiky.science
    assert config_from_science(spiky.science).fault == SpikeConfig()


def test_the_pilot_is_spoilt_only_where_that_is_asked_for(holding):
    holding.pilot.outliers = True
    pilot = Simulator(holding, infoplan.load_terrain("volcano"), seed=3).pilot()
    assert np.flatnonzero(pilot.is_outlier).tolist() == list(range(0, 40, 5))


def test_the_name_of_before_is_understood():
    assert infoplan.configure("outliers.count=floor").fault.count == "floor"
    assert infoplan.configure(**{"outliers.amplitude": [3, 4]}).fault.amplitude == [3.0, 4.0]
