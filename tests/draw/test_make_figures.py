"""The whole way from nothing to the figures, in small."""

import subprocess
import sys
from pathlib import Path

from infoplan.draw.figures import NAMES

SCRIPT = Path(__file__).parents[2] / "scripts" / "make_figures.py"
SMALL = [
    "terrain=volcano",
    "budget=130",
    "seeds=1",
    "grid=[10,10]",
    "n_jobs=1",
    "planner.iterations=5",
    "model.pilot_iterations=1",
    "model.iterations=1",
]


def test_what_is_missing_is_run_then_all_is_drawn(tmp_path):
    command = [sys.executable, SCRIPT, *SMALL, f"results_dir={tmp_path}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(list(tmp_path.glob("curves/*/seed=0.parquet"))) == 14
    # One fault alone, and nothing that was explained.
    names = [name for name in NAMES if name not in ("outliers", "explain")]
    expected = {f"{name}.{kind}" for name in names for kind in ("png", "pdf", "csv")}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == expected
