"""What a person sees while missions run: a live display, or plain lines without a terminal."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
from rich.text import Text

from infoplan.draw.console import say as say_sentence
from infoplan.output import complain
from infoplan.palette import TERMINAL
from infoplan.study.estimate import Clock, Kind, Pace, duration, kind_of, wall_seconds
from infoplan.study.flight import COMPILING, Task
from infoplan.study.listening import Listener, Tone
from infoplan.wording import figure, harmless

STYLES: dict[Tone, str] = {"note": "", "warning": TERMINAL["caution"], "alarm": TERMINAL["alarm"]}
"""Rich's style of a sentence."""

STEPS = 1000
"""Length of a full bar."""

NARROWEST_BAR, WIDEST_BAR = 6, 30
SHORTEST_NAME = 16

LINE_SECONDS = 5.0
"""Plain lines about missions under way appear at most this often."""


@dataclass
class Line:
    """What the display knows of a mission.

    Attributes
    ----------
    label, unit
        Its name, and the unit of its RMSE.
    budget
        Samples in all.
    kind
        By which its time is estimated.
    collected, rmse
        The latest report.
    state
        ``waiting``, ``under way`` or ``over``.
    """

    label: str
    unit: str
    budget: int
    kind: Kind
    collected: int = 0
    rmse: float | None = None
    state: str = "waiting"
    clock: Clock = field(init=False)

    def __post_init__(self) -> None:
        self.clock = Clock(self.budget, self.kind.progress)

    @property
    def share(self) -> float:
        """Share of the work that is done."""
        return 1.0 if self.state == "over" else self.clock.share(self.collected)

    @property
    def error(self) -> str:
        """RMSE with its unit, empty before there is one, or where the truth is unknown."""
        if self.rmse is None or math.isnan(self.rmse):
            return ""
        return f"  RMSE {figure(self.rmse)} {harmless(self.unit)}"

    @property
    def note(self) -> str:
        """How far it is."""
        if not self.collected:
            return f"{duration(time.monotonic() - (self.clock.started or 0.0))} under way"
        return f"{self.collected} of {self.budget} samples{self.error}"


class Display:
    """Progress of a pool of missions; a context manager.

    Parameters
    ----------
    lines
        One a mission, in the order of their numbers.
    pace
        Seconds of earlier missions; those of this study are added.
    workers
        How many missions run side by side.
    skipped
        How many missions of the study were there already.
    console
        Where to show it.
    """

    def __init__(self, lines: list[Line], pace: Pace, workers: int, skipped: int, console: Console):
        self.lines, self.pace, self.workers, self.console = lines, pace, workers, console
        self.done = Pace()
        self.counts = {"done": 0, "skipped": skipped, "failed": 0}
        self.wanted = skipped + len(lines)
        self.started = self.last_line = time.monotonic()
        self.live: Live | None = None

    def __enter__(self) -> "Display":
        if self.console.is_terminal:
            self.live = Live(
                get_renderable=self._render, console=self.console, refresh_per_second=4,
                transient=True,
            )  # fmt: skip
            self.live.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.live:
            self.live.stop()

    def start(self, mission: int) -> None:
        """Show that a mission is under way."""
        line = self.lines[mission]
        line.state, line.collected = "under way", 0
        line.clock = Clock(line.budget, line.kind.progress)
        line.clock.report(0)

    def finish(self, mission: int, seconds: float, rmse: float) -> None:
        """Show that a mission is done."""
        line = self.lines[mission]
        line.state, line.collected, line.rmse = "over", line.budget, rmse
        self.pace.add(line.kind, seconds)
        self.done.add(line.kind, seconds)
        self.counts["done"] += 1
        self._say_of(line, f"done in {seconds:.1f} s{line.error}")

    def skip(self, mission: int) -> None:
        """Show that another process has done a mission."""
        self.lines[mission].state = "over"
        self.counts["skipped"] += 1
        self._say_of(self.lines[mission], "done by another infoplan")

    def fail(self, mission: int, reason: str) -> None:
        """Show that a mission has failed."""
        self.lines[mission].state = "over"
        self.counts["failed"] += 1
        self._say_of(self.lines[mission], f"FAILED: {reason}", style=TERMINAL["failure"])

    def report(self, mission: int, collected: int, rmse: float | None) -> None:
        """Show how far a mission is; news of one that is not under way, or old news, are none.

        Parameters
        ----------
        mission
            Its number, or `COMPILING`.
        collected
            Samples so far; 0 at the start.
        rmse
            The latest; None at the start.
        """
        if mission == COMPILING:
            self.say("compiling the numerical kernels, once on this machine ...")
            return
        line = self.lines[mission]
        if line.state != "under way" or collected < line.collected:
            return
        line.collected, line.rmse = collected, rmse
        line.clock.report(collected)
        due = time.monotonic() - self.last_line > LINE_SECONDS
        if collected and due and not self.live:
            self.say(f"{line.label}  {line.note}{self._time_left()}")

    def wait(self, mission: int) -> None:
        """Show that a mission is not under way any more and will be started again."""
        self.lines[mission].state = "waiting"
        self.lines[mission].collected = 0

    def say(self, text: str, tone: Tone = "note") -> None:
        """Print a line above the display."""
        self._print(text, STYLES[tone])

    def overhear(self, text: str) -> None:
        """Pass on what a worker has written to its standard error."""
        complain(text)

    def _print(self, text: str, style: str) -> None:
        print_line(self.console, text, style)
        self.last_line = time.monotonic()

    def left(self) -> float | None:
        """Seconds left until all missions are over; None while nothing can be said."""
        pending = [line for line in self.lines if line.state != "over"]
        own = [(line.clock.total(), line.kind.work) for line in pending]
        rates = [total / work for total, work in own if total is not None]
        seconds = []
        for line in pending:
            # In order of how much they tell: its own kind, what was done here, what is under way.
            expected = self.pace.of_kind(line.kind) or self.done.seconds(line.kind)
            if expected is None and rates:
                expected = line.kind.work * sum(rates) / len(rates)
            elif expected is None:
                expected = self.pace.seconds(line.kind)
            under_way = line.state == "under way"
            left = line.clock.left(expected) if under_way else expected
            if left is None:
                return None
            seconds.append(left)
        return wall_seconds(seconds, self.workers)

    def _say_of(self, line: Line, text: str, style: str = "") -> None:
        over = sum(line.state == "over" for line in self.lines)
        left = "" if self.live else self._time_left()
        self._print(f"[{over}/{len(self.lines)}] {line.label}  {text}{left}", style)

    def _time_left(self) -> str:
        left = self.left()
        return f"  about {duration(left)} left" if left and left >= 1 else ""

    def _render(self) -> Progress:
        total = sum(line.kind.work for line in self.lines)
        done = sum(line.kind.work * line.share for line in self.lines)
        counts = ", ".join(f"{count} {name}" for name, count in self.counts.items() if count)
        bars = [("all missions", done / total,
                 f"{counts or '0 done'} of {self.wanted}{self._time_left()}")]  # fmt: skip
        room = max(self.console.height - 3, 1)
        under_way = [line for line in self.lines if line.state == "under way"]
        bars += [(line.label, line.share, line.note) for line in under_way[:room]]
        # In a narrow terminal bars and names give way, not the notes.
        names, notes = (max(len(str(bar[part])) for bar in bars) for part in (0, 2))
        width = min(max(self.console.width - names - notes - 2, NARROWEST_BAR), WIDEST_BAR)
        names = max(self.console.width - width - notes - 2, SHORTEST_NAME)
        progress = Progress(
            TextColumn("{task.description}", markup=False), BarColumn(bar_width=width), _Note(),
            console=self.console, auto_refresh=False,
        )  # fmt: skip
        for label, share, note in bars:
            short = label if len(label) <= names else f"{label[: names - 10]}…{label[-9:]}"
            progress.add_task(short, total=STEPS, completed=round(STEPS * share), note=note)
        return progress


def listener(console: Console) -> Listener:
    """Let a person follow a study on a console."""

    def say(text: str, tone: Tone) -> None:
        say_sentence(console, text, STYLES[tone])

    def follow(tasks: Sequence[Task], pace: Pace, kept: int) -> Display:
        lines = [
            Line(task.label, task.run.terrain.unit, task.run.config.budget,
                 kind_of(task.run.science, task.run.config))
            for task in tasks
        ]  # fmt: skip
        return Display(lines, pace, 1, kept, console)

    return Listener(say, follow)


def print_line(console: Console, text: str, style: str) -> None:
    """Print a line that the console does not break."""
    console.print(Text(text, style=style), soft_wrap=True)


class _Note(ProgressColumn):
    def render(self, task: Any) -> Text:
        return Text(task.fields["note"])
