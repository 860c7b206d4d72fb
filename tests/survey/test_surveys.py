"""A log becomes a run like any other, without a truth; its verdicts and map are right."""

import os
import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image, ImageColor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from survey_logs import QUICK, SPIKES, write_log

from infoplan.analyse.detector_check import check_detectors
from infoplan.cli import main
from infoplan.palette import MARKS
from infoplan.study.surveys import headings, survey_config, survey_samples
from infoplan.survey import read_logs

pyproj = pytest.importorskip("pyproj")

BOAT = Path(os.environ.get("INFOPLAN_DATA", "nowhere")) / "boat"


def survey(folder: Path, log: Path, *options: str) -> str:
    """Survey a log; returns the run's name."""
    before = {path.stem for path in folder.glob("results/runs/*.yaml")}
    assert main(["survey", str(log), f"results_dir={folder / 'results'}", *options]) == 0
    after = {path.stem for path in folder.glob("results/runs/*.yaml")} - before
    return after.pop() if after else ""


def table(folder: Path, name: str, run: str) -> pd.DataFrame:
    return pd.read_parquet(folder / "results" / name / f"run={run}" / "seed=0.parquet")


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with one survey, and its run."""
    folder = tmp_path_factory.mktemp("survey")
    log = write_log(folder / "bay.csv")
    return folder, survey(folder, log, *QUICK)


def test_a_survey_is_a_run_without_truth(done):
    folder, run = done
    assert re.fullmatch("survey-bay-gp_residual-historical-[0-9a-f]{8}", run)
    samples, curves, maps = (table(folder, name, run) for name in ("samples", "curves", "maps"))
    log = pd.read_csv(folder / "bay.csv")
    assert samples["measured"].tolist() == log["Depth (ft)"].tolist()
    assert samples["is_outlier"].isna().all()
    assert np.flatnonzero(samples["flagged"]).tolist() == list(SPIKES)
    assert samples["truth"].isna().all()
    assert maps["truth"].isna().all()
    assert (
        curves[["rmse", "mae", "nlpd", "coverage95", "tp", "fp", "fn", "tn"]]
        .isna()
        .to_numpy()
        .all()
    )
    assert curves["accepted"].tolist() == [79, 77]
    assert (maps["std"] > 0).all()
    steps = samples[["x1", "x2"]].diff().to_numpy()[1:]
    geodesic = pyproj.Geod(ellps="WGS84").inv(
        log["Longitude"][:-1], log["Latitude"][:-1], log["Longitude"][1:], log["Latitude"][1:]
    )[2]
    # A UTM zone is true to scale within 0.1 %.
    assert np.hypot(*steps.T) == pytest.approx(geodesic, rel=1e-3)


def test_the_same_survey_is_kept_and_another_log_or_option_is_another_run(done, capsys, tmp_path):
    folder, _ = done
    assert survey(folder, folder / "bay.csv", *QUICK) == ""
    told = capsys.readouterr().out
    assert "1 of 1 missions are there already" in told
    (onwards,) = re.findall("infoplan (next .*)", told)
    assert main([*shlex.split(onwards), "planner.iterations=30"]) == 0
    capsys.readouterr()
    columns = "columns={value: Depth (ft), time: time, lon: Longitude, lat: Latitude}"
    assert survey(folder, folder / "bay.csv", *QUICK, columns) == ""
    assert "WARNING" not in capsys.readouterr().out, "the columns that are found anyway"
    changed = tmp_path / "bay.csv"
    changed.write_bytes((folder / "bay.csv").read_bytes() + b"# one byte more\n")
    assert survey(folder, changed, *QUICK).startswith("survey-bay-")
    assert survey(folder, folder / "bay.csv", *QUICK, "batch=20").startswith("survey-bay-")
    assert survey(folder, folder / "bay.csv", *QUICK, "crs=EPSG:32620").startswith("survey-bay-")


def test_batches_by_samples_and_by_seconds(tmp_path):
    log = write_log(tmp_path / "bay.csv")
    by_samples = survey(tmp_path, log, *QUICK, "batch=30")
    by_seconds = survey(tmp_path, log, *QUICK, "batch=30s")
    assert table(tmp_path, "curves", by_samples)["collected"].tolist() == [30, 60, 80]
    columns = ["epoch", "measured", "score", "flagged"]
    first, second = (table(tmp_path, "samples", run)[columns] for run in (by_samples, by_seconds))
    pd.testing.assert_frame_equal(first, second)
    assert set(np.flatnonzero(first["flagged"])) >= set(SPIKES)


def test_the_scores_are_those_of_scikit_learn(done):
    folder, run = done
    samples, stretches = table(folder, "samples", run), table(folder, "stretches", run)
    row = table(folder, "curves", run).iloc[-1]
    pilot, used = samples["epoch"] == 0, samples["used"].to_numpy()
    x, y = samples[["x1", "x2"]], samples["measured"]
    low, high = x[pilot].min(), x[pilot].max()
    x = (2 * (x - low) / (high - low) - 1).to_numpy()
    centre, scale = y[pilot].mean(), y[pilot].std(ddof=0)
    y = ((y - centre) / scale).to_numpy()
    kernel = ConstantKernel(row["amplitude"] ** 2) * RBF(
        [float(row["lengthscale_1"]), float(row["lengthscale_2"])]
    )

    def errors(source, asked):
        model = GaussianProcessRegressor(
            kernel, alpha=row["noise_std"] ** 2 + row["jitter"], optimizer=None
        )
        return scale * (model.fit(x[source], y[source]).predict(x[asked]) - y[asked])

    part, index = np.arange(80) // 8, np.arange(80)
    last = stretches[stretches["epoch"] == 1].set_index("stretch")
    assert len(last) == 10
    for number in (2, 5):
        here = used & (part == number)
        expected = {
            "rmse": errors(used & ~here, here),
            "rmse_unfiltered": errors(part != number, here),
            "loo_rmse": np.array([errors(used & (index != i), [i])[0] for i in index[here]]),
        }
        assert last["samples"][number] == here.sum() == 7
        for name, found in expected.items():
            assert last[name][number] == pytest.approx(np.sqrt(np.mean(found**2)), rel=1e-6)


def test_every_command_takes_it_and_says_where_there_is_no_truth(done, capsys):
    folder, run = done
    there = [f"results_dir={folder / 'results'}"]
    assert main(["show", run, *there]) == 0
    told = capsys.readouterr().out
    assert "nobody knows the truth of a survey" in told
    assert "learning is not finished" in told
    assert "infoplan explain" not in told, "which takes no survey"
    assert main(["status", *there]) == 0
    assert run in capsys.readouterr().out.replace("\n", "")
    assert main(["audit", run, *there]) == 0
    told = capsys.readouterr().out
    assert "stretches         holds" in told
    assert "not recomputed: nobody knows the truth of a survey" in told
    assert main(["report", f"run={run}", *there]) == 0
    page = (folder / "results" / "report.html").read_text()
    assert "Cross-validated RMSE" in page
    assert "claims need the truth, and nobody knows the truth of a survey" in page
    assert main(["animate", run, *there]) == 0
    assert (folder / "results" / "figures" / f"{run}-seed0.gif").stat().st_size > 10_000
    capsys.readouterr()
    for command in (["claims", "run=" + run], ["figures", "fig5", "run=" + run], ["leaderboard"]):
        assert main([*command, *there]) == 2
        assert "nobody knows the truth of a survey" in capsys.readouterr().err


def test_a_replay_of_a_survey_is_the_survey(done):
    folder, run = done
    there = f"results_dir={folder / 'results'}"
    assert main(["replay", run, there, "backend=sequential"]) == 0
    replayed = next(path.stem for path in (folder / "results/runs").glob("replay-*"))
    for name in ("samples", "maps", "stretches"):
        pd.testing.assert_frame_equal(table(folder, name, run), table(folder, name, replayed))
    assert main(["replay", run, there, "backend=sequential", "detector=local"]) == 0


def test_a_replay_judges_all_of_a_survey_with_another_detector_too(done, capsys):
    folder, run = done
    there = f"results_dir={folder / 'results'}"
    surveyed = survey(folder, folder / "bay.csv", *QUICK, "detector=hampel")
    assert main(["replay", run, there, "backend=sequential", "detector=hampel"]) == 0
    replayed = next(path.stem for path in (folder / "results/runs").glob("replay-*hampel*"))
    flags = [table(folder, "samples", name)["flagged"].tolist() for name in (surveyed, replayed)]
    assert flags[0] == flags[1]
    assert sum(flags[0])
    capsys.readouterr()
    for option, told in (("detector=best", "true labels"), ("detector.scope=batch", "batch=")):
        assert main(["replay", run, there, option]) == 2
        assert told in capsys.readouterr().err


def test_the_clean_log_has_all_that_was_in_it(tmp_path):
    log = write_log(tmp_path / "bay.csv")
    lines = log.read_text().splitlines()
    lines[5] = lines[5].replace(",n4", ',"n, ""4"""')
    lines[9], lines[10] = lines[10], lines[9]
    lines.insert(20, "2024-05-01T10:00:18Z,17.97,-67.04,deep,?")
    fields = lines[30].split(",")
    lines[30] = ",".join([*fields[:3], "", fields[4]])
    log.write_text("\n".join(lines) + "\n")
    run = survey(tmp_path, log, *QUICK)
    clean = tmp_path / "results" / "surveys" / run / "clean.csv"
    written = pd.read_csv(clean, dtype=str, keep_default_na=False)
    before = pd.read_csv(log, dtype=str, keep_default_na=False)
    pd.testing.assert_frame_equal(written[before.columns], before)
    assert list(written.columns[5:]) == ["score", "flagged", "why"]
    assert (
        dict(written["why"][written["why"] != ""]).items()
        >= {
            19: "Depth (ft) 'deep' is no number",
            29: "no value",
        }.items()
    )
    assert written["flagged"][19] == ""
    flagged = [18 - 1, 41, 64]
    assert (written["flagged"][flagged] == "true").all()
    assert written["why"][41].startswith("gp_residual scores it ")
    assert written["why"][41].endswith(", above 3")
    samples = table(tmp_path, "samples", run).set_index("measured")["score"]
    for row in (8, 9, 50):
        depth = float(written["Depth (ft)"][row])
        assert float(written["score"][row]) == pytest.approx(samples[depth].max(), rel=1e-5)


def test_the_map_lies_where_the_log_lies(done):
    rasterio = pytest.importorskip("rasterio")
    folder, run = done
    maps, log = table(folder, "maps", run), pd.read_csv(folder / "bay.csv")
    samples = table(folder, "samples", run)
    with rasterio.open(folder / "results" / "surveys" / run / "map.tif") as file:
        assert file.crs.to_epsg() == 32619
        assert file.descriptions == ("mean", "deviation", "outlier density")
        assert file.units == ("ft", "ft", "flagged samples")
        bands, place = file.read(), file.transform
        to_degrees = pyproj.Transformer.from_crs(file.crs.to_wkt(), 4326, always_xy=True)
        for i in (0, 40, 79):
            # Where the sample lies in the pixels of the file, by its place in the workspace.
            row = np.interp(samples["x2"][i], np.unique(maps["x2"]), np.arange(8.5, -0.5, -1))
            column = np.interp(samples["x1"][i], np.unique(maps["x1"]), np.arange(0.5, 8.5))
            lon, lat = to_degrees.transform(*(place @ (column, row)))
            off = pyproj.Geod(ellps="WGS84").inv(lon, lat, log["Longitude"][i], log["Latitude"][i])
            assert off[2] < 0.1
    for band, name in zip(bands, ("mean", "std", "outlier_density"), strict=True):
        assert band[::-1].ravel() == pytest.approx(maps[name].to_numpy(), rel=1e-6)


def test_the_picture_shows_track_and_flags(done):
    folder, run = done
    picture = folder / "results" / "surveys" / run / "picture"
    drawn = pd.read_csv(picture.with_suffix(".csv"))
    samples = table(folder, "samples", run)[list(drawn.columns)]
    pd.testing.assert_frame_equal(drawn, samples, rtol=1e-9)
    with Image.open(picture.with_suffix(".png")) as image:
        width, height = image.size
        colours = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
    assert width > height
    # Crosses of the flagged samples, in a colour that no map has.
    flagged = np.array(ImageColor.getrgb(MARKS["flagged"].colour))
    crosses = (np.abs(colours - flagged).max(axis=1) < 4).sum()
    assert 50 < crosses < 0.01 * len(colours)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["batch=fast"], "batch=fast is not possible: give a number of samples like 100"),
        (["batch=0"], "batch=0 is not possible"),
        (["batch=2"], "batch=2 is too short: the first batch has 2 samples"),
        (["detector=best"], "detector=best needs the true labels, which nobody has of a survey"),
        (["detector.scope=batch"], "detector.scope=batch judges each batch but the first alone"),
        (["planner=uct"], "planner=uct is not open to a survey"),
        (["columns=depth"], "columns=depth is not possible: it must be a mapping"),
        (["columns={depth: x}"], "a column is one of lat, lon, x, y, value, time, date"),
    ],
)
def test_what_does_not_fit_is_told(options, sentence, tmp_path, capsys):
    log = write_log(tmp_path / "bay.csv")
    assert main(["survey", str(log), f"results_dir={tmp_path / 'results'}", *options]) == 2
    assert sentence in capsys.readouterr().err


def test_a_log_of_one_value_is_refused_before_it_is_judged(tmp_path, capsys):
    log = tmp_path / "flat.csv"
    log.write_text("x,y,depth\n" + "".join(f"{k % 7},{k % 5},3\n" for k in range(30)))
    assert main(["survey", str(log), f"results_dir={tmp_path / 'results'}"]) == 2
    told = capsys.readouterr().err
    assert "flat: all values of depth are 3:" in told
    assert "columns={value: ...}" in told


def test_a_judged_pilot_needs_no_further_batch(tmp_path):
    log = write_log(tmp_path / "bay.csv")
    run = survey(tmp_path, log, *QUICK, "detector.scope=batch", "detector.judge_pilot=true")
    samples, curves = table(tmp_path, "samples", run), table(tmp_path, "curves", run)
    assert set(SPIKES) <= set(np.flatnonzero(samples["flagged"]))
    assert curves["accepted"].tolist()[0] < 79


def test_a_log_must_be_named_and_be_there(tmp_path, capsys):
    assert main(["survey"]) == 2
    assert "takes the log of a survey" in capsys.readouterr().err
    assert main(["survey", str(tmp_path / "none.csv")]) == 2
    assert "none.csv cannot be read (No such file or directory)" in capsys.readouterr().err


def test_headings_follow_the_track():
    x = np.array([[0, 0], [0, 0], [1, 0], [1, 1], [1, 1], [0, 1], [0, 0.0]])
    assert headings(x) == pytest.approx(np.pi * np.array([0, 0, 0, 0.5, 0.5, 1, 1.5]))


@pytest.mark.skipif(not BOAT.is_dir(), reason="needs the boat's logs, which are not ours")
def test_the_sounder_out_of_the_water_is_flagged(tmp_path, capsys):
    run = survey(tmp_path, BOAT / "Jul-26-2022.csv")
    samples = table(tmp_path, "samples", run)
    assert samples["flagged"][-6:].all()
    last = table(tmp_path, "stretches", run).query("epoch == 1")
    weights = last["samples"] / last["samples"].sum()
    assert (weights * last["rmse"] ** 2).sum() <= (weights * last["rmse_unfiltered"] ** 2).sum()


@pytest.mark.long
@pytest.mark.skipif(not BOAT.is_dir(), reason="needs the boat's logs, which are not ours")
@pytest.mark.parametrize("name", ["Jul-26-2022", "Aug-24-2022", "Feb-09-2023", "Feb-15-2023"])
def test_of_each_log_the_best_detector_leaves_predictions_no_worse(name):
    log = read_logs([BOAT / f"{name}.csv"], None, None, None)
    config = survey_config(log, None)
    checked = check_detectors(survey_samples(log, config), config, 0.05)
    best = min(checked.values(), key=lambda one: one.gain.mean)
    assert best.gain.mean <= 0
    # Where leaving out flags makes it worse, it is within what stretches differ by.
    assert all(one.gain.low <= 0 for one in checked.values())
    assert checked["qartod"].found == checked["qartod"].planted
