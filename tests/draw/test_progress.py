"""The display, fed by the pool."""

import io

import pytest
from rich.console import Console

from infoplan.draw import progress
from infoplan.draw.progress import Display, Line
from infoplan.study.estimate import Kind, Pace
from infoplan.study.flight import COMPILING


def display(terminal: bool = False, pace: Pace | None = None, skipped: int = 3) -> Display:
    lines = [Line(f"mission {number}", "ft", 1000, Kind("kind", 1.0)) for number in range(4)]
    console = Console(file=io.StringIO(), force_terminal=terminal, width=150, height=12)
    return Display(lines, pace or Pace(), 2, skipped, console)


def said(shown: Display) -> str:
    return shown.console.file.getvalue()


def test_reports_of_workers_are_shown():
    with display() as shown:
        shown.start(1)
        shown.report(1, 250, 12.5)
        assert (shown.lines[1].collected, shown.lines[1].rmse) == (250, 12.5)
        assert shown.lines[1].note == "250 of 1000 samples  RMSE 12.5 ft"
        assert shown.lines[0].state == "waiting"


def test_old_news_are_no_news():
    """Dask's events may come late: from before the report that is shown, or from a try lost."""
    with display() as shown:
        shown.start(1)
        shown.report(1, 250, 12.5)
        shown.report(1, 150, 99.0)
        assert (shown.lines[1].collected, shown.lines[1].rmse) == (250, 12.5)
        shown.report(0, 300, 1.0)  # it is not under way
        assert (shown.lines[0].collected, shown.lines[0].rmse) == (0, None)
        shown.finish(1, 10.0, 5.0)
        shown.report(1, 1000, 77.0)
        assert shown.lines[1].rmse == 5.0
        # A mission that is started again starts from nothing.
        shown.wait(2)
        shown.start(2)
        shown.report(2, 100, 3.0)
        shown.wait(2)
        shown.report(2, 200, 2.0)
        shown.start(2)
        shown.report(2, 100, 3.5)
        assert (shown.lines[2].collected, shown.lines[2].rmse) == (100, 3.5)


def test_without_a_terminal_there_are_plain_lines(monkeypatch):
    monkeypatch.setattr(progress, "LINE_SECONDS", -1.0)
    with display() as shown:
        for mission in range(4):
            shown.start(mission)
        shown.report(3, 500, 7.25)
        shown.finish(0, 12.3, 99.5)
        shown.fail(1, "ArithmeticError: no")
        shown.skip(2)
        shown.report(COMPILING, 0, None)
    lines = said(shown).splitlines()
    assert "\x1b" not in said(shown)
    assert any(line.startswith("mission 3  500 of 1000 samples  RMSE 7.25 ft") for line in lines)
    assert any(line.startswith("[1/4] mission 0  done in 12.3 s  RMSE 99.5 ft") for line in lines)
    assert any(line.startswith("[2/4] mission 1  FAILED: ArithmeticError: no") for line in lines)
    assert any(line.startswith("[3/4] mission 2  done by another infoplan") for line in lines)
    assert shown.counts == {"done": 1, "skipped": 4, "failed": 1}


def test_a_terminal_has_a_bar_for_the_whole_and_one_a_mission():
    with display(terminal=True) as shown:
        shown.start(0)
        shown.start(1)
        shown.finish(0, 10.0, 1.0)
        shown.start(2)
        shown.report(2, 700, 3.5)
    shown.console = Console(file=io.StringIO(), width=150)
    shown.console.print(shown._render())
    rows = said(shown).splitlines()
    assert rows[0].startswith("all missions")
    assert "1 done, 3 skipped of 7" in rows[0]
    assert "left" in rows[0]
    assert [row.split()[:2] for row in rows[1:]] == [["mission", "1"], ["mission", "2"]]
    assert "700 of 1000 samples  RMSE 3.50 ft" in rows[2]


def test_a_low_terminal_shows_as_many_bars_as_fit():
    lines = [Line(f"mission {n}", "m", 100, Kind("k", 1.0)) for n in range(50)]
    console = Console(file=io.StringIO(), force_terminal=True, width=100, height=10)
    shown = Display(lines, Pace(), 50, 0, console)
    for number in range(50):
        shown.start(number)
    assert len(shown._render().tasks) == 8


def test_time_left_says_nothing_until_it_means_something():
    unknown = display()
    unknown.start(0)
    assert unknown.left() is None
    known = Pace()
    known.add(Kind("kind", 1.0), 30.0)
    shown = display(pace=known)
    assert shown.left() == pytest.approx(60.0)
    shown.start(0)
    shown.finish(0, 30.0, 1.0)
    assert shown.left() == pytest.approx(45.0)
    for mission in (1, 2, 3):
        shown.fail(mission, "x")
    assert shown.left() == 0.0
