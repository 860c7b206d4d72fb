"""``infoplan run`` as a user meets it."""

import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import yaml
from command import SMALL, infoplan
from hydra._internal.config_loader_impl import ConfigLoaderImpl

from infoplan.cli import main

BAD = {
    "planner=foo": "there is no planner 'foo': planner= takes bayes_opt, cmaes, greedy,",
    "detector=copodd": "did you mean 'copod'",
    "rho=abc": "rho must be a number",
    "rho=-0.1": "at least 0 and at most 1",
    "rho=1.5": "at least 0 and at most 1",
    "budget=50": "must be above pilot.samples=100",
    "seeds=0": "seeds=0",
    "seeds=[1,1]": "names a seed twice",
    "rhoo=0.1": "did you mean 'rho'",
    "planner.explorration=1": "did you mean 'planner.exploration'",
    "+speed=1": "there is no option 'speed'",
    "model.iterations=abc": "per_sample or a whole number",
    "terrain.path=/nowhere/map.npy terrain=file": "/nowhere/map.npy",
    "results_dir=/dev/null/results": "results_dir=/dev/null/results cannot be written",
    "grid=[3": "cannot be read",
    "--nonsense": "--nonsense",
}


@pytest.mark.parametrize("arguments", BAD)
def test_bad_input_is_one_sentence_and_status_2(arguments, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HYDRA_FULL_ERROR", raising=False)
    assert main(["run", "n_jobs=1", *arguments.split()]) == 2
    said = capfd.readouterr()
    assert BAD[arguments] in said.err
    assert "Traceback" not in said.err + said.out
    assert len([line for line in said.err.splitlines() if line.startswith("infoplan: ")]) == 1
    assert not list(tmp_path.rglob("*.parquet"))


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros(5), "two dimensions"),
        (np.ones((1, 9)), "at least 2 rows"),
        (np.array([[1.0, np.nan], [2.0, 3.0]]), "NaN"),
        (np.array([[1.0, np.inf], [2.0, 3.0]]), "infinit"),
        (np.full((9, 9), 7.0), "everywhere"),
    ],
)
def test_a_map_that_is_none(array, words, tmp_path, capfd):
    path = tmp_path / "map.npy"
    np.save(path, array)
    assert main(["run", "terrain=file", f"terrain.path={path}", f"results_dir={tmp_path}"]) == 2
    said = capfd.readouterr().err
    assert "map.npy" in said
    assert words.lower() in said.lower()


def test_a_run_leaves_the_tables_and_a_summary(tmp_path):
    said = infoplan("run", *SMALL, "seeds=2", f"results_dir={tmp_path}").stdout
    assert "RMSE in ft" in said
    assert "2 missions computed, 0 kept" in said
    curves = pd.read_parquet(tmp_path / "curves")
    assert set(curves["seed"]) == {0, 1}
    assert curves.groupby("seed")["collected"].max().tolist() == [160, 160]
    run = curves["run"].unique()
    assert len(run) == 1
    name = str(run[0])
    assert name.startswith("puct-copod-volcano-rho0.1-batch-")
    science = yaml.safe_load((tmp_path / "runs" / f"{name}.yaml").read_text())
    assert science["budget"] == 160
    assert science["planner"]["iterations"] == 30
    assert "seeds" not in science
    samples = pd.read_parquet(tmp_path / "samples")
    assert samples.groupby("seed").size().tolist() == [160, 160]
    maps = pd.read_parquet(tmp_path / "maps")
    assert maps.groupby("seed").size().tolist() == [144, 144]
    again = infoplan("run", *SMALL, "seeds=2", f"results_dir={tmp_path}").stdout
    assert "2 of 2 missions are there already" in again


def test_flags_and_overrides_come_in_any_order(tmp_path):
    shown = [
        infoplan(*arguments).stdout
        for arguments in (
            ["run", "rho=0.2", "--cfg", "job", "planner=uct"],
            ["run", "--cfg", "job", "rho=0.2", "planner=uct"],
            ["run", "rho=0.2", "planner=uct", "--cfg=job"],
        )
    ]
    assert yaml.safe_load(shown[0])["rho"] == 0.2
    assert yaml.safe_load(shown[0])["planner"]["name"] == "uct"
    assert shown[0] == shown[1] == shown[2]


def test_a_multirun_runs_every_combination(tmp_path):
    infoplan(
        "run", "rho=0.05,0.1", "-m", *SMALL, "planner=uct,puct", "backend=sequential",
        f"results_dir={tmp_path}",
        cwd=tmp_path,
    )  # fmt: skip
    curves = pd.read_parquet(tmp_path / "curves")
    assert set(map(tuple, curves[["planner", "rho"]].to_numpy())) == {
        ("uct", 0.05), ("uct", 0.1), ("puct", 0.05), ("puct", 0.1)
    }  # fmt: skip
    assert not (tmp_path / "multirun").exists()
    assert not (tmp_path / "outputs").exists()


def test_a_missing_helens_becomes_volcano_everywhere(tmp_path):
    lost = {"INFOPLAN_DATA": "", "XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path),
            "https_proxy": "http://127.0.0.1:9", "HTTPS_PROXY": "http://127.0.0.1:9"}  # fmt: skip
    small = [*(word for word in SMALL if word != "terrain=volcano"), "backend=sequential"]
    results = tmp_path / "results"
    done = infoplan("run", *small, f"results_dir={results}", env=lost)
    assert done.stdout.count("WARNING") == 1
    assert "volcano" in done.stdout
    names = [path.name for path in (results / "curves").iterdir()]
    assert all("volcano" in name for name in names)
    assert set(pd.read_parquet(results / "curves")["terrain"]) == {"volcano"}
    kept = infoplan("run", *SMALL, f"results_dir={results}").stdout
    assert "1 of 1 missions are there already" in kept
    refused = infoplan("run", *small, "terrain.on_missing=error", f"results_dir={results}",
                       env=lost, check=False)  # fmt: skip
    assert refused.returncode == 2
    assert "helens" in refused.stderr


def test_help_imports_next_to_nothing():
    code = (
        "import sys; from infoplan.cli import main; main(['--help']); "
        "heavy = {'numpy', 'hydra', 'pandas', 'numba', 'matplotlib'} & set(sys.modules); "
        "sys.exit(','.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "infoplan run" in done.stdout


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("infoplan r", ["run"]),
        ("infoplan run planner=p", ["planner=puct"]),
        ("infoplan run planner.expl", ["planner.exploration="]),
    ],
)
def test_completion(line, expected):
    env = {"COMP_LINE": line, "COMP_POINT": str(len(line))}
    said = infoplan("-sc", "query=bash", env={**os.environ, **env}).stdout
    assert said.split()[: len(expected)] == expected


def test_unknown_command_and_no_command(capfd):
    assert main(["rum"]) == 2
    assert "did you mean 'run'" in capfd.readouterr().err
    assert main([]) == 2
    assert "infoplan run" in capfd.readouterr().out


def test_a_run_is_composed_once_and_a_mode_is_heard(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)  # where Hydra leaves its multirun.yaml
    load, composed = ConfigLoaderImpl.load_configuration, []

    def counting(*arguments, **options):
        composed.append(options)
        return load(*arguments, **options)

    monkeypatch.setattr(ConfigLoaderImpl, "load_configuration", counting)
    line = ["run", "--dry-run", "terrain=volcano", "planner=uct", "detector=none", "seeds=1",
            f"results_dir={tmp_path / 'results'}"]  # fmt: skip
    assert main(line) == 0
    assert len(composed) == 1
    assert "1 mission would run" in capfd.readouterr().out
    assert main([*line, "rho=0.1,0.2", "hydra.mode=MULTIRUN"]) == 0
    assert "2 missions would run" in capfd.readouterr().out
    own = tmp_path / "own" / "experiment" / "both.yaml"
    own.parent.mkdir(parents=True)
    own.write_text(
        "# @package _global_\nhydra: {mode: MULTIRUN, sweeper: {params: {rho: '0.1,0.2,0.3'}}}\n"
    )
    assert main([*line, "--config-dir", str(tmp_path / "own"), "experiment=both"]) == 0
    assert "3 missions would run" in capfd.readouterr().out
