"""The examples run as they stand."""

import runpy
from pathlib import Path

import numpy as np

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
