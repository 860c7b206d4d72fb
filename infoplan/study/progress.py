"""What a person sees while missions run: a live display, or plain lines without a terminal.

Workers tell how far they are by datagrams to a socket of the parent on this machine: no file, no
shared state, and a worker that dies leaves nothing behind. A lost datagram costs one refresh.
"""

import json
import os
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

Address = tuple[str, int]

REFRESH_SECONDS = 0.25
LINE_SECONDS = 5.0
"""Plain lines about missions under way appear at most this often."""


def reporter(address: Address | None, mission: int) -> Callable[[int, float], None]:
    """Return the function by which a worker reports (samples collected, RMSE) of a mission."""
    if address is None:
        return lambda collected, rmse: None
    channel = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def report(collected: int, rmse: float) -> None:
        message = {"mission": mission, "collected": collected, "rmse": rmse, "pid": os.getpid()}
        try:
            channel.sendto(json.dumps(message).encode(), address)
        except OSError:
            pass  # a display that is gone must not end a mission

    return report


@dataclass
class Line:
    """What the display knows of a mission."""

    label: str
    budget: int
    unit: str
    collected: int = 0
    rmse: float = float("nan")
    finished: bool = False

    @property
    def work(self) -> float:
        """Work of the whole mission, arbitrary units: the model's cost grows as N^3 an epoch."""
        return float(self.budget) ** 3

    @property
    def done(self) -> float:
        """Work done so far."""
        return self.work if self.finished else float(self.collected) ** 3

    def __str__(self) -> str:
        return f"{self.label}  {self.collected} of {self.budget} samples  {self.error}"

    @property
    def error(self) -> str:
        """RMSE with its unit, empty before there is one."""
        return "" if self.rmse != self.rmse else f"RMSE {self.rmse:.4g} {self.unit}"


class Display:
    """Progress of a pool of missions; a context manager.

    Parameters
    ----------
    lines
        One a mission, in the order of their numbers.
    console
        Where to show it.
    """

    def __init__(self, lines: list[Line], console: Console):
        self.lines = lines
        self.console = console
        self.started = time.monotonic()
        self.last_line = self.started
        self.counts = {"done": 0, "failed": 0}
        self.stopped = threading.Event()
        self.receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.receiver.bind(("127.0.0.1", 0))
        self.receiver.settimeout(REFRESH_SECONDS)
        self.address: Address = self.receiver.getsockname()
        self.live: Live | None = None
        self.thread = threading.Thread(target=self._listen, daemon=True)

    def __enter__(self) -> "Display":
        if self.console.is_terminal:
            self.live = Live(
                get_renderable=self._render, console=self.console, refresh_per_second=4,
                transient=True,
            )  # fmt: skip
            self.live.start()
        self.thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stopped.set()
        self.thread.join()
        self.receiver.close()
        if self.live:
            self.live.stop()

    def finish(self, mission: int, seconds: float, rmse: float) -> None:
        """Show that a mission is done."""
        line = self.lines[mission]
        line.finished, line.collected, line.rmse = True, line.budget, rmse
        self.counts["done"] += 1
        self._say(f"{line.label}  done in {seconds:.1f} s  {line.error}")

    def fail(self, mission: int, reason: str) -> None:
        """Show that a mission has failed."""
        self.lines[mission].finished = True
        self.counts["failed"] += 1
        self._say(f"{self.lines[mission].label}  FAILED: {reason}", style="bold red")

    def _say(self, text: str, style: str = "") -> None:
        counted = f"[{sum(self.counts.values())}/{len(self.lines)}]"
        left = "" if self.live else self._time_left()
        self.console.print(Text(f"{counted} {text}{left}", style=style), soft_wrap=True)
        self.last_line = time.monotonic()

    def _listen(self) -> None:
        while not self.stopped.is_set():
            try:
                message: dict[str, Any] = json.loads(self.receiver.recv(4096))
                line = self.lines[message["mission"]]
            except (TimeoutError, ValueError, KeyError, IndexError, TypeError):
                continue
            if not line.finished:
                line.collected, line.rmse = message["collected"], message["rmse"]
                if not self.live and time.monotonic() - self.last_line > LINE_SECONDS:
                    self.last_line = time.monotonic()
                    self.console.print(f"{line}{self._time_left()}", soft_wrap=True)

    def _time_left(self) -> str:
        total, done = sum(line.work for line in self.lines), sum(line.done for line in self.lines)
        if done == 0 or done >= total:
            return ""
        left = (time.monotonic() - self.started) * (total - done) / done
        return f"  about {_duration(left)} left"

    def _render(self) -> Progress:
        progress = Progress(
            TextColumn("{task.description}"), BarColumn(bar_width=30), _Note(),
            console=self.console, auto_refresh=False,
        )  # fmt: skip
        total, done = sum(line.work for line in self.lines), sum(line.done for line in self.lines)
        count = f"{self.counts['done']} of {len(self.lines)} done"
        if self.counts["failed"]:
            count += f", {self.counts['failed']} failed"
        progress.add_task("all missions", total=total, completed=done,
                          note=f"{count}{self._time_left()}")  # fmt: skip
        for line in self.lines:
            if line.collected and not line.finished:
                note = f"{line.collected} of {line.budget} samples  {line.error}"
                progress.add_task(line.label, total=line.work, completed=line.done, note=note)
        return progress


class _Note(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(task.fields["note"])


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
