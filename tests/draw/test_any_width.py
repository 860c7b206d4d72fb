"""Every command that prints a table, at many widths, in a terminal, and with hostile labels."""

import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from copy import deepcopy
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from markdown_it import MarkdownIt
from rich.cells import cell_len

from infoplan.analyse import find_missions
from infoplan.cli import main
from infoplan.config import Config, DetectorConfig, FileConfig
from infoplan.draw.console import wide_console, wrapped
from infoplan.draw.progress import listener
from infoplan.draw.study_tables import print_plan, print_summary
from infoplan.study.runner import plan_study, run_study
from infoplan.study.study import Study

WIDTHS = (40, 60, 80, 100, 120, 200)
SLOW = ("run", "dry-run", "replay", "audit")
"""Commands that are tried at two widths only, as long ones in a terminal, too."""

UNIT = "<script>\x1b[31m[/red]`|"
RUN = [
    "run", "-m", "terrain=volcano", "planner=uct", "detector=none,copod", "rho=0.1",
    "planner.exploration=0.3,0.7", "budget=200", "grid=[12,12]", "planner.iterations=20",
    "model.pilot_iterations=10", "model.iterations=1", "seeds=2", "backend=sequential",
]  # fmt: skip
COMMANDS = {
    "run": RUN,
    "dry-run": [*RUN, "--dry-run"],
    "status": ["status"],
    "claims": ["claims", "planner.exploration=0.7"],
    "leaderboard": ["leaderboard"],
    "show": ["show", "HASH"],
    "replay": ["replay", "HASH", "detector=best", "backend=sequential"],
    "audit": ["audit", "run=NAME", "seeds=[0]"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    assert main([*RUN, f"results_dir={folder}"]) == 0
    return folder


def line(command: str, folder: Path) -> list[str]:
    """Command line of a command on the runs of a folder."""
    name = next(run for run in find_missions(folder).options if run.startswith("uct-copod"))
    words = [
        word.replace("HASH", name.rsplit("-", 1)[1]).replace("NAME", name)
        for word in COMMANDS[command]
    ]
    return [*words, f"results_dir={folder}"]


def numbers(text: str) -> set[str]:
    """Words that hold figures; the seconds of this very call apart."""
    text = re.sub(r"(in|about) \d[\d.]* (s|min)\b", "", text)
    return {word for word in text.split() if re.search(r"\d", word)}


def too_long(text: str, width: int) -> list[str]:
    """Lines longer than the width, but for words that no line could hold."""
    lines = [line.rstrip() for line in text.splitlines()]
    return [line for line in lines if cell_len(line) > width and " " in line.strip()]


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=pytest.mark.long) if c == "dry-run" else c for c in COMMANDS]
)
def test_at_every_width_lines_fit_and_numbers_stay_whole(folder, command, capfd, monkeypatch):
    def said() -> str:
        capfd.readouterr()
        assert main(line(command, folder)) == 0
        return capfd.readouterr().out

    monkeypatch.delenv("COLUMNS", raising=False)
    if command == "replay":
        said()  # what it computes is kept from now on
    full = said()
    assert "\x1b" not in full
    assert "left out" not in full
    if command in ("run", "dry-run", "status"):  # what was swept has a column
        assert "planner.exploration" in full.split()
        assert {"0.3", "0.7"} <= set(full.split())
    for width in (40, 80) if command in SLOW else WIDTHS:
        monkeypatch.setenv("COLUMNS", str(width))
        narrow = said()
        assert not too_long(narrow, width)
        missing = {word for word in numbers(full) - numbers(narrow) if word not in narrow}
        flat = " ".join(narrow.split())
        if command == "status" and "left out for want of room: last (UTC)" in flat:
            continue  # times are what it can do without
        if command == "claims" and "left out for want of room: p" in flat:
            missing -= set(re.findall(r"(?<=\s)[01]\.\d{3}(?=\s)", full))  # so are p values
        # Axes of curves and names of two words may be broken anew.
        assert missing <= {word for word in missing if "└" in word or word == "200"}


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=pytest.mark.long) if name in SLOW[1:] else name for name in COMMANDS],
)
def test_in_a_terminal(folder, command):
    shown = in_terminal(60, line(command, folder))
    kept = shown.replace("\x1b[2K", "\n")  # what stood there is erased: a bar that has moved on
    plain = re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", kept).replace("\r", "")
    # A mission's line stays whole, so that it can be searched for.
    told = [line for line in plain.splitlines() if not re.match(r"\[\d+/\d+\]", line)]
    assert not too_long("\n".join(told), 60)
    words = {"run": "planner.exploration", "dry-run": "stored", "status": "done",
             "claims": "UNDECIDED", "leaderboard": "behind the first", "show": "final RMSE",
             "replay": "replayed less flown", "audit": "all hold"}  # fmt: skip
    assert words[command] in plain
    if command == "status":
        assert "\x1b[" in shown
        assert "\x1b[" not in in_terminal(60, line(command, folder), TERM="dumb")


def in_terminal(width: int, arguments: list[str], **environment: str) -> str:
    """Run a command in a terminal of some width; returns all that it printed."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, width, 0, 0))
    kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    process = subprocess.Popen(
        [sys.executable, "-m", "infoplan.cli", *arguments],
        env=kept | {"TERM": "xterm-256color"} | environment,
        stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    shown = io.BytesIO()
    try:
        while chunk := os.read(ours, 65536):
            shown.write(chunk)
    except OSError:
        pass  # the other end is closed
    finally:
        os.close(ours)
        process.kill()
        process.wait()
    return shown.getvalue().decode()


@pytest.mark.parametrize("encoding", ["ascii", pytest.param("latin-1", marks=pytest.mark.long)])
@pytest.mark.parametrize("command", ["run", "status", "claims", "show", "leaderboard"])
def test_poor_encodings_get_plain_characters(folder, command, encoding, monkeypatch):
    raw = io.BytesIO()
    with io.TextIOWrapper(raw, encoding=encoding) as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        assert main(line(command, folder)) == 0
        stream.flush()
        said = raw.getvalue().decode(encoding)
    assert said.isascii() or encoding == "latin-1"
    assert "---" in said
    assert "\\u" not in said


def test_a_closed_output_is_told_in_one_sentence(folder):
    shell = 'exec "$0" -m infoplan.cli "$@" >&-'
    done = subprocess.run(
        ["sh", "-c", shell, sys.executable, *line("status", folder)], capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr == (
        "infoplan: standard output cannot be written (it is closed): what it should show is lost\n"
    )


# Labels of any text, and a map of tiny values


@pytest.fixture(scope="module")
def hostile(tmp_path_factory) -> tuple[list[Config], Study, Path]:
    """Two runs on a map of tiny values, whose unit and folder are no plain words."""
    folder = tmp_path_factory.mktemp("hostile") / "m[/b]k"
    y, x = np.mgrid[0:1:30j, 0:1:30j]
    path = tmp_path_factory.mktemp("maps") / "[red]<b>.npy"
    np.save(path, 0.1 * (np.exp(-8 * ((x - 0.6) ** 2 + (y - 0.5) ** 2)) + 0.1 * np.sin(9 * x * y)))
    config = Config(budget=160, grid=[12, 12], seeds=2, backend="sequential", rho=0.1)
    config.results_dir = str(folder)
    config.detector = DetectorConfig()
    config.terrain = FileConfig(name="file", path=str(path), unit=UNIT)
    config.planner = replace(config.planner, iterations=30)
    config.model = replace(config.model, pilot_iterations=20, iterations=2)
    config.sensor = replace(config.sensor, noise_std=1e-4)
    other = deepcopy(config)
    other.planner.exploration = 0.7
    configs = [config, other]
    return configs, run_study(configs, listener(wide_console())), folder


def test_the_closing_table_and_the_plan_print_labels_as_they_are(hostile, capfd, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    configs, study, folder = hostile
    capfd.readouterr()
    print_summary(study, wide_console())
    print_plan(plan_study(configs, listener(wide_console()).say), configs[0], wide_console())
    said = capfd.readouterr().out
    assert r"RMSE in <script>\x1b[31m[/red]`|: mean" in said
    assert f"tables: {folder}/curves" in said
    assert "0 missions would run, 4 are stored" in said
    assert "\x1b" not in said
    # Three digits of each mean, and as many decimals at the ends of its interval.
    assert re.search(r" 0\.0+[1-9]\d\d ", said)
    pairs = re.findall(r"\[(\S+), (\S+)\]", said)
    assert len(pairs) == 4
    decimals = [[len(end.partition(".")[2]) for end in pair] for pair in pairs]
    assert all(low == high > 3 for low, high in decimals)


@pytest.mark.parametrize(
    "command",
    [
        ["status"],
        ["show", "HASH"],
        ["claims", "planner.exploration=0.3"],
        ["claims", "planner.exploration=0.3", "--markdown"],
        ["leaderboard"],
        ["leaderboard", "--markdown"],
        ["leaderboard", "--html"],
        ["replay", "HASH", "detector=best", "backend=sequential"],
        ["audit", "seeds=[0]"],
    ],
)
def test_labels_of_any_text_do_nothing(hostile, command, capfd, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    _, study, folder = hostile
    name = study.names[0]
    words = [word.replace("HASH", name.rsplit("-", 1)[1]) for word in command]
    capfd.readouterr()
    assert main([*words, f"results_dir={folder}"]) == 0
    said = capfd.readouterr().out
    assert "\x1b" not in said
    assert "0 [0, 0] <" not in said
    if "--markdown" in command:
        rows = [row for row in said.splitlines() if row.startswith("|")]
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in rows}) == 1
        page = MarkdownIt("commonmark").enable("table").render(said)
        assert "<script" not in page
        assert "<table>" in page
    if command[0] in ("status", "replay"):
        assert f"{folder}" in said
    if command[0] == "show":
        # Numbers of a map of a thousandth are none of hundreds of it.
        assert re.search(r"final RMSE +\d\.\d\de-\d\d|final RMSE +0\.0*[1-9]\d\d", said)
        assert re.search(r"relief 0\.0*[1-9]", said) or re.search(r"relief \d\.\d\de-\d\d", said)
    if "--html" in command:
        page = (folder / "leaderboard.html").read_text(encoding="utf-8")
        assert "\x1b" not in page
        assert "<script" not in page
        HTMLParser().feed(page)


@pytest.mark.parametrize("width", range(12, 40))
def test_no_line_parts_a_number_from_its_unit(width):
    text = "4 missions computed, 0 kept in 3.0 s; 12 seeds, 250 ft and 1.5 GB of memory, speed 9 %"
    lines = wrapped(text, width)
    assert " ".join(lines) == text
    assert all(len(line) <= width for line in lines)
    pieces = ["3.0 s;", "250 ft", "1.5 GB", "9 %"]
    assert [piece for line in lines for piece in pieces if piece in line] == pieces
