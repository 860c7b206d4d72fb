"""No command minds the plotting backend that its environment names."""

import os
import subprocess
import sys
from pathlib import Path

import made_methods
import pytest

BACKENDS = ("module://matplotlib_inline.backend_inline", "nonsense", "TkAgg")
SHORT = ("terrain=volcano", "budget=130", "seeds=1", "grid=[10,10]", "planner.iterations=5",
         "model.pilot_iterations=1", "model.iterations=1", "backend=sequential")  # fmt: skip


def ended(backend: str, command: list[str], folder: Path) -> str:
    """Run Python in a process that inherits a backend, without a display; returns its output."""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=300, cwd=folder,
        env=environment | {"MPLBACKEND": backend},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


COMMANDS = (
    ["report", "results_dir=made"],
    ["terrain", "show", "terrain=jacksboro"],
    ["figures", "fig3", "results_dir=made"],
    ["animate", "results_dir=made"],
    ["run", "detector=pyod", "results_dir=flown", *SHORT],
    ["audit", "results_dir=flown"],
)


def run_all(backend: str, commands: tuple[list[str], ...], folder: Path) -> None:
    """Run commands one after the other, a process each: one imports nothing for the next."""
    made_methods.store(folder / "made", "puct", "copod")
    program = "import sys; from infoplan.cli import main; sys.exit(main())"
    for command in commands:
        ended(backend, ["-c", program, *command], folder)


def test_commands_that_draw_run_under_any_backend(tmp_path):
    run_all("nonsense", COMMANDS[:2], tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("backend", BACKENDS)
def test_every_command_that_draws_or_asks_pyod_runs(backend, tmp_path):
    run_all(backend, COMMANDS, tmp_path)


LIBRARY = """
import os
from pathlib import Path
from infoplan.analyse import find_missions
from infoplan.draw.report import render
from infoplan.draw.animate import animate
from infoplan.draw.figures import draw_figures
from infoplan.terrain import load_terrain
from infoplan.detect.any_pyod import build
from rich.console import Console

before = os.environ["MPLBACKEND"]
load_terrain("jacksboro")
study = find_missions("made")
render(study)
draw_figures(study, ["fig3"])
build("ECOD", 0.1, {}, 0)
assert os.environ["MPLBACKEND"] == before
import matplotlib
print(matplotlib.rcParams["backend"])
"""


@pytest.mark.long
@pytest.mark.parametrize(("backend", "kept"), [("nonsense", "agg"), ("svg", "svg")])
def test_a_users_backend_stays_theirs(backend, kept, tmp_path):
    made_methods.store(tmp_path / "made", "puct", "copod")
    assert ended(backend, ["-c", LIBRARY], tmp_path).strip().lower() == kept


@pytest.mark.long
def test_nothing_here_imports_pyplot(tmp_path):
    made_methods.store(tmp_path / "made", "puct", "copod")
    code = LIBRARY.replace('build("ECOD", 0.1, {}, 0)', "") + (
        "\nanimate(Path('made'), Console())"
        "\nimport sys\nassert 'matplotlib.pyplot' not in sys.modules"
    )
    ended("TkAgg", ["-c", code], tmp_path)
