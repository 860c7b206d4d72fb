"""The commands figures, claims and show, as a user gives them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import small_study
from command import infoplan

from infoplan.analyse import find_missions, summarise
from infoplan.analyse.claims import TEXTS
from infoplan.analyse.tables import load_curves
from infoplan.cli import main

COPOD = [("uct", "copod", 0.1, "batch"), ("puct", "copod", 0.1, "batch")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("commands")
    small_study.store(folder, COPOD)
    return folder


def run(capsys, *arguments) -> tuple[int, str, str]:
    status = main([str(argument) for argument in arguments])
    return status, *capsys.readouterr()


def test_figures_prints_the_files_and_what_is_missing_and_runs_nothing(capsys, folder):
    before = sorted(folder.glob("curves/*/*"))
    status, out, err = run(capsys, "figures", "fig7", "fig4", f"results_dir={folder}", "seed=1")
    assert status == 1
    assert [Path(line).name for line in out.split()] == ["fig7.png", "fig7.pdf", "fig7.csv"]
    assert all(Path(line).is_file() for line in out.split())
    assert "fig4 lacks UCT-NONE at rho 0.1: run infoplan run planner=uct detector=none" in err
    assert sorted(folder.glob("curves/*/*")) == before
    assert run(capsys, "figures", f"results_dir={folder}", "fig3")[0] == 0


def test_claims_exit_with_0_whatever_the_verdicts(capsys, folder):
    status, out, _ = run(capsys, "claims", f"results_dir={folder}", "--json")
    claims = json.loads(out)["claims"]
    assert status == 0
    assert [claim["name"] for claim in claims] == list(TEXTS)
    assert claims[0]["verdict"] == "missing"
    assert claims[list(TEXTS).index("C12")]["comparisons"][0]["n"] == 2
    assert run(capsys, "claims", f"results_dir={folder}", "--markdown")[1].count("\n| C") == len(
        TEXTS
    )
    assert "rho 0.05: all methods differ negligibly" in run(
        capsys, "claims", f"results_dir={folder}"
    )[1].replace("\n", " ")


def test_show_prints_curve_detector_and_time(capsys, folder):
    name = next(run for run in find_missions(folder).options if run.startswith("puct"))
    status, out, _ = run(capsys, "show", name.rsplit("-", 1)[1], f"results_dir={folder}")
    summary = summarise(load_curves(folder, run=name))
    assert status == 0
    assert out.startswith(f"{name}\nvolcano, budget 200, seeds 0, 1\n")
    assert "RMSE (ft), mean of 2 seeds" in out
    assert f"final RMSE        {summary['final'].mean():.0f} [" in out
    assert f"recall            {summary['recall'].mean():.2f} [" in out
    assert f"{summary['seconds'].mean():.1f} s a mission: plan" in out
    assert "model.pilot_iterations=10" in out


def test_show_speaks_ascii_where_it_must(folder):
    name = next(iter(find_missions(folder).options))
    done = subprocess.run(
        [sys.executable, "-m", "infoplan.cli", "show", name, f"results_dir={folder}"],
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
        capture_output=True,
        check=True,
    )
    assert done.stdout.isascii()
    assert b"*" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show"], "there are 2 runs: name one, or its hash: puct-copod-volcano"),
        (["show", "nothing"], "run=nothing is not stored in {folder}: use puct-copod"),
        (["show", "one", "two"], "show takes one run, not 2"),
        (["claims", "--json", "--markdown"], "as --json, --markdown, --csv or --latex: choose one"),
        (["claims", "planner.exploration=9"], "no mission with planner.exploration=9"),
        (["claims", "terrain=helens"], r"no mission with terrain=helens: there is volcano (4)"),
        (["figures", "fig9"], "there is no figure 'fig9'"),
        (["figures", "sed=1"], "did you mean 'seed'"),
    ],
)
def test_mistakes_are_one_sentence(capsys, folder, arguments, message):
    status, out, err = run(capsys, *arguments, f"results_dir={folder}")
    assert (status, out) == (2, "")
    assert message.format(folder=folder) in err
    assert len(err.splitlines()) == 1


def test_a_damaged_table_is_one_sentence(capsys, tmp_path):
    small_study.store(tmp_path, COPOD[:1], seeds=[0])
    path = next(tmp_path.glob("samples/*/seed=0.parquet"))
    path.write_bytes(path.read_bytes()[:-100])
    status, _, err = run(capsys, "claims", f"results_dir={tmp_path}")
    assert status == 1
    assert str(path) in err
    assert len(err.splitlines()) == 1


def test_terrain_show(tmp_path):
    done = infoplan("terrain", "show", "terrain=jacksboro", f"results_dir={tmp_path}")
    assert "elevation  236 to 1076 m" in done.stdout
    assert (tmp_path / "figures" / "terrain-jacksboro.png").is_file()


@pytest.mark.parametrize("command", ["show", "audit", "animate", "explain", "status"])
def test_commands_about_one_run_take_no_list(command, capsys):
    assert main([command, "run=[a,b]"]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "run=[a,b] is a list, where one run is taken: a run's name, its hash" in told
