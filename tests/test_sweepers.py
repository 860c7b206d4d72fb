"""Hydra's own sweepers and launchers, the real plugins: they skip where one is absent."""

import re
import shlex

import pytest
from command import SMALL, infoplan

from infoplan.hydra_front.trials import Score, best_trial

SEARCH = ["hydra/sweeper=optuna", "hydra.sweeper.n_trials=3", "hydra.sweeper.n_jobs=1"]


def best_of(output: str) -> tuple[float, str, list[str]]:
    """RMSE, run and command of the line that names the best trial."""
    found = re.search(r"^best of 3 trials: RMSE (\S+) \((\S+)\): infoplan (.*)$", output, re.M)
    assert found, output
    return float(found[1]), found[2], shlex.split(found[3])


@pytest.mark.parametrize(
    "launcher", ["infoplan", pytest.param("submitit_local", marks=pytest.mark.long)]
)
def test_a_search_names_its_best_trial(launcher, tmp_path):
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper")
    if launcher != "infoplan":
        pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    words = [*SMALL, "backend=sequential", "results_dir=2024_11_25", f"hydra/launcher={launcher}"]
    line = ["run", "-m", *SEARCH, "rho=interval(0.05,0.3)", "terrain.unit=null", *words]
    done = infoplan(*line, cwd=tmp_path)
    rmse, run, command = best_of(done.stdout)
    stored = {path.stem for path in (tmp_path / "2024_11_25" / "runs").iterdir()}
    assert len(stored) == 3
    assert run in stored
    again = infoplan(*command, cwd=tmp_path)  # what is suggested is that run
    assert "0 missions computed, 1 kept" in again.stdout
    assert f"{rmse:.0f}" in again.stdout
    kept = tmp_path / "2024_11_25" / "hydra"
    assert kept.is_dir() == (launcher != "infoplan")
    if launcher != "infoplan":
        (folder,) = kept.iterdir()
        assert f"{folder.relative_to(tmp_path)}" in done.stderr
        assert list(folder.rglob("*_log.out"))


def test_a_machine_without_slurm_is_told(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    words = [*SMALL, "rho=0.1,0.2", "backend=sequential", "hydra/launcher=submitit_slurm"]
    path = {"PATH": str(tmp_path)}  # no srun, wherever this runs
    done = infoplan("run", "-m", *words, cwd=tmp_path, env=path, check=False)
    assert done.returncode == 2
    said = " ".join(done.stderr.split())
    assert "hydra/launcher=submitit_slurm finds no Slurm on this machine" in said
    assert "hydra/launcher=submitit_local" in said


@pytest.mark.long
def test_a_sweep_folder_is_made_and_a_failed_trial_told(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper")
    words = [*SMALL, "backend=sequential", "hydra.sweep.dir=here/it is", *SEARCH]
    infoplan("run", "-m", "rho=choice(0.05,0.2)", *words, cwd=tmp_path)
    assert (tmp_path / "here" / "it is" / "optimization_results.yaml").is_file()
    failed = infoplan("run", "-m", "rho=interval(2,3)", *words, cwd=tmp_path, check=False)
    assert failed.returncode == 2
    assert "rho=2" in failed.stderr
    assert "at most 1" in failed.stderr.strip().splitlines()[-1]


def test_the_best_trial_is_the_one_of_least_rmse():
    nan = float("nan")
    trials = [(["rho=0.1"], Score(30.0, "a")), (["rho=0.2"], nan), (["results_dir='x y'"], 20.0)]
    assert best_trial(trials) == ("best of 3 trials: RMSE 20.0: infoplan run 'results_dir=x y'")
    assert best_trial(trials[:2]) == "best of 2 trials: RMSE 30.0 (a): infoplan run rho=0.1"
    assert best_trial([(["rho=0.1"], nan)]) == "none of 1 trial has an RMSE"
