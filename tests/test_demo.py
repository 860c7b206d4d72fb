"""The tour: it runs the commands that it prints, and flies nothing twice."""

import os
import re
import shlex
import socket
import webbrowser
from pathlib import Path

import pytest

from infoplan import commands
from infoplan.cli import main
from infoplan.output import Output

TINY = ["budget=130", "seeds=1", "backend=sequential"]
EXAMPLES = Path(__file__).parents[1] / "examples"


def printed(said: str) -> list[list[str]]:
    """Command lines of the tour, pasted as they stand, as the words after ``infoplan``."""
    found = re.findall(r"^command:\s+((?:.*\\\n)*.*)$", said, re.MULTILINE)
    return [shlex.split(line.replace("\\\n", " "))[1:] for line in found]


def tables(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet")}


@pytest.fixture(scope="module")
def toured(tmp_path_factory) -> Path:
    """A folder with spaces, in which a tour has been made."""
    folder = tmp_path_factory.mktemp("demo") / "my tour"
    assert main(["demo", f"results_dir={folder}", *TINY]) == 0
    return folder


@pytest.fixture
def no_network(monkeypatch):
    def refuse(*arguments, **options):
        raise AssertionError("the tour asks the network")

    for name in ("create_connection", "getaddrinfo", "gethostbyname"):
        monkeypatch.setattr(socket, name, refuse)


def test_the_log_of_the_tour_is_the_example(toured):
    assert (toured / "harbour.csv").read_bytes() == (EXAMPLES / "harbour.csv").read_bytes()


def test_the_tour_leaves_all_that_it_tells_of(toured):
    pytest.importorskip("pyproj")
    assert len(list((toured / "runs").glob("*.yaml"))) == 4
    assert len(list(toured.glob("curves/*/*.parquet"))) == 4
    for name in ("terrain-volcano", "fig3", "fig6"):
        assert (toured / "figures" / f"{name}.png").exists()
    assert "puct-copod-volcano" in (toured / "report.html").read_text(encoding="utf-8")
    (survey,) = (toured / "survey" / "surveys").iterdir()
    for name in ("clean.csv", "picture.png", "page.html", "next/next.csv", "next/next.gpx"):
        assert (survey / name).exists()


def test_a_second_tour_runs_what_it_prints_and_flies_nothing(
    toured, no_network, monkeypatch, capfd
):
    called, before = [], tables(toured)
    really = commands.call

    def call(words):
        called.append(words)
        return really(words)

    monkeypatch.setattr(commands, "call", call)
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["demo", f"results_dir={toured}", *TINY]) == 0
    said = capfd.readouterr().out
    assert called[0][0] == "demo"
    assert printed(said) == called[1:]
    assert len(called) > 8
    assert {words[0] for words in called} >= {"run", "show", "figures", "claims", "report"}
    assert tables(toured) == before
    assert re.findall(r"(\d+) missions? computed", said) == ["0"] * 3
    assert "1 seed is too few for any verdict" in " ".join(said.split())
    assert "nothing is decided" in said
    assert said.rstrip().endswith(str(toured / "report.html"))


@pytest.mark.long
def test_another_budget_in_the_same_folder_stays_apart(toured, capfd):
    assert main(["demo", f"results_dir={toured}", *TINY[1:], "budget=140"]) == 0
    said = capfd.readouterr().out
    assert "volcano, budget 140, 1 seed" in said


@pytest.mark.parametrize("flags", [[], ["--no-open"]])
def test_the_page_opens_for_whoever_sits_at_a_terminal(toured, flags, monkeypatch, capfd):
    opened = []

    class Browser:
        def open(self, address: str) -> bool:
            opened.append(address)
            return True

    monkeypatch.setattr(webbrowser, "get", Browser)
    monkeypatch.setattr(Output, "isatty", lambda self: True)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("infoplan.demo_command.tour", lambda *arguments: iter(()))
    assert main(["demo", f"results_dir={toured}", *flags]) == 0
    assert opened == ([] if flags else [(toured / "report.html").as_uri()])
    assert str(toured / "report.html") in capfd.readouterr().out.replace("\n", "")


def test_without_a_screen_or_a_browser_the_path_is_told(toured, monkeypatch, capfd):
    def none():
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "get", none)
    monkeypatch.setattr(Output, "isatty", lambda self: True)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("infoplan.demo_command.tour", lambda *arguments: iter(()))
    assert main(["demo", f"results_dir={toured}"]) == 0
    assert "Open in a browser:" in capfd.readouterr().out


def test_a_folder_that_cannot_be_written_is_told_in_a_sentence(tmp_path, capfd):
    (tmp_path / "file").write_text("")
    assert main(["demo", f"results_dir={tmp_path / 'file'}"]) == 2
    said = capfd.readouterr()
    assert len(said.err.splitlines()) == 1
    assert f"results_dir={tmp_path / 'file'} is a file: name a folder" in said.err
    assert said.out == ""


def test_without_pyproj_the_survey_is_left_out(toured, monkeypatch):
    from infoplan.demo_command import _survey_steps

    monkeypatch.setattr("infoplan.demo_command.find_spec", lambda name: None)
    (step,) = _survey_steps(toured)
    assert step.commands == ()
    assert "pip install 'infoplan[survey]'" in step.text


def test_a_failed_command_ends_the_tour(tmp_path, monkeypatch, capfd):
    really = commands.call
    monkeypatch.setattr(commands, "call", lambda words: really(words) if words[0] == "demo" else 1)
    assert main(["demo", f"results_dir={tmp_path}", *TINY]) == 1
    said = capfd.readouterr().out
    assert said.count("command:") == 1
    assert "ends here" in said


@pytest.mark.long
def test_the_whole_tour(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(os.environ, "COLUMNS", "80")
    assert main(["demo"]) == 0
    said = capfd.readouterr().out
    assert "2 seeds are too few for any verdict" in " ".join(said.split())
    lines = [line for line in said.splitlines() if not re.match(r"\S+ seed \d|\[\d", line)]
    assert max(map(len, lines)) <= 90  # a path that is longer stays whole
    assert len(list(tmp_path.glob("infoplan-demo/curves/*/*.parquet"))) == 8
