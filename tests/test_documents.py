"""Every example of the README and the documents runs: Python as it is, commands on a small study.

Every link within the project leads somewhere.
"""

import os
import re
import shlex
import shutil
from pathlib import Path

import pandas
import pytest
from command import infoplan

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCKS = [
    (page.name, kind, text)
    for page in PAGES
    for kind, text in re.findall(
        r"```(console|python)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL
    )
]
PYTHON = {text: page for page, kind, text in BLOCKS if kind == "python"}
COMMANDS = [
    line.partition("#")[0].strip()
    for _, kind, text in BLOCKS
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
    folder = tmp_path_factory.mktemp("documents")
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
    exec(compile(text, PYTHON[text], "exec"), names)


@pytest.mark.parametrize("command", dict.fromkeys(COMMANDS))
def test_command(command, study, tmp_path):
    words = small(command.replace("<run>", a_run(study)))
    if words[0] in ("run", "replay"):
        # What it computes must not mix with the study that the other examples read.
        shutil.copytree(study / "results", tmp_path / "results")
        words.append(f"results_dir={tmp_path / 'results'}")
    done = infoplan(*words, cwd=study, env=dict(os.environ), check=False)
    assert done.returncode == 0, done.stderr + done.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links(page):
    text = re.sub("```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", text) if "://" not in target]
    for target in targets:
        path, _, anchor = target.partition("#")
        file = page.parent / path if path else page
        assert file.exists(), f"{page.name} links to {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = {
                re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings
            }
            assert anchor in slugs, f"{page.name} links to {target}"


def test_the_readme_is_short_and_leads_to_every_page():
    text = PAGES[0].read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 200
    assert [page.name for page in PAGES[1:] if f"(docs/{page.name})" not in text] == []


def test_there_are_examples():
    assert len(PYTHON) > 4
    assert len(COMMANDS) > 10
