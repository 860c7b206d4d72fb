"""``infoplan replay`` as a user meets it: the same samples, judged and modelled anew."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command import SMALL
from command import infoplan as command
from flown import tables_of

import infoplan
from infoplan.analyse.audit import audit_mission
from infoplan.analyse.tables import find_missions, find_study
from infoplan.cli import main
from infoplan.errors import UsageError
from infoplan.study.identity import identify
from infoplan.study.locks import acquire
from infoplan.study.store import save_mission

CLOCKS = ["plan_seconds", "fit_seconds", "predict_seconds", "detect_seconds"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory, volcano) -> Path:
    """Two methods of two seeds each, and one of historical scope."""
    folder = tmp_path_factory.mktemp("flown")
    short = [option for option in SMALL if not option.startswith(("budget", "seeds", "n_jobs"))]
    for method in (
        ["planner=puct", "detector=none"],
        ["planner=puct", "detector=copod"],
        ["planner=uct", "detector=copod", "detector.scope=historical"],
    ):
        config = infoplan.configure(*short, *method, budget=230, rho=0.2)
        run = identify(config, volcano)
        for seed in (0, 1):
            tables = tables_of(run, seed)
            save_mission(folder, run, seed, tables, {})
    return folder


def runs(folder: Path) -> dict[str, str]:
    """Names of the runs by what they begin with."""
    return {name.split("-volcano")[0]: name for name in stored(folder)}


def stored(folder: Path) -> set[str]:
    return {path.name.removeprefix("run=") for path in (folder / "curves").iterdir()}


def read(folder: Path, table: str, run: str, seed: int) -> pd.DataFrame:
    path = folder / table / f"run={run}" / f"seed={seed}.parquet"
    return pd.read_parquet(path, partitioning=None)


def replay(folder: Path, run: str, *overrides: str) -> str:
    """Replay through the command line in this process; the replay's name."""
    before = stored(folder)
    assert main(["replay", run, *overrides, f"results_dir={folder}", "backend=sequential"]) == 0
    (new,) = stored(folder) - before
    return new


@pytest.mark.parametrize("source", ["puct-none", "puct-copod", "uct-copod"])
def test_a_replay_with_nothing_changed_gives_the_same_numbers_to_the_bit(flown, source):
    name = runs(flown)[source]
    again = replay(flown, name)
    assert again.startswith(f"replay-{source}-volcano-rho0.2-")
    for seed in (0, 1):
        for table in ("curves", "samples", "maps"):
            expected = read(flown, table, name, seed).drop(columns=CLOCKS, errors="ignore")
            found = read(flown, table, again, seed).drop(columns=CLOCKS, errors="ignore")
            pd.testing.assert_frame_equal(found, expected, check_exact=True)
        assert (read(flown, "curves", again, seed)["plan_seconds"] == 0).all()


def test_another_detector_judges_the_same_samples(flown):
    name = runs(flown)["puct-none"]
    best = replay(flown, name.rsplit("-", 1)[1], "detector=best", "seeds=[1]")
    assert best.startswith("replay-puct-best-volcano-rho0.2-batch-")
    samples, source = read(flown, "samples", best, 1), read(flown, "samples", name, 1)
    same = ["epoch", "x1", "x2", "heading", "truth", "measured", "is_outlier"]
    pd.testing.assert_frame_equal(samples[same], source[same], check_exact=True)
    assert source["is_outlier"].sum() > 10
    assert (samples["flagged"] == samples["is_outlier"]).all()
    curve, before = read(flown, "curves", best, 1), read(flown, "curves", name, 1)
    assert set(curve["planner"]) == {"puct"}
    assert set(curve["detector"]) == {"best"}
    assert curve["collected"].tolist() == before["collected"].tolist()
    assert curve["accepted"].iloc[-1] == 230 - source["is_outlier"].sum()
    assert curve["rmse"].iloc[-1] < before["rmse"].iloc[-1]
    assert not (flown / "curves" / f"run={best}" / "seed=0.parquet").exists()
    science = yaml.safe_load((flown / "runs" / f"{best}.yaml").read_text())
    assert science["replay"] == name


@pytest.mark.parametrize(
    "overrides",
    [
        ["detector.scope=historical"],
        ["detector=best"],
        ["detector.score=paper", "planner.smoothing=5"],
        ["model.iterations=1", "model.dtype=float32"],
    ],
)
def test_a_replay_stands_the_audit(flown, volcano, overrides):
    again = replay(flown, runs(flown)["puct-copod"], *overrides)
    findings = audit_mission(flown, again, 0, {volcano.sha256: volcano.elevation})
    assert len(findings) > 20
    assert not [finding for finding in findings if not finding.holds]
    assert "truth" in {finding.check for finding in findings}


def test_options_that_are_not_named_stay_those_of_the_source(flown):
    again = replay(flown, runs(flown)["uct-copod"], "detector.contamination=0.2")
    science = yaml.safe_load((flown / "runs" / f"{again}.yaml").read_text())
    assert science["detector"] == {
        "name": "copod", "scope": "historical", "contamination": 0.2, "score": "pyod"
    }  # fmt: skip
    assert science["model"]["iterations"] == 2
    assert science["planner"]["iterations"] == 30


def test_a_replay_of_a_replay_names_the_run_that_was_flown(flown):
    name = runs(flown)["puct-none"]
    first = replay(flown, name, "detector=copod")
    second = replay(flown, first, "detector.contamination=0.3")
    assert yaml.safe_load((flown / "runs" / f"{second}.yaml").read_text())["replay"] == name


def test_replays_are_never_pooled_with_flown_runs(flown):
    again = replay(flown, runs(flown)["puct-none"], "detector=copod", "detector.contamination=0.11")
    study = find_study(flown)
    assert not [run for run in study.options if run.startswith("replay-")]
    assert set(study.missions["method"]) == {"PUCT-NONE", "PUCT-COPOD", "UCT-COPOD"}
    source = runs(flown)["puct-none"]
    chosen = find_missions(flown, replay=source).missions
    assert set(chosen["method"]) <= {"REPLAY-PUCT-COPOD", "REPLAY-PUCT-BEST", "REPLAY-PUCT-NONE"}
    assert again in set(chosen["run"])
    assert source not in set(chosen["run"])
    assert find_missions(flown, run=again).missions["method"].unique() == ["REPLAY-PUCT-COPOD"]
    assert find_study(flown, run=[again]).run("PUCT-COPOD", 0.2) is None
    with pytest.raises(UsageError, match="replay"):
        find_missions(flown, replay="nobody")


def test_what_is_there_is_kept_and_shown_beside_the_source(flown, capfd):
    name = runs(flown)["puct-copod"]
    arguments = ["replay", name, "detector=none", f"results_dir={flown}", "backend=sequential"]
    assert main(arguments) == 0
    assert "2 missions replayed, 0 kept" in capfd.readouterr().out
    said = command(*arguments).stdout
    assert "0 missions replayed, 2 kept" in said
    row = next(line for line in said.splitlines() if "flown " in line and "less" not in line)
    finals = [read(flown, "curves", name, seed)["rmse"].iloc[-1] for seed in (0, 1)]
    assert f"{np.mean(finals):.0f}" in row.split()


BAD = {
    "planner=uct": "not open to a replay",
    "planner.iterations=3": "not open to a replay",
    "detectr=best": "detectr=best (did you mean 'detector'?) is not open to a replay",
    "rho=0.3": "not open to a replay",
    "~detector": "not open to a replay",
    "detector=copodd": "did you mean 'copod'",
    "detector.contamination=2": "at most 0.5",
    "detector.contaminatio=0.2": "detector.contamination",
    "detector=none,best": "several values",
    "detector=none detector.contamination=0.2": "has no option",
    "seeds=[7]": "seed 7 of",
    "n_jobs=0": "n_jobs=0 runs nothing",
    "backend=dask mission_timeout=9": "has no use with backend=dask",
    "backend=threads": "backend=threads is not a choice",
    "scheduler=tcp://here:1": "not open to a replay",
    "another": "takes one run, not 2",
    "--json": "there is no flag '--json'",
}


@pytest.mark.parametrize("arguments", BAD)
def test_bad_replays_are_one_sentence_and_status_2(flown, arguments, capfd):
    before = sorted(flown.rglob("*"))
    name = runs(flown)["puct-copod"]
    assert main(["replay", name, *arguments.split(), f"results_dir={flown}"]) == 2
    said = capfd.readouterr().err
    assert BAD[arguments] in said
    assert len(said.strip().splitlines()) == 1
    assert sorted(flown.rglob("*")) == before


def test_a_run_that_is_not_there(flown, capfd):
    assert main(["replay", "nothing", "detector=best", f"results_dir={flown}"]) == 2
    said = capfd.readouterr().err
    assert "run=nothing is not stored" in said
    assert runs(flown)["puct-copod"] in said
    assert main(["replay"]) == 2
    assert "takes one stored run" in capfd.readouterr().err


def test_a_run_on_a_file_that_is_gone_is_replayed_from_its_tables(tmp_path, hills):
    config = infoplan.configure(
        "terrain=file", f"terrain.path={hills}", budget=130, grid=[8, 8],
        **{"planner.iterations": 5, "model.pilot_iterations": 5},
    )  # fmt: skip
    terrain = infoplan.load_terrain(**vars(config.terrain))
    run = identify(config, terrain)
    save_mission(tmp_path, run, 0, tables_of(run, 0), {})
    again = replay(tmp_path, run.name, "detector=none")
    assert again.startswith("replay-puct-none-file-hills-rho0.1-batch-")
    science = yaml.safe_load((tmp_path / "runs" / f"{again}.yaml").read_text())
    assert science["terrain"] == run.science["terrain"]
    found, expected = read(tmp_path, "maps", again, 0), read(tmp_path, "maps", run.name, 0)
    assert (found["truth"] == expected["truth"]).all()
    findings = audit_mission(tmp_path, again, 0, {terrain.sha256: terrain.elevation})
    assert not [finding for finding in findings if not finding.holds]


def test_a_replay_needs_no_planner_of_the_user_s(tmp_path, volcano, monkeypatch, capfd):
    module = tmp_path / "gone.py"
    module.write_text("def ahead(situation, rng):\n    return situation.valid_actions()[:1]\n")
    monkeypatch.syspath_prepend(tmp_path)
    short = [option for option in SMALL if not option.startswith(("planner", "seeds", "n_jobs"))]
    config = infoplan.configure(*short, "planner=own", "planner.function=gone.ahead")
    run = identify(config, volcano)
    save_mission(tmp_path, run, 0, tables_of(run, 0), {})
    module.unlink()
    monkeypatch.delitem(sys.modules, "gone")
    again = replay(tmp_path, run.name, "detector=none", "planner.smoothing=1")
    assert again.startswith("replay-ahead-none-volcano-")
    assert set(read(tmp_path, "curves", again, 0)["planner"]) == {"ahead"}
    science = yaml.safe_load((tmp_path / "runs" / f"{again}.yaml").read_text())
    assert science["planner"] == {**run.science["planner"], "smoothing": 1.0}


def test_what_breaks_down_is_named_and_the_others_go_on(flown, tmp_path, capfd):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    name = runs(folder)["puct-copod"]
    knn = ["detector=pyod", "detector.model=KNN", "detector.params.n_neighbors=5000"]
    assert main(["replay", name, *knn, f"results_dir={folder}", "backend=sequential"]) == 1
    said = capfd.readouterr().out
    assert said.count("FAILED: the detector pyod_knn failed in epoch 1") == 2
    assert len(list((folder / "failures").rglob("*.txt"))) == 2


def test_a_mission_whose_tables_do_not_belong_together_is_not_replayed(flown, tmp_path, capfd):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    name = runs(folder)["puct-copod"]
    samples = folder / "samples" / f"run={name}"
    shutil.copy(samples / "seed=0.parquet", samples / "seed=1.parquet")
    again = replay(folder, name, "planner.smoothing=1.7")
    assert not (folder / "curves" / f"run={again}" / "seed=1.parquet").exists()
    shutil.copy(samples / "seed=1.parquet", samples / "seed=0.parquet")
    (samples / "seed=0.parquet").write_bytes(b"broken")
    assert main(["replay", name, f"results_dir={folder}"]) == 1
    assert "seed=0.parquet cannot be read" in capfd.readouterr().err


def test_two_replays_at_once_share_the_work(flown, tmp_path):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    name = runs(folder)["uct-copod"]
    expected = replay(folder, name, "model.iterations=1")
    shutil.rmtree(folder / "curves" / f"run={expected}")
    lock = acquire(folder, expected, 1)
    arguments = ["replay", name, "model.iterations=1", f"results_dir={folder}"]
    process = subprocess.Popen(
        [sys.executable, "-m", "infoplan.cli", *arguments, "backend=sequential"],
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    with process:
        said = iter(process.stdout)
        waiting = "another infoplan process flies the rest: waiting for it"
        assert any(waiting in line for line in said)
        assert process.poll() is None
        lock.release()
        rest = "".join(said)
    assert process.returncode == 0, rest
    seeds = {path.stem for path in (folder / "curves" / f"run={expected}").iterdir()}
    assert seeds == {"seed=0", "seed=1"}


@pytest.mark.parametrize(
    "how",
    [["n_jobs=2"], pytest.param(["backend=dask", "n_jobs=2"], marks=pytest.mark.long)],
)
def test_every_pool_replays_the_same_numbers_and_tells_how_far_it_is(flown, tmp_path, how):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    name = runs(folder)["puct-copod"]
    expected = replay(folder, name, "detector.contamination=0.15")
    tables = {seed: read(folder, "curves", expected, seed) for seed in (0, 1)}
    again = [name, "detector.contamination=0.15", f"results_dir={folder}", "resume=false"]
    said = command("replay", *again, *how).stdout
    assert f"[2/2] {expected} seed " in said
    assert "2 missions replayed, 0 kept" in said
    for seed, table in tables.items():
        found = read(folder, "curves", expected, seed).drop(columns=CLOCKS)
        pd.testing.assert_frame_equal(found, table.drop(columns=CLOCKS), check_exact=True)


def test_a_failed_replay_ends_the_rest_if_that_is_asked_for(flown, tmp_path, capfd):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    knn = ["detector=pyod", "detector.model=KNN", "detector.params.n_neighbors=5000"]
    how = [f"results_dir={folder}", "backend=sequential", "on_error=stop"]
    assert main(["replay", runs(folder)["puct-copod"], *knn, *how]) == 1
    said = capfd.readouterr().out
    assert said.count("FAILED: ") == 1
    assert "0 missions replayed, 0 kept, 1 failed, 1 not started (on_error=stop)" in said


def test_a_replay_that_takes_too_long_is_ended(flown, tmp_path, capfd):
    folder = tmp_path / "flown"
    shutil.copytree(flown, folder)
    name = runs(folder)["puct-copod"]
    slow = ["model.pilot_iterations=100000", "seeds=[0]", "n_jobs=1", "mission_timeout=1"]
    assert main(["replay", name, *slow, f"results_dir={folder}"]) == 1
    assert "mission_timeout=1 seconds and was ended" in capfd.readouterr().out
