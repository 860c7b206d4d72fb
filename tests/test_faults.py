"""Every fault: share, labels, sizes, stretches and state, over many seeds."""

import inspect
from dataclasses import fields
from itertools import groupby

import numpy as np
import pytest
from scipy import stats

import infoplan
from infoplan.config import METHODS, Config
from infoplan.fault import FAULTS, Sensed
from infoplan.methods import find
from infoplan.simulator import Simulator

LOWEST, HIGHEST = 200.0, 1200.0
NOISE = np.random.default_rng(7).standard_normal((200, 8000))
LASTING = {"burst": 5.0, "stuck": 10.0, "bias": 20.0, "drift": 20.0}
EVERY = sorted(set(FAULTS) - {"spike"})


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
        if name in FAULTS:
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
    if name != "local":
        assert shares.std() == pytest.approx(spread, rel=0.3)


@pytest.mark.parametrize("name", EVERY)
def test_labels_are_where_the_fault_has_changed_something(name):
    error, labels, _ = said(name, 0.3, [7] * 40, seed=3)
    np.testing.assert_array_equal(labels, error != 0)
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
