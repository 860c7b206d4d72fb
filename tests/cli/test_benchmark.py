"""``experiment=benchmark`` and the leaderboard that it is for."""

import json
from itertools import product

import pandas as pd
import pytest
from command import SMALL, infoplan

from infoplan.cli import main

METHODS = (
    *("uct-none", "uct-best", "uct-copod", "uct-local", "uct-gp_residual", "uct-none-student_t"),
    *("puct-copod", "puct-local", "puct-gp_residual"),
    *("weighted-copod", "greedy-copod", "lawnmower-copod", "random-copod"),
)


@pytest.mark.long
def test_the_benchmark_is_every_method_on_every_map_at_every_share(tmp_path, capfd):
    assert main(["status", "--json", "experiment=benchmark", f"results_dir={tmp_path}"]) == 0
    runs = json.loads(capfd.readouterr().out)["runs"]
    names = [run["run"].rpartition("-")[0] for run in runs]
    shares = ("0", "0.05", "0.1", "0.15", "0.2")
    for method, terrain, rho in product(METHODS, ("volcano", "jacksboro"), shares):
        assert names.count(f"{method}-{terrain}-rho{rho}-batch") == 1
    assert all(run["missing"] == [0, 1, 2, 3, 4] for run in runs)


def test_a_tiny_benchmark_is_ranked(tmp_path, capfd):
    short = [
        option
        for option in SMALL
        if not option.startswith(("terrain", "budget", "n_jobs", "planner"))
    ]
    arguments = ["terrain=volcano", "rho=0,0.2", "budget=140", "n_jobs=2", *short]
    results = f"results_dir={tmp_path}"
    infoplan("run", "-m", "experiment=benchmark", *arguments, results)
    curves = pd.read_parquet(tmp_path / "curves")
    assert set(curves["rho"]) == {0.0, 0.2}
    assert main(["leaderboard", "--markdown", results]) == 0
    rows = [line for line in capfd.readouterr().out.splitlines() if line.startswith("| ")][1:]
    methods = [row.split(" | ")[1].replace("\\_", "_") for row in rows]  # escaped for Markdown
    assert set(methods) == {method.upper() for method in METHODS}
    assert len(rows) == len(METHODS)
