"""What a survey takes of time and memory grows with the samples, not with their square."""

import tracemalloc
from functools import partial

import numpy as np
import pandas as pd
import pytest
from survey_logs import QUICK, write_log, write_long_log

from infoplan.cli import main
from infoplan.collapse import spacing_along
from infoplan.detect import Evidence, gp_residual, local
from infoplan.model import VecchiaProcess
from infoplan.study import surveys


def evidence(samples, path):
    columns = pd.read_csv(write_long_log(path, samples))
    x, y = columns[["x", "y"]].to_numpy(), columns["depth"].to_numpy(copy=True)
    everything = np.ones(samples, dtype=bool)
    return Evidence(x, y, np.zeros(samples, int), ~everything, everything, None)


def peak(function):
    tracemalloc.start()
    try:
        function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_detectors_take_memory_by_the_sample(tmp_path):
    """Four times the samples: not eight times the memory, where the square would be sixteen."""
    peaks = {}
    for samples in (750, 3000):
        given = evidence(samples, tmp_path / "log.csv")
        model = VecchiaProcess(given.x, given.measured, noise_variance=1e-3)
        rng = np.random.default_rng(0)
        gp_residual(given, model, rng)  # compiled, and imported
        peaks[samples] = [
            peak(partial(detector, given, model, rng)) for detector in (gp_residual, local)
        ]  # fmt: skip
    for few, many in zip(peaks[750], peaks[3000], strict=True):
        assert many < 8 * few
        assert many < 0.8 * 8 * 3000**2  # one matrix of all pairs


@pytest.mark.parametrize("one_by_one", [True, False])
def test_a_sparse_inverse_judges_as_the_whole(tmp_path, one_by_one):
    given = evidence(600, tmp_path / "log.csv")
    given.measured[200:215] -= 5  # the sounder out of the water
    model = VecchiaProcess(given.x, given.measured, noise_variance=1e-3)

    class Dense:
        weights_and_inverse = staticmethod(model.weights_and_inverse)

    rng = np.random.default_rng(0)
    sparse = gp_residual(given, model, rng, one_by_one=one_by_one)
    dense = gp_residual(given, Dense(), rng, one_by_one=one_by_one)
    assert sparse[0][200:215].all()
    assert sparse[0].tolist() == dense[0].tolist()
    np.testing.assert_allclose(sparse[1], dense[1], rtol=1e-12)
    # By the definition: without those that were dropped, what do the others say of each?
    if one_by_one:
        weights, inverse = model.weights_and_inverse(given.x, given.measured, np.arange(600))
        kept = ~sparse[0]
        covariance = np.linalg.inv(inverse)
        precision = np.linalg.inv(covariance[np.ix_(kept, kept)])
        scaled = (covariance @ weights)[kept]
        expected = np.abs(precision @ scaled) / np.sqrt(np.diag(precision))
        np.testing.assert_allclose(sparse[1][kept], expected, rtol=1e-5)


def test_a_model_of_all_pairs_says_where_it_ends(tmp_path, capsys, monkeypatch):
    log = write_long_log(tmp_path / "log.csv", 600)
    monkeypatch.setattr(surveys, "LONGEST", 1e-5)
    words = ["survey", str(log), f"results_dir={tmp_path / 'results'}"]
    assert main([*words, "model=gp"]) == 2
    told = capsys.readouterr().err
    assert "model=gp works with all pairs of samples: 600 take about" in told
    assert "it stops being sensible here; use model=vecchia" in told
    assert not (tmp_path / "results" / "curves").exists()


def test_a_collapsed_survey_is_told_and_its_floor_counts_in_its_own_steps(tmp_path, capsys):
    log = write_log(tmp_path / "bay.csv")
    words = ["survey", str(log), f"results_dir={tmp_path}/results", *QUICK,
             "model.pilot_iterations=0", "model.iterations=0"]  # fmt: skip
    assert main([*words, "model.lengthscale=0.01"]) == 0
    assert "its model has collapsed" in capsys.readouterr().out.replace("\n", " ")
    assert main([*words, "model.lengthscale=0.01", "model.min_lengthscale=2"]) == 0
    assert "its model has collapsed" not in capsys.readouterr().out.replace("\n", " ")
    for path in (tmp_path / "results" / "curves").glob("*/seed=0.parquet"):
        run = path.parent.name
        curve = pd.read_parquet(path)
        samples = pd.read_parquet(tmp_path / "results" / "samples" / run / "seed=0.parquet")
        pilot = samples[samples["epoch"] == 0][["x1", "x2"]].to_numpy()
        steps = np.hypot(*np.diff(pilot, axis=0).T)
        metres = curve["lengthscale_1"].iloc[-1] * np.ptp(pilot[:, 0]) / 2
        if not curve["collapsed"].iloc[-1]:
            assert metres == pytest.approx(2 * np.median(steps))
        assert spacing_along(pilot) == pytest.approx(np.median(steps))
    assert curve["collapsed"].notna().all()
    assert main(["audit", f"results_dir={tmp_path}/results"]) == 0
    capsys.readouterr()
    assert main(["show", run.removeprefix("run="), f"results_dir={tmp_path}/results"]) == 0
    header = capsys.readouterr().out.partition("RMSE")[0]
    assert "robot." not in header
    assert "pilot.samples" not in header


@pytest.mark.long
def test_fifty_thousand_samples_from_the_command_line(tmp_path):
    log = write_long_log(tmp_path / "log.csv", 50_000)
    results = tmp_path / "results"
    assert main(["survey", str(log), f"results_dir={results}"]) == 0
    samples = pd.read_parquet(next(results.glob("samples/*/seed=0.parquet")))
    spikes = np.arange(100, 50_000, 200)
    assert samples["flagged"][spikes].mean() > 0.95
    assert samples["flagged"].sum() < 2 * len(spikes)
    clean = pd.read_csv(next(results.glob("surveys/*/clean.csv")))
    assert len(clean) == 50_000
