"""Every example of the README runs: its Python as it stands, its commands on a small study."""

import os
import re
import shlex
import shutil
from pathlib import Path

import pandas
import pytest
from command import infoplan

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(console|python)\n(.*?)```", README, re.DOTALL)
PYTHON = [text for kind, text in BLOCKS if kind == "python"]
COMMANDS = [
    line.partition("#")[0].strip()
    for kind, text in BLOCKS
    if kind == "console"
    for line in text.replace("\\\n", " ").splitlines()
    if line.startswith("infoplan ")
]
COMMANDS = [line for line in COMMANDS if not re.search("scheduler=|mtsthelens_after|=mp4", line)]
"""Those that need a cluster, a download or ffmpeg are left to the tests of these."""
SMALL = {
    "terrain": "volcano",
    "budget": "130",
    "grid": "[8,8]",
    "seeds": "2",
    "n_jobs": "2",
    "planner.iterations": "10",
    "model.pilot_iterations": "3",
    "model.iterations": "1",
}


def small(command: str) -> list[str]:
    """Add to a command what makes it short, without touching what it says itself."""
    words = shlex.split(command)[1:]
    said = {word.partition("=")[0] for word in words}
    no_tree = any(re.match("planner=(lawnmower|random|greedy|own)", word) for word in words)
    added = [
        f"{name}={value}"
        for name, value in SMALL.items()
        if name not in said and not (no_tree and name == "planner.iterations")
    ]
    return words + added if words[0] == "run" else words


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("readme")
    for example in (ROOT / "examples").glob("*.py"):
        shutil.copy(example, folder)
    infoplan(*small("infoplan run -m experiment=fig5"), cwd=folder)
    return folder


def a_run(folder: Path) -> str:
    return next((folder / "results" / "runs").glob("puct-copod-*-rho0.1-batch-*.yaml")).stem


@pytest.mark.parametrize("text", PYTHON, ids=lambda text: text.strip().splitlines()[0][:40])
def test_python(text, study, monkeypatch):
    monkeypatch.chdir(study)
    names: dict[str, object] = {"pandas": pandas}
    exec(compile(text, "README.md", "exec"), names)


@pytest.mark.parametrize("command", dict.fromkeys(COMMANDS))
def test_command(command, study, tmp_path):
    words = small(command.replace("<run>", a_run(study)))
    if words[0] in ("run", "replay"):
        # What it computes must not mix with the study that the other examples read.
        shutil.copytree(study / "results", tmp_path / "results")
        words.append(f"results_dir={tmp_path / 'results'}")
    done = infoplan(*words, cwd=study, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr + done.stdout


def test_there_are_examples():
    assert len(PYTHON) > 4
    assert len(COMMANDS) > 10
