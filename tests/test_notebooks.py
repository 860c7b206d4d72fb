"""The notebooks of the examples run as they stand; they store no outputs."""

import json
import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from infoplan.analyse import find_missions
from infoplan.cli import main

EXAMPLES = Path(__file__).parents[1] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def code_of(notebook: dict) -> list[dict]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def read(name: str) -> dict:
    return json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))


def execute(name: str, folder: Path, monkeypatch) -> dict:
    """Run the cells of a notebook in this process, `!infoplan` too; returns their names."""
    for file in [*EXAMPLES.glob("*.py"), *EXAMPLES.glob("*.csv")]:
        shutil.copy(file, folder)
    matplotlib.use("Agg")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    names: dict = {}
    for cell in code_of(read(name)):
        source = "".join(cell["source"])
        if source.startswith("%%writefile "):
            file, _, text = source.removeprefix("%%writefile ").partition("\n")
            Path(file).write_text(text, encoding="utf-8")
            continue
        lines = []
        for line in source.splitlines():
            if not line.startswith("!infoplan "):
                lines.append(line)
                continue
            exec("\n".join(lines), names)
            words = shlex.split(re.sub(r"\{(\w+)\}", lambda found: str(names[found[1]]), line))[1:]
            words += ["backend=sequential"] if words[0] == "run" else []
            assert main(words) == 0
            lines = []
        exec("\n".join(lines), names)
    return names


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_stores_no_outputs(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert code_of(notebook)
    assert [cell["outputs"] for cell in code_of(notebook)] == [[]] * len(code_of(notebook))
    assert {cell["execution_count"] for cell in code_of(notebook)} == {None}


def test_the_cells_of_a_mission(tmp_path, monkeypatch, capsys):
    names = execute("mission", tmp_path, monkeypatch)
    assert capsys.readouterr().out.splitlines()[-1] == "True"
    assert len(names["flown"].samples) == names["config"].budget


def test_the_cells_of_the_tour(tmp_path, monkeypatch):
    names = execute("tour", tmp_path, monkeypatch)
    assert set(names["study"].missions["method"]) == {
        "UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"
    }  # fmt: skip
    assert names["final"]["rmse"].notna().all()


def test_the_cells_of_an_own_method(tmp_path, monkeypatch):
    names = execute("own_method", tmp_path, monkeypatch)
    spikes = names["mine"].samples["is_outlier"].sum()
    assert names["rows"]["best"]["found"] == spikes > 0
    assert names["rows"]["none"]["missed"] == spikes
    assert 0 < names["rows"]["far_from_median"]["found"] <= spikes
    assert len(find_missions("own_method").missions) == 2


def test_the_cells_of_a_survey(tmp_path, monkeypatch):
    pytest.importorskip("pyproj")
    names = execute("survey", tmp_path, monkeypatch)
    assert names["samples"]["flagged"].sum() == 16
    steps = np.diff(names["track"][["x_m", "y_m"]].to_numpy(), axis=0)
    assert 50 < np.hypot(*steps.T).sum() <= 60


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_in_a_kernel(path, tmp_path, monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    for file in [*EXAMPLES.glob("*.py"), *EXAMPLES.glob("*.csv")]:
        shutil.copy(file, tmp_path)
    # `!infoplan` is the one of this environment.
    here = [str(Path(sys.executable).parent), os.environ["PATH"]]
    monkeypatch.setenv("PATH", os.pathsep.join(here))
    notebook = nbformat.read(path, as_version=4)
    done = nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    outputs = [output for cell in code_of(done) for output in cell["outputs"]]
    told = "".join(output.get("text", "") for output in outputs)
    assert "infoplan: " not in told  # how the message of an error begins
    shown = [output["data"] for output in outputs if "data" in output]
    assert any("image/png" in data for data in shown)
    assert any("<table>" in data.get("text/html", "") for data in shown)


def test_what_newcomers_want_has_a_notebook():
    assert {path.stem for path in NOTEBOOKS} >= {"mission", "own_method", "survey", "tour"}
