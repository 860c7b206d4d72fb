"""Every fault: share, labels, sizes, stretches and state, over many seeds."""

import inspect
import sys
from dataclasses import fields, replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from flown import fly, short_mission, store
from scipy import stats

import infoplan
from infoplan.analyse.audit import audit_mission
from infoplan.cli import main
from infoplan.config import METHODS, Config, OwnFaultConfig
from infoplan.detect import DETECTORS
from infoplan.errors import RunError
from infoplan.fault import FAULTS, Corrupted, Sensed
from infoplan.methods import find
from infoplan.model import MODELS, GaussianProcess
from infoplan.plan import count_flags, smooth
from infoplan.simulator import Simulator
from infoplan.study.store import table_path

EXAMPLES = Path(__file__).parent.parent / "examples"
LOWEST, HIGHEST = 200.0, 1200.0
NOISE = np.random.default_rng(7).standard_normal((200, 8000))
LASTING = {"burst": 5.0, "stuck": 10.0, "bias": 20.0, "drift": 20.0, "dropout": 3.0}
EVERY = sorted(set(FAULTS) - {"spike"})
IMPURE = ("local", "mixed")  # samples do not have the same odds, or not one kind of stretch


def sensed(n, start=0, *, epoch=1, seed=0):
    """A batch along a straight track over waves, whose noise goes with the time alone."""
    time = np.arange(start, start + n, dtype=float)
    truth = 700 + 300 * np.sin(time / 9) * np.cos(time / 31)
    noise = NOISE[seed, start : start + n]
    x = np.column_stack([0.7 * time % 50, 25 + 20 * np.sin(time / 13)])
    return Sensed(x, np.zeros(n), truth, truth + noise, time, epoch, LOWEST, HIGHEST)


def said(name, rho, sizes, seed=0, sensed=sensed, **options):
    """Let a fault spoil batch after batch; returns errors, labels and what was said."""
    state, start, parts = None, 0, []
    for epoch, n in enumerate(sizes, 1):
        batch = sensed(n, start, epoch=epoch, seed=seed)
        rng = np.random.default_rng([seed, epoch])
        done = FAULTS[name](batch, state, rho, rng, **options)
        state, start = done.state, start + n
        parts.append((done.measured - batch.measured, done.is_outlier, done.measured))
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def runs(labels):
    """Lengths of the stretches that neither end of the track cuts."""
    lengths = [(value, len(list(group))) for value, group in groupby(labels)]
    return np.array([length for value, length in lengths[1:-1] if value])


def test_the_options_are_the_functions_defaults():
    for name, options in METHODS["fault"].items():
        if name in FAULTS and name != "mixed":
            default = inspect.signature(FAULTS[name]).parameters
            for item in fields(options):
                if item.name != "name":
                    value = default[item.name].default
                    value = list(value) if isinstance(value, tuple) else value
                    assert value == getattr(options, item.name), (name, item.name)


def scattered(n, start=0, *, epoch=1, seed=0):
    """A batch at random places."""
    rng = np.random.default_rng([seed, epoch])
    truth = rng.uniform(LOWEST, HIGHEST, n)
    x, time = rng.uniform(0, 50, (n, 2)), np.arange(start, start + n, dtype=float)
    return Sensed(x, np.zeros(n), truth, truth + rng.random(n), time, epoch, LOWEST, HIGHEST)


@pytest.mark.parametrize(("sizes", "rho"), [([60], 0.4), ([20] * 3, 0.05), ([1] * 25, 0.3)])
@pytest.mark.parametrize("name", EVERY)
def test_rho_is_the_expected_share_however_large_the_batches(name, rho, sizes):
    shares = np.array([said(name, rho, sizes, seed, scattered)[1].mean() for seed in range(100)])
    n = sum(sizes)
    # The first value of all is a stuck sensor's own and no outlier.
    expected = rho * (n - 1) / n if name == "stuck" else rho
    assert abs(shares.mean() - expected) < 4 * shares.std() / np.sqrt(len(shares))
    spread = np.sqrt(rho * (1 - rho) / n)
    if name in LASTING:
        memory = 1 - 1 / LASTING[name] / (1 - rho)  # between a sample and the next
        lags = np.arange(1, n)
        spread *= np.sqrt(1 + 2 * np.sum((1 - lags / n) * memory**lags))
    if name not in IMPURE:
        assert shares.std() == pytest.approx(spread, rel=0.3)


@pytest.mark.parametrize("name", EVERY)
def test_labels_are_where_the_fault_has_changed_something(name):
    error, labels, _ = said(name, 0.3, [7] * 40, seed=3)
    np.testing.assert_array_equal(labels, error != 0)
    np.testing.assert_array_equal(np.isnan(error), labels & (name == "dropout"))
    assert 20 < labels.sum() < 200
    assert not said(name, 0.0, [7] * 40, seed=3)[1].any()


@pytest.mark.parametrize("sizes", [[6000], [60] * 100])
@pytest.mark.parametrize("name", LASTING)
def test_stretches_are_as_long_as_they_are_said_to_be(name, sizes):
    lengths = runs(said(name, 0.3, sizes, seed=1)[1])
    mean = LASTING[name]
    assert len(lengths) > 50
    # Geometric: the deviation is sqrt(1 - 1 / mean) times the mean.
    assert abs(lengths.mean() - mean) < 4 * mean / np.sqrt(len(lengths))
    within = stats.geom(1 / mean).cdf(mean)
    assert np.mean(lengths <= mean) == pytest.approx(within, abs=4 * 0.5 / np.sqrt(len(lengths)))
    longer = runs(said(name, 0.3, sizes[: len(sizes) // 2 or 1], seed=1, length=60)[1])
    assert longer.mean() > 2 * mean


@pytest.mark.parametrize("cut", [[400], [13] * 31, [1] * 200])
def test_stuck_holds_the_last_value_across_batches(cut):
    _, labels, measured = said("stuck", 0.4, cut, seed=5)
    held = np.flatnonzero(labels)
    assert 0 not in held
    np.testing.assert_array_equal(measured[held], measured[held - 1])
    assert np.sum(np.diff(measured) == 0) == len(held)


@pytest.mark.parametrize("cut", [[400], [13] * 31, [1] * 200])
def test_drift_grows_by_its_rate_and_is_reset_across_batches(cut):
    error, labels, _ = said("drift", 0.4, cut, seed=5, rate=0.03)
    signs = set()
    at = 0
    for drifting, group in groupby(labels):
        n = len(list(group))
        part = error[at : at + n]
        if drifting:
            np.testing.assert_allclose(np.abs(part), 30.0 * np.arange(1, n + 1))
            assert len(set(np.sign(part))) == 1
            signs.add(np.sign(part[0]))
        at += n
    assert signs == {1, -1}


@pytest.mark.parametrize("cut", [[2000], [1] * 2000])
def test_bias_is_one_error_a_stretch_across_batches(cut):
    error, labels, _ = said("bias", 0.4, cut, seed=5, amplitude=(0.2, 0.3))
    steps, at = [], 0
    for biased, group in groupby(labels):
        n = len(list(group))
        if biased:
            np.testing.assert_allclose(error[at : at + n], error[at], atol=1e-9)
            steps.append(error[at])
        at += n
    assert len(np.unique(np.round(steps, 6))) == len(steps) > 20
    assert np.all((np.abs(steps) >= 200) & (np.abs(steps) <= 300))
    assert 0.2 < np.mean(np.array(steps) > 0) < 0.8


def test_sizes_are_drawn_as_they_are_said_to_be():
    uniform = said("uniform", 0.5, [2000], bounds=(-1.0, 0.5))
    low, width = LOWEST - 1000, 1500
    assert stats.kstest(uniform[2][uniform[1]], stats.uniform(low, width).cdf).pvalue > 1e-3
    limit = said("max_range", 0.5, [2000], level=2.0)
    assert set(limit[2][limit[1]]) == {2200.0}
    tail = said("heavy_tail", 0.5, [2000], dof=3.0, scale=0.1)
    assert stats.kstest(tail[0][tail[1]] / 100, stats.t(3).cdf).pvalue > 1e-3
    for name in ("burst", "local"):
        error, labels, _ = said(name, 0.5, [2000], amplitude=(0.5, 2.0))
        size = np.abs(error[labels])
        assert stats.kstest(size, stats.uniform(500, 1500).cdf).pvalue > 1e-3
        assert np.mean(error[labels] > 0) == pytest.approx(0.5, abs=0.08)


def test_local_outliers_are_where_the_regions_are():
    regions = [0.0, 10.0, 0.0, 50.0, 30.0, 35.0, 20.0, 50.0]
    sizes = [20] * 300
    labels = said("local", 0.1, sizes, regions=regions, factor=8.0)[1]
    x = np.concatenate([sensed(20, 20 * i).x for i in range(300)])
    inside = (x[:, 0] <= 10) | ((x[:, 0] >= 30) & (x[:, 0] <= 35) & (x[:, 1] >= 20))
    share, rest = labels[inside].mean(), labels[~inside].mean()
    error = np.hypot(1 / np.sqrt(share * inside.sum()), 1 / np.sqrt(rest * np.sum(~inside)))
    assert abs(np.log(share / rest / 8.0)) < 4 * error
    # Ground outside of all regions is spared, whole batches of it.
    spared = said("local", 0.1, [100] * 20, regions=[200.0, 300.0, 0.0, 50.0], factor=1e9)[1]
    assert spared.mean() == pytest.approx(0.1, abs=0.03)  # there is no worse ground


@pytest.mark.parametrize("size", [10, 500])
def test_local_outliers_are_on_steep_ground(size):
    sizes = [size] * (6000 // size)
    labels = said("local", 0.1, sizes, factor=20.0)[1]
    batch = sensed(6000)
    slope = np.abs(np.diff(batch.truth)) / np.linalg.norm(np.diff(batch.x, axis=0), axis=1)
    slope = np.append(slope[0], slope)
    third = np.quantile(slope, [1 / 3, 2 / 3])
    flat, steep = labels[slope < third[0]].mean(), labels[slope > third[1]].mean()
    weight = 1 + 19 * slope / slope.max()
    expected = weight[slope > third[1]].mean() / weight[slope < third[0]].mean()
    assert steep / flat == pytest.approx(expected, rel=0.3)


@pytest.mark.parametrize("name", EVERY)
def test_a_fault_leaves_track_and_noise_alone(name, volcano):
    poses = np.column_stack([np.linspace(5, 45, 30), np.full(30, 25.0), np.zeros(30)])
    batches = {}
    for choice in ("spike", name):
        config = Config(fault=METHODS["fault"][choice], rho=0.3)
        simulator = Simulator(config, volcano, seed=4)
        batches[choice] = [
            simulator.pilot(),
            simulator.sample(1, poses),
            simulator.sample(2, poses),
        ]
    for plain, spoilt in zip(batches["spike"], batches[name], strict=True):
        sound = ~(plain.is_outlier | spoilt.is_outlier)
        np.testing.assert_array_equal(plain.measured[sound], spoilt.measured[sound])
        assert sound.any()
    assert not batches[name][0].is_outlier.any()
    assert any(batch.is_outlier.any() for batch in batches[name][1:])


def test_sizes_are_in_ranges_of_the_terrain():
    terrain = infoplan.load_terrain("volcano")
    config = infoplan.configure("terrain=volcano", "fault=max_range", "rho=1", "fault.level=3")
    simulator = Simulator(config, terrain, seed=4)
    truth = simulator.grid_truth
    batch = simulator.sample(1, np.array([[20.0, 20.0, 0.0]]))
    assert batch.measured[0] == pytest.approx(truth.min() + 3 * (truth.max() - truth.min()))


@pytest.mark.parametrize("name", LASTING)
def test_a_share_out_of_reach_is_refused(name):
    length = 3.0
    assert infoplan.configure(f"fault={name}", f"fault.length={length}", "rho=0.75").rho == 0.75
    with pytest.raises(infoplan.UsageError, match=r"rho is at most 0\.75$"):
        infoplan.configure(f"fault={name}", f"fault.length={length}", "rho=0.76")
    # At the bound a single sound sample parts one stretch from the next.
    fault = find("fault", infoplan.configure(f"fault={name}", "fault.length=3").fault)
    labels = fault(sensed(3000), None, 0.75, np.random.default_rng(0)).is_outlier
    assert runs(~labels).max() == 1


@pytest.mark.parametrize("regions", ["[1,2]", "[5,1,0,9]", "[0,1,2,3,0,1,9,9]"])
def test_regions_are_rectangles(regions):
    with pytest.raises(infoplan.UsageError, match="are no rectangles"):
        infoplan.configure("fault=local", f"fault.regions={regions}")


def test_the_faults_of_a_mixture_have_their_weights():
    one = {"options": {"burst": {"amplitude": [5.0, 6.0]}, "max_range": {"level": 9.0}}}
    shares = []
    for seed in range(60):
        error, labels, measured = said(
            "mixed", 0.3, [30, 30], seed, faults=["burst", "max_range", "spike"],
            weights=[1.0, 3.0, 2.0], **one,
        )  # fmt: skip
        limit, burst = measured == LOWEST + 9000, (np.abs(error) > 4999) & (measured < 8000)
        shares.append([labels.mean(), limit.mean(), burst.mean()])
    # 0.7 is the product of what each leaves; the spike, the last, has the last word.
    left = 0.7 ** (np.array([1, 3, 2]) / 6)
    expected = [0.3, (1 - left[1]) * left[2], (1 - left[0]) * left[1] * left[2]]
    deviation = np.std(shares, axis=0) / np.sqrt(len(shares))
    assert np.all(np.abs(np.mean(shares, axis=0) - expected) < 4 * deviation)


def test_a_mixture_of_one_is_that_one():
    alone = said("mixed", 0.4, [9] * 30, faults=["stuck"], options={"stuck": {"length": 4.0}})
    held = np.flatnonzero(alone[1])
    np.testing.assert_array_equal(alone[2][held], alone[2][held - 1])
    assert runs(alone[1]).mean() == pytest.approx(4.0, abs=2.0)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["fault.weights=[1,2]"], "give one weight for each, or none"),
        (["fault.weights=[1,0,1]"], "above 0"),
        (["fault.faults=[]"], "use one or several of"),
        (["fault.faults=[mixed]"], "use one or several of"),
        (["fault.options.drift.rate=1"], "fault.options.drift has no use"),
        (["fault.options.burst.size=1"], "must be a mapping of amplitude, length"),
        (["fault.options.burst.length=0"], "fault.options.burst.length=0 is out of bounds"),
        (["fault.options.burst.length=x"], "fault.options.burst.length=x is not possible"),
        (["fault.options.burst.amplitude=[2,1]"], "the wrong way round"),
        (["rho=1"], "out of reach of fault=burst"),
    ],
)
def test_a_wrong_mixture_is_one_sentence(words, sentence):
    with pytest.raises(infoplan.UsageError) as refused:
        infoplan.configure("fault=mixed", *words)
    assert sentence in str(refused.value)


def test_what_is_not_measured_reaches_neither_detector_nor_model(volcano, monkeypatch):
    """Every detector sees numbers alone; such samples are flagged, counted and not used."""
    given = []

    class Model(GaussianProcess):
        def __init__(self, x, y, **options):
            given.append(y)
            super().__init__(x, y, **options)

        def append(self, x, y):
            given.append(y)
            super().append(x, y)

        def replace(self, x, y):
            given.append(y)
            super().replace(x, y)

    def asked(samples, model, rng):
        given.append(samples.measured)
        assert len(samples.x) == len(samples.epoch) == len(samples.flagged) == len(samples)
        return samples.measured > 2900, samples.measured

    monkeypatch.setitem(MODELS, "gp", Model)
    monkeypatch.setitem(DETECTORS, "none", asked)
    for scope in ("batch", "historical"):
        config = short_mission(detector="none", rho=0.5, budget=180)
        config.detector.scope = scope
        config.pilot = replace(config.pilot, outliers=True)
        config.fault = METHODS["fault"]["dropout"]
        states = fly(config, volcano, seed=2)
        samples, row = states[-1].samples, states[-1].row
        silent = np.isnan(samples.measured)
        np.testing.assert_array_equal(silent, samples.is_outlier)
        assert 50 < silent.sum() < 130
        assert silent[samples.epoch == 0].any()
        assert samples.flagged[silent].all()
        assert np.isnan(samples.score[silent]).all()
        judged = ~silent & ((samples.epoch > 0) | (scope == "historical"))
        np.testing.assert_array_equal(samples.flagged[judged], samples.measured[judged] > 2900)
        assert row.accepted == np.sum(~samples.flagged)
        assert sum(state.row.tp for state in states) >= silent[samples.epoch > 0].sum()
        assert all(np.isfinite(values).all() for values in given)
        counts = count_flags(samples.x[samples.flagged], volcano.extent, tuple(config.grid))
        expected = smooth(counts, config.planner.smoothing, volcano.extent)
        np.testing.assert_allclose(states[-1].maps.outlier_density, expected.ravel(), atol=1e-12)
    assert len(given) > 10


@pytest.mark.parametrize("detector", ["copod", "best"])
def test_a_mission_of_dropouts_is_stored_audited_replayed_and_told(detector, volcano, tmp_path):
    config = short_mission(detector=detector, rho=0.4, budget=160)
    config.pilot = replace(config.pilot, outliers=True)
    config.fault = METHODS["fault"]["dropout"]
    run = store(tmp_path, config, volcano)
    findings = audit_mission(tmp_path, run, 0)
    assert not [finding for finding in findings if not finding.holds]
    [share] = [finding for finding in findings if finding.check == "outlier share"]
    assert share.detail.endswith("dropout")
    flown = pd.read_parquet(table_path(tmp_path, "samples", run, 0), partitioning=None)
    assert flown["measured"].isna().sum() > 20
    words = ["detector=local", "n_jobs=1", "backend=sequential", f"results_dir={tmp_path}"]
    assert main(["replay", run, *words]) == 0
    assert main(["audit", f"results_dir={tmp_path}"]) == 0


def test_a_pilot_without_measurements_fails_in_one_sentence(volcano):
    config = short_mission(rho=0.99)
    config.pilot = replace(config.pilot, outliers=True)
    config.fault = replace(METHODS["fault"]["dropout"], length=1e5)
    with pytest.raises(RunError, match=r"^only 0 of the 100 pilot samples have a measurement"):
        fly(config, volcano)


def test_own_faults_are_flown_and_not_called_for_stored_runs(volcano, tmp_path, monkeypatch):
    monkeypatch.chdir(EXAMPLES)
    config = short_mission(detector="none", rho=0.2, budget=160)
    config.fault = OwnFaultConfig(function="own_fault.echo", options={"delay": 4})
    run = store(tmp_path, config, volcano)
    assert "-echo-" in run
    samples = pd.read_parquet(table_path(tmp_path, "samples", run, 0), partitioning=None)
    outliers = np.flatnonzero(samples["is_outlier"])
    assert 2 < len(outliers) < 30
    said, epoch = samples["measured"].to_numpy(), samples["epoch"].to_numpy()
    assert np.all(epoch[outliers - 4] > 0)
    plain = outliers[~samples["is_outlier"].to_numpy()[outliers - 4]]
    np.testing.assert_array_equal(said[plain], said[plain - 4])
    monkeypatch.setattr(sys.modules["own_fault"], "echo", None)
    told = {finding.check: finding for finding in audit_mission(tmp_path, run, 0)}
    assert all(finding.holds for finding in told.values())
    assert told["outlier errors"].omitted == "the errors: the fault is the user's own"
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "own_fault")
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(EXAMPLES)])
    words = ["detector=local", "n_jobs=1", "backend=sequential", f"results_dir={tmp_path}"]
    assert main(["replay", run, *words]) == 0
    [again] = tmp_path.glob("runs/replay-*.yaml")
    assert yaml.safe_load(again.read_text())["fault"]["function"] == "own_fault.echo"
    assert "own_fault" not in sys.modules


def two_numbers(sensed, state, rho, rng):
    return sensed.measured, np.zeros(len(sensed), dtype=bool)


def too_short(sensed, state, rho, rng):
    return Corrupted(sensed.measured[1:], np.zeros(len(sensed), dtype=bool))


def no_booleans(sensed, state, rho, rng):
    return Corrupted(sensed.measured, np.zeros(len(sensed)))


def secretive(sensed, state, rho, rng):
    return Corrupted(sensed.measured + 1, np.zeros(len(sensed), dtype=bool))


def broken(sensed, state, rho, rng):
    raise OSError("no link")


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (two_numbers, "the fault two_numbers gave tuple: it must return a Corrupted"),
        (too_short, "the fault too_short gave measurements of shape (9,)"),
        (no_booleans, "labels of type float64"),
        (secretive, "the fault secretive calls samples sound that it has changed"),
        (broken, "the fault broken failed in epoch 1: OSError: no link (test_faults.py, line"),
    ],
)
def test_what_an_own_fault_gives_is_checked(fault, sentence, volcano):
    config = short_mission(detector="none", budget=110)
    config.fault = OwnFaultConfig(function=f"{__name__}.{fault.__name__}")
    with pytest.raises(RunError) as refused:
        fly(config, volcano)
    assert sentence in str(refused.value)
