"""Help after every command, and what is said about words that no command knows."""

import json
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from command import infoplan

from infoplan.cli import main
from infoplan.command_line.command import Command
from infoplan.commands import FIGURES
from infoplan.commands import infoplan as commands
from infoplan.config import METHODS, TERRAIN_SCHEMAS, Config
from infoplan.draw.figures import NAMES
from infoplan.options import walk

EXAMPLES = Path(__file__).parents[2] / "examples"


def paths(group: click.Group = commands, before: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every command, as its words."""
    found = []
    for name, command in group.commands.items():
        found.append((*before, name))
        if isinstance(command, click.Group):
            found += paths(command, (*before, name))
    return found


def declaration(path: tuple[str, ...]) -> click.Command:
    command: click.Command = commands
    for name in path:
        assert isinstance(command, click.Group)
        command = command.commands[name]
    return command


@pytest.fixture(autouse=True)
def a_pipe_of_80_columns(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.mark.parametrize("path", paths(), ids=" ".join)
def test_every_command_has_a_page_that_tells_what_is_declared(path, capfd):
    assert main([*path, "--help"]) == 0
    page = capfd.readouterr().out
    assert main([*path, "-h"]) == 0
    assert capfd.readouterr().out == page
    assert main(["help", *path]) == 0
    assert capfd.readouterr().out == page
    assert page.startswith(f"Usage: infoplan {' '.join(path)}")
    assert "\x1b" not in page
    assert max(map(len, page.splitlines())) <= 80
    assert "Example" in page
    command = declaration(path)
    text = " ".join(page.split())
    assert command.help.rstrip(".") in text
    for param in command.params:
        if isinstance(command, Command) and param in command.settings:
            assert f"  {param.word}{'=' * param.named}" in page
            assert " ".join(f"{param.doc} ({param.allowed()})".split()) in text
        elif not param.hidden:
            assert ", ".join(param.opts) in page
            assert param.help in text


@pytest.mark.parametrize("columns", ["45", "60", "100", "160"])
@pytest.mark.parametrize("path", [("run",), ("audit",), ()], ids=" ".join)
def test_a_page_keeps_to_columns(path, columns, monkeypatch, capfd):
    monkeypatch.setenv("COLUMNS", columns)
    assert main([*path, "--help"]) == 0
    longest = max(
        len(line) for line in capfd.readouterr().out.splitlines() if "|" not in line
    )  # a list of choices is one word
    assert longest <= int(columns)
    assert longest > min(int(columns), 90) * 0.7


def test_the_page_of_run_tells_every_option_of_every_choice(capfd):
    assert main(["run", "--help"]) == 0
    page = capfd.readouterr().out
    text = " ".join(page.split())
    schemas = [Config(), *(choice for group in METHODS.values() for choice in group.values())]
    groups = ["", *(f"{group}." for group, choices in METHODS.items() for _ in choices)]
    schemas += [schema() for schema in TERRAIN_SCHEMAS.values()]
    groups += ["terrain."] * len(TERRAIN_SCHEMAS)
    for schema, group in zip(schemas, groups, strict=True):
        for name, _, metadata in walk(schema, group):
            if not name.endswith(".name"):
                assert f"  {name}=" in page
                assert metadata["doc"] in text, name
                assert metadata["unit"] in text
    assert "planner.exploration=0.3 C of the (Pareto) UCB" in text
    assert "share of the data to flag (a number, above 0 and at most 0.5)" in text
    assert (
        "distance between samples (a number, above 0 and at most 1e+12, in workspace units)" in text
    )
    assert "Gaussian noise (a number, at least 0 and at most 1e+12, in the terrain's unit)" in text
    assert (
        "as many as new samples (per_sample or a whole number, at least 0 and at most 1e+09)"
        in text
    )


def test_the_choice_that_is_made_comes_first(capfd):
    assert main(["run", "detector=local", "--help"]) == 0
    page = capfd.readouterr().out
    assert page.index("\ndetector=local:") < page.index("\ndetector=copod:")
    assert "detector=local|none" in page


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["detector=own", "detector.function=own_detector.jumps"],
            ["Flag what jumps out of the track",
             "detector.options.threshold=5 Largest deviation from the neighbours along the track "
             "kept, in medians of all deviations (float)",
             "detector.options.reach=2 Neighbours before and after each sample that it is compared "
             "with (int)"],
        ),
        (["model=own", "model.function=own_model.Matern"], ["model.options.nu=", "(float)"]),
        (["planner=own", "planner.function=own_planner.farthest"],
         ["planner.options.actions=4 Length of the plan (int)"]),
        (["terrain=own", "terrain.function=own_terrain.ridges"], ["terrain.options.count="]),
    ],
)  # fmt: skip
def test_a_function_of_the_user_s_is_told_about(words, told, monkeypatch, capfd):
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main(["run", *words, "--help"]) == 0
    text = " ".join(capfd.readouterr().out.split())
    for part in told:
        assert part in text


def test_only_a_named_function_is_imported(tmp_path, monkeypatch, capfd):
    (tmp_path / "named_once.py").write_text(
        "print('imported')\n\ndef f(samples, model, rng): pass\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main(["run", "detector.function=named_once.f", "--help"]) == 0
    assert "imported" not in capfd.readouterr().out
    assert main(["run", "detector=own", "detector.function=named_once.f", "--help"]) == 0
    assert "imported" in capfd.readouterr().out
    assert main(["run", "detector=own", "detector.function=quiet.f", "--help"]) == 2
    assert "there is no module 'quiet'" in capfd.readouterr().err


def test_help_of_fetch_downloads_nothing(monkeypatch, capfd):
    monkeypatch.setattr("infoplan.terrain.fetch_helens", lambda: pytest.fail("downloads"))
    for words in (["terrain", "fetch", "--help"], ["help", "terrain", "fetch"]):
        assert main(words) == 0
        assert "Download" in capfd.readouterr().out


def test_help_wins_over_mistakes(capfd):
    assert main(["run", "--dry-rn", "rhoo=1", "--help"]) == 0
    assert capfd.readouterr().out.startswith("Usage: infoplan run")


@pytest.mark.parametrize("flags", [["--hydra-help"], ["--cfg", "job"], ["--cfg=job"],
                                   ["--info", "searchpath"], ["-i"]])  # fmt: skip
def test_hydra_s_own_pages_are_there(flags):
    assert len(infoplan("run", "rho=0.2", *flags).stdout.splitlines()) > 3


MISTAKES = {
    "rn": "there is no command 'rn' (did you mean 'run'?)",
    "help rn": "there is no command 'rn' (did you mean 'run'?)",
    "--versio": "there is no flag '--versio' (did you mean '--version'?)",
    "run --dry-rn": "there is no flag '--dry-rn' (did you mean '--dry-run'",
    "run --seeds=1": "--seeds=1 is written without dashes here: seeds=1",
    "run --seeds 1": "--seeds is written without dashes here: seeds=...",
    "run --n-jobs=2": "--n-jobs=2 is written without dashes here: n_jobs=2",
    "run --planner.exploration=1": "without dashes here: planner.exploration=1",
    "run --seed=1": "there is no flag '--seed' (did you mean",
    "run --cfg": "--cfg wants a value: job, hydra or all",
    "run --cfg jb": "--cfg jb is not a choice: use job, hydra or all",
    "run -m=1": "-m takes no value: write -m alone",
    "run puct": "infoplan run has no use for 'puct' (did you mean planner=puct?)",
    "run planner": "planner wants a value: write planner=..., uct, puct, weighted",
    "run rhoo=0.1": "there is no option 'rhoo' (did you mean 'rho'",
    "figures sed=1": "infoplan figures has no option 'sed' (did you mean 'seed'",
    "figures fig9": "there is no figure 'fig9'",
    "figures seed=x": "seed=x is not possible: it must be a whole number, at least 0",
    "figures --results_dir=x": "--results_dir=x is written without dashes here: results_dir=x",
    "claims planner.explorration=1": "(did you mean 'planner.exploration'",
    "claims --jsn": "there is no flag '--jsn' (did you mean '--json'",
    "claims --json=1": "--json takes no value: write --json alone",
    "claims rho=high": "rho=high cannot be read: it is a number, at least 0 and at most 1",
    "animate fps=0": "fps=0 is not possible: it must be a number, above 0 and at most 50",
    "animate fps=nan": "fps=nan is not possible",
    "animate format=avi": "format=avi is not possible: it must be gif or mp4 (of the file",
    "animate a b": "infoplan animate takes one run, not 2: a and b",
    "show a run=b": "infoplan show takes one run, not 2: b and a",
    "audit seeds=x": "seeds='x' is not a number of seeds",
    "replay": "infoplan replay takes one stored run",
    "next": "infoplan next takes one stored survey",
    "next x budget=5 frm=1,2": "infoplan next has no option 'frm' (did you mean 'from'",
    "next x budget=5 detector=none": "infoplan next has no option 'detector'",
    "replay x resume=perhaps": "resume=perhaps is not possible: resume must be true or false",
    "terrain": "Usage: infoplan terrain",
    "terrain shw": "there is no command 'shw' (did you mean 'show'?): use list, show, fetch",
    "terrain fetch now": "infoplan terrain fetch has no use for 'now'",
    "terrain show rho=1": "has no option 'rho': it takes results_dir=, and terrain= with",
    "status jso": "run=jso",
}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_is_one_sentence_with_the_nearest_names(line, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    assert main(line.split()) == 2
    said = capfd.readouterr()
    assert MISTAKES[line] in said.err + said.out
    if said.err:
        assert len(said.err.splitlines()) == 1
        assert said.err.count("' or '") <= 2
        assert len(said.err) < 500


def test_a_flag_may_be_anywhere_and_options_in_any_order(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "2024_11_25").mkdir()
    for words in (["--json", "results_dir=2024_11_25"], ["results_dir=2024_11_25", "--json"]):
        assert main(["status", *words]) == 0
        assert '"results_dir": "2024_11_25"' in capfd.readouterr().out


def test_the_status_of_a_study_is_that_of_the_folder_that_is_named(tmp_path, capfd):
    for words in (["rho=0.1"], ["-m", "rho=0.1"], ["rho=0.1", "-m"]):
        study = ["terrain=volcano", "seeds=2", f"results_dir={tmp_path / 'there'}", "--json"]
        assert main(["status", *words, *study]) == 0
        said = json.loads(capfd.readouterr().out)
        assert said["results_dir"] == str(tmp_path / "there")
        assert [run["missing"] for run in said["runs"]] == [[0, 1]]
    assert main(["status", "puct", "rho=0.1"]) == 2
    assert "ask for two things" in capfd.readouterr().err


def test_python_m_infoplan_is_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "infoplan", "--version"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("infoplan ")
    wrong = subprocess.run([sys.executable, "-m", "infoplan", "rum"], capture_output=True)
    assert wrong.returncode == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_output_that_cannot_be_written_is_one_sentence():
    for words in (["terrain", "list"], ["--help"], ["run", "--help"]):
        with open("/dev/full", "w") as full:
            done = subprocess.run([sys.executable, "-m", "infoplan", *words], stdout=full,
                                  stderr=subprocess.PIPE, text=True)  # fmt: skip
        assert done.returncode == 1
        assert len(done.stderr.splitlines()) == 1
        assert "standard output cannot be written (No space left on device)" in done.stderr


def test_closed_streams_are_told_of():
    for closing, status in ((">&-", 1), (">&- 2>&-", 1), ("2>&-", 0)):
        line = f'"{sys.executable}" -m infoplan terrain list {closing}'
        done = subprocess.run(["sh", "-c", line], capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        assert "Traceback" not in done.stderr
        if closing == ">&-":
            assert "standard output cannot be written (it is closed)" in done.stderr
            assert len(done.stderr.splitlines()) == 1


def test_a_terminal_of_few_letters_gets_escapes(tmp_path):
    folder = tmp_path / "Höhen"
    folder.mkdir()
    done = infoplan("status", f"results_dir={folder}", env={"PYTHONIOENCODING": "ascii"})
    assert "H\\xf6hen" in done.stdout


def test_the_declared_figures_are_those_that_are_drawn():
    assert FIGURES == NAMES


def test_a_survey_is_not_offered_the_detector_that_needs_true_labels(capfd):
    assert main(["survey", "--help"]) == 0
    said = capfd.readouterr().out
    assert "detector=none|copod" in said
    assert "best" not in said
