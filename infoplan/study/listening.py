"""What a study tells on its way, and to whom: it prints nothing itself."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Literal, Protocol

from infoplan.study.estimate import Pace
from infoplan.study.flight import Task

Tone = Literal["note", "warning", "alarm"]
"""How grave a sentence is: an alarm changes what is computed."""

Say = Callable[[str, Tone], None]
"""Takes a sentence and how grave it is."""


class Progress(Protocol):
    """What follows the missions of a study; each is known by its number."""

    workers: int
    """How many missions run side by side."""

    def start(self, mission: int) -> None:
        """Learn that a mission is under way."""

    def report(self, mission: int, collected: int, rmse: float | None) -> None:
        """Learn how far a mission is (`Report`)."""

    def wait(self, mission: int) -> None:
        """Learn that a mission is not under way any more and will be started again."""

    def finish(self, mission: int, seconds: float, rmse: float) -> None:
        """Learn that a mission is done."""

    def skip(self, mission: int) -> None:
        """Learn that another process has done a mission."""

    def fail(self, mission: int, reason: str) -> None:
        """Learn that a mission has failed."""

    def say(self, text: str, tone: Tone = "note") -> None:
        """Take a sentence while missions are under way."""

    def overhear(self, text: str) -> None:
        """Take what a worker has written to its standard error."""


@dataclass(frozen=True)
class Listener:
    """Who listens to a study.

    Attributes
    ----------
    say
        Takes a sentence and how grave it is.
    follow
        Takes the missions that are to be flown, the seconds of earlier ones and how many missions
        are there already; gives, for a ``with`` block, what follows them.
    """

    say: Say
    follow: Callable[[Sequence[Task], Pace, int], AbstractContextManager[Progress]]
