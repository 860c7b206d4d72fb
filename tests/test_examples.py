"""The examples run as they stand."""

import json
import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_ask_and_tell(capsys):
    left = runpy.run_path(str(EXAMPLES / "ask_and_tell.py"))
    said = capsys.readouterr().out
    assert "300 samples" in said
    frames, rows = left["frames"], left["rows"]
    assert len(frames.samples) == 300
    assert len(rows) == len(frames.curves) > 2
    assert frames.curves["rmse"].isna().all()
    depth = left["lake_depth"](frames.maps[["x1", "x2"]].to_numpy())
    error = np.sqrt(np.mean((frames.maps["mean"] - depth) ** 2))
    assert f"{error:.2f} m" in said
    assert error < depth.std()  # better than the mean of the lake


@pytest.fixture(scope="module")
def notebook():
    return json.loads((EXAMPLES / "mission.ipynb").read_text(encoding="utf-8"))


def test_the_notebook_is_executed_and_small(notebook):
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell["outputs"]]
    assert {output["output_type"] for output in outputs} <= {
        "stream", "execute_result", "display_data"
    }  # fmt: skip
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert len(json.dumps(notebook)) < 200_000


def test_the_notebook_runs(notebook, capsys):
    matplotlib.use("Agg")
    names: dict = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert capsys.readouterr().out.splitlines()[-1] == "True"
    assert len(names["flown"].samples) == names["config"].budget
