"""What a survey takes of time and memory grows with the samples, not with their square."""

import tracemalloc
from functools import partial

import numpy as np
import pandas as pd
import pytest
from survey_logs import QUICK, write_log, write_long_log

from infoplan.analyse.audit import detector, stored
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
            peak(partial(judge, given, model, rng)) for judge in (gp_residual, local)
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


@pytest.mark.parametrize(
    "options",
    [
        ["model=vecchia"],
        ["detector=local", "model=gp", "batch=20"],
        ["model=vecchia", "batch=20", "detector.scope=batch"],
    ],
)
def test_of_a_long_log_the_audit_judges_a_part_again(tmp_path, capsys, monkeypatch, options):
    log, results = write_log(tmp_path / "bay.csv"), tmp_path / "results"
    assert main(["survey", str(log), f"results_dir={results}", *QUICK[1:], *options]) == 0
    run = next((results / "runs").glob("*.yaml")).stem

    def mission():
        return stored.read_mission(results, run, 0, {}, None, detector.replay_detector)

    whole = mission().judgements[-1]
    monkeypatch.setattr(detector, "MOST_COMPARED", 50)
    monkeypatch.setattr(detector, "CHOSEN", 12)
    part = mission()
    np.testing.assert_allclose(part.judgements[-1][0], whole[0], rtol=1e-6)
    assert part.judgements[-1][1].tolist() == whole[1].tolist()
    # Whose numbers are forged is found if flagged, and one in so many of the others.
    chosen = detector._chosen(part)
    flagged = part.samples["flagged"].to_numpy()
    judged = np.isfinite(part.samples["score"].to_numpy())
    assert chosen.sum() == flagged.sum() + 12
    for sample, found in (
        (np.flatnonzero(flagged)[0], True),
        (np.flatnonzero(chosen & ~flagged)[3], True),
        (np.flatnonzero(judged & ~chosen)[3], False),
    ):
        forged = mission()
        forged.samples.loc[sample, "score"] += 0.01
        if found:
            with pytest.raises(stored.FaultError, match=f"sample {sample} .* has the score"):
                detector.check_scores(forged)
        else:
            assert detector.check_scores(forged).omitted
    forged = mission()
    forged.samples.loc[int(np.flatnonzero(judged & ~flagged)[5]), "flagged"] = True
    with pytest.raises(stored.FaultError, match="is flagged, wrongly"):
        detector.check_flags(forged)
    capsys.readouterr()
    assert main(["audit", run, f"results_dir={results}"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    n, left = judged.sum(), judged.sum() - chosen.sum()
    assert f"{n - left} scores agree: of all flagged samples, and others drawn by the seed" in told
    assert f"not recomputed: the scores of {left} of {n} samples" in told


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["model=gp"], "the model compares 80 samples with each other, 50 are repeated"),
        (["model=vecchia", "batch=20"], "the neighbours depend on the flags of earlier epochs"),
    ],
)
def test_what_the_audit_of_a_long_log_passes_over_is_said(
    tmp_path, capsys, monkeypatch, options, sentence
):
    monkeypatch.setattr(detector, "MOST_COMPARED", 50)
    log, there = write_log(tmp_path / "bay.csv"), f"results_dir={tmp_path / 'results'}"
    assert main(["survey", str(log), there, *QUICK[1:], *options]) == 0
    assert main(["audit", there]) == 0
    assert sentence in " ".join(capsys.readouterr().out.split())


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
