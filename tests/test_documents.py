"""Every example of the README and the documents runs: Python as it is, commands on a small study.

Every link within the project leads somewhere, and so does every path that a guide names.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas
import pytest
import yaml
from command import infoplan

from infoplan.cli import main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
GUIDES = [page for page in PAGES if page.name in ("CONTRIBUTING.md", "architecture.md")]
BLOCKS = [
    (page.name, kind, text)
    for page in PAGES
    for kind, text in re.findall(
        r"```(console|python|bash)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL
    )
]
PYTHON = {text: page for page, kind, text in BLOCKS if kind == "python"}
LINES = [
    line.partition(" #")[0].strip()
    for _, kind, text in BLOCKS
    if kind != "python"
    for line in text.replace("\\\n", " ").splitlines()
    if line and not line.startswith("#")
]
SPREAD = "backend=dask|hydra/launcher="
SLOW = f"{SPREAD}|mtsthelens_after|=mp4|callbacks=|^infoplan demo"
"""What needs a download, ffmpeg, a server or a minute is left to the tests of these."""
COMMANDS = [line for line in LINES if line.startswith("infoplan ") and not re.search(SLOW, line)]
SWEEPS = [line for line in COMMANDS if " -m " in line and not re.search("dry-run|sweeper=", line)]
CLUSTERS = [line for line in LINES if re.search(SPREAD, line)]
HERE = [line for line in CLUSTERS if not re.search("scheduler=|slurm", line)]
SMALL = {
    "terrain": "volcano",
    "budget": "130",
    "grid": "[8,8]",
    "seeds": "2",
    "backend": "sequential",
    "planner.iterations": "10",
    "model.pilot_iterations": "3",
    "model.iterations": "1",
}


def small(command: str) -> list[str]:
    """Add to a command what makes it short, without touching what it says itself."""
    words = shlex.split(command)[1:]
    said = {word.partition("=")[0] for word in words}
    no_tree = any(re.match("planner=(lawnmower|random|greedy|own)", word) for word in words)
    added = {
        "run": [name for name in SMALL if not (no_tree and name == "planner.iterations")],
        "replay": ["backend"],
        "next": [] if no_tree else ["planner.iterations"],
        "survey": ["grid", "model.pilot_iterations", "model.iterations"],
    }
    return [*words, *[f"{o}={SMALL[o]}" for o in added.get(words[0], []) if o not in said]]


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("documents")
    for example in (ROOT / "examples").glob("*.py"):
        shutil.copy(example, folder)
    infoplan(*small("infoplan run -m experiment=fig5"), cwd=folder)
    for log in ("harbour.csv", "harbour_again.csv"):
        shutil.copy(ROOT / "examples" / log, folder)
    infoplan(*small("infoplan survey harbour.csv results_dir=surveys"), cwd=folder)
    return folder


def a_run(folder: Path) -> str:
    return next((folder / "results" / "runs").glob("puct-copod-*-rho0.1-batch-*.yaml")).stem


@pytest.mark.parametrize("text", PYTHON, ids=lambda text: text.strip().splitlines()[0][:40])
def test_python(text, study, monkeypatch):
    monkeypatch.chdir(study)
    names: dict[str, object] = {"pandas": pandas}
    exec(compile(text, PYTHON[text], "exec"), names)


@pytest.mark.parametrize("command", dict.fromkeys(SWEEPS))
def test_a_sweep_is_understood(command, study, monkeypatch, capfd):
    monkeypatch.chdir(study)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main([*small(command), "--dry-run"]) == 0, capfd.readouterr()


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(line, marks=pytest.mark.long) if line in SWEEPS else line
        for line in dict.fromkeys(COMMANDS)
    ],
)
def test_command(command, study, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(study)
    monkeypatch.setattr(sys, "path", list(sys.path))
    command = command.replace("<survey>", next((study / "surveys" / "runs").glob("survey-*")).stem)
    if "hydra/sweeper=optuna" in command:
        pytest.importorskip("hydra_plugins.hydra_optuna_sweeper")
    words = small(command.replace("<run>", a_run(study)).replace("n_trials=20", "n_trials=2"))
    if words[0] in ("run", "replay") and "results_dir=surveys" not in words:
        # What it computes must not mix with the study that the other examples read.
        shutil.copytree(study / "results", tmp_path / "results")
        words.append(f"results_dir={tmp_path / 'results'}")
    assert main(words) == 0, capfd.readouterr()


@pytest.mark.parametrize("command", CLUSTERS)
def test_a_command_for_a_cluster_is_understood(command, study, monkeypatch, capfd):
    """All but the launcher is composed as it stands; of a launcher of Hydra its options."""
    monkeypatch.chdir(study)
    if "hydra/launcher=submitit" in command:
        pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
        # What is shown is one configuration: of several values the first.
        words = small(re.sub(r"=([\w.]+),[\w.,]+", r"=\1", command.replace(" -m ", " ")))
        assert main([*words, "--cfg", "hydra"]) == 0, capfd.readouterr()
        said = capfd.readouterr().out
        for name, value in re.findall(r"hydra\.launcher\.(\w+)=(\w+)", command):
            assert f"    {name}: {value}\n" in said
    else:
        pytest.importorskip("distributed")
        assert main([*small(command), "--dry-run"]) == 0, capfd.readouterr()


@pytest.mark.long
@pytest.mark.parametrize("command", HERE)
def test_a_command_for_this_machine_as_a_cluster(command, study, tmp_path):
    pytest.importorskip("distributed")
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    done = infoplan(*small(command), f"results_dir={tmp_path}", cwd=study)
    assert "failed" not in done.stdout
    stored = list(tmp_path.rglob("curves/*/*.parquet"))
    assert len(stored) == 2 * len(list(tmp_path.glob("runs/*"))) > 2


@pytest.mark.parametrize("line", [line for line in LINES if line.startswith("dask ")])
def test_a_command_of_dask_is_understood(line):
    module = pytest.importorskip(f"distributed.cli.dask_{line.split()[1]}")
    assert module.main.make_context("dask", line.split()[2:])


@pytest.mark.parametrize("text", [text for _, kind, text in BLOCKS if kind == "bash"])
def test_a_script_is_one(text):
    subprocess.run(["bash", "-n"], input=text, text=True, check=True)


def test_every_line_of_a_console_is_run():
    left = [line for line in LINES if not line.startswith(("infoplan ", "dask ", "make "))]
    assert left == []


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


def links_of(page: Path) -> set[Path]:
    found = re.findall(r"""\]\(([^)#]+)|(?:src|href)="([^"#]+)""", page.read_text(encoding="utf-8"))
    return {(page.parent / (one or other)).resolve() for one, other in found}


def test_the_readme_is_short_and_leads_to_every_page():
    readme, *others = PAGES
    assert len(readme.read_text(encoding="utf-8").splitlines()) <= 200
    front = ROOT / "docs" / "index.md"
    there = links_of(readme) | links_of(front)
    assert [page.name for page in others if page not in there] == []


@pytest.mark.parametrize("page", ["after_a_survey", "rerun_the_paper", "own_methods"])
def test_what_newcomers_want_is_a_click_away(page):
    """To clean a log, to rerun the paper, to add a detector."""
    readme, front = PAGES[0], ROOT / "docs" / "index.md"
    path = ROOT / "docs" / f"{page}.md"
    assert path in links_of(readme) & links_of(front)


def test_every_picture_of_the_readme_is_there():
    found = links_of(PAGES[0])
    pictures = {path for path in found if path.suffix in (".png", ".gif")}
    assert len(pictures) > 4
    assert [path for path in found if "://" not in str(path) and not path.exists()] == []


def test_every_picture_is_drawn_by_a_target():
    """`make pictures` calls those that name it, or run the script that does."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.search(r"^pictures: ([^#\n]+)", makefile, re.MULTILINE)[1].split()
    drawn = ""
    for target in targets:
        recipe = re.search(rf"^{target}:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)[1]
        drawn += recipe
        for script in re.findall(r"scripts/\w+\.py|benchmarks\.\w+", recipe):
            file = script if script.endswith(".py") else script.replace(".", "/") + ".py"
            drawn += (ROOT / file).read_text(encoding="utf-8")
    pictures = [
        path.relative_to(ROOT / "docs")
        for kind in ("png", "gif", "svg")
        for path in (ROOT / "docs").rglob(f"*.{kind}")
        if "_build" not in path.parts
    ]
    assert len(pictures) > 15
    names = {path.name if len(path.parts) == 1 else path.parts[0] for path in pictures}
    assert [name for name in sorted(names) if name not in drawn] == []


def test_every_picture_is_shown():
    shown = set().union(*map(links_of, PAGES))
    pictures = [p for kind in ("png", "gif") for p in (ROOT / "docs").rglob(f"*.{kind}")]
    pictures = [path for path in pictures if "_build" not in path.parts]
    assert [path.name for path in pictures if path not in shown] == []


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.name)
def test_what_a_guide_names_is_there(page):
    """Files and folders, `<name>` standing for any; targets of make."""
    text = page.read_text(encoding="utf-8")
    quoted = re.sub(r"```\w+\n.*?```", "", text, flags=re.DOTALL)
    quoted = " ".join(re.findall(r"`+([^`]+)`+", quoted))
    paths = re.findall(r"[\w.<>*-]*/[\w.<>*/-]*", quoted)
    paths = [path for path in paths if not path.startswith((".venv", "htmlcov", "docs/_build"))]
    assert len(paths) > 10
    for path in paths:
        pattern = re.sub("<[a-z]+>", "*", path.rstrip("/"))
        assert list(ROOT.glob(pattern)), f"{page.name} names {path}"
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z-]+)", quoted)) <= targets


def test_the_architecture_names_every_package():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    packages = [file.parent.name for file in (ROOT / "infoplan").glob("*/__init__.py")]
    assert len(packages) > 5
    assert [name for name in packages if not re.search(rf"\b{name}\b", text)] == []


def test_the_workflow_runs_the_oldest_and_the_newest_python():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
    job = workflow["jobs"]["run"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    least, below = re.findall(r"3\.(\d+)", project["requires-python"])
    assert job["strategy"]["matrix"]["python"] == [f"3.{least}", f"3.{int(below) - 1}"]
    assert job["steps"][-1] == {"run": ".ci/run"}
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


def test_the_hooks_are_the_tools_of_make_check():
    settings = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    hooks = [hook for repository in settings["repos"] for hook in repository["hooks"]]
    assert {repository["repo"] for repository in settings["repos"]} == {"local"}
    check = (ROOT / "Makefile").read_text().partition("\ncheck:")[2].partition("\n\n")[0]
    tools = {line.split()[0].rpartition("/")[2] for line in check.splitlines()[1:]}
    used = {hook["entry"].split()[0].removeprefix(".venv/bin/") for hook in hooks}
    assert {"ruff", "mypy"} <= used & tools


def test_there_are_examples():
    assert len(PYTHON) > 4
    assert len(COMMANDS) > 10
