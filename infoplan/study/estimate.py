"""How long missions take, judged by those that are done and by those under way."""

import json
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from infoplan.config import MissionConfig
from infoplan.errors import RunError
from infoplan.mission_cost import seconds_of
from infoplan.study.identity import config_from_science
from infoplan.study.store import list_missions, read_footer, table_path

PROGRESS = 3.5
"""Exponent by which the time since the pilot grows with the samples collected, as measured."""

PROGRESS_OF = {"vecchia": 1.6}
"""The same of models whose cost an epoch grows with the samples, as measured up to 8000."""

TIMELESS = ("rho", "terrain", "sensor", "outliers", "fault", "numerics_version")
"""Parts of the configuration that hardly change the time."""

MEANINGFUL = 0.05
"""Share of a mission's work from which on its own pace says something."""


@dataclass(frozen=True)
class Kind:
    """Missions that should take the same time.

    Attributes
    ----------
    options
        What the time depends on.
    work
        Seconds by its operations, which only missions of other kinds are scaled by.
    progress
        Exponent by which the time since the pilot grows with the samples collected.
    """

    options: str
    work: float
    progress: float = PROGRESS


def kind_of(science: Mapping[str, Any], config: MissionConfig) -> Kind:
    """Kind of the missions of a run, from its `science` and its configuration."""
    timely = {name: value for name, value in science.items() if name not in TIMELESS}
    progress = PROGRESS_OF.get(science["model"]["name"], PROGRESS)
    return Kind(json.dumps(timely, sort_keys=True), seconds_of(config), progress)


class Pace:
    """Seconds that missions took, by their kind."""

    def __init__(self) -> None:
        self.measured: dict[Kind, list[float]] = {}

    def add(self, kind: Kind, seconds: float) -> None:
        """Learn from a mission that is done."""
        self.measured.setdefault(kind, []).append(seconds)

    def of_kind(self, kind: Kind) -> float | None:
        """Mean seconds of the missions of a kind; None if there are none."""
        return _mean(self.measured[kind]) if kind in self.measured else None

    def seconds(self, kind: Kind) -> float | None:
        """Estimate a mission's seconds: the mean of its kind, else scaled from the nearest kinds.

        Returns
        -------
        float or None
            None if no mission is known.
        """
        if kind in self.measured or not self.measured:
            return self.of_kind(kind)
        # Scaling over a small distance errs little. A copy: the display's thread asks, too.
        distance = {known: abs(math.log(known.work / kind.work)) for known in list(self.measured)}
        nearest = [known for known in distance if distance[known] == min(distance.values())]
        return _mean(_mean(self.measured[known]) * kind.work / known.work for known in nearest)


def learn(results_dir: Path) -> Pace:
    """Learn from the footers of all stored missions; files that cannot be read are passed over."""
    pace = Pace()
    for run, seeds in list_missions(results_dir).items():
        kind = None
        for seed in seeds:
            try:
                footer = read_footer(table_path(results_dir, "curves", run, seed))
                science = footer.configuration
                if "replay" in science:  # nothing was planned in those
                    continue
                kind = kind or kind_of(science, config_from_science(science))
            except RunError:
                continue
            pace.add(kind, footer.seconds)
    return pace


class Clock:
    """What is known of the time of one mission: when it started and how far it is.

    Parameters
    ----------
    budget
        Samples of the mission.
    """

    def __init__(self, budget: int, progress: float = PROGRESS) -> None:
        self.budget, self.progress = budget, progress
        self.started: float | None = None
        self.pilot: tuple[float, float] | None = None
        self.latest: tuple[float, float] | None = None

    def report(self, collected: int) -> None:
        """Note that the mission is under way, and how far."""
        now = time.monotonic()
        if self.started is None:
            self.started = now
        if collected:
            self.latest = (now, self.share(collected))
            # Imports and the pilot's long fit are no measure of the pace after it.
            self.pilot = self.pilot or self.latest

    def share(self, collected: int) -> float:
        """Share of the work that is done after a number of samples."""
        return (collected / self.budget) ** self.progress

    def total(self) -> float | None:
        """Seconds of the whole mission by its own pace; None while that says nothing."""
        if self.started is None or self.pilot is None or self.latest is None:
            return None
        passed, done = self.latest[0] - self.pilot[0], self.latest[1] - self.pilot[1]
        if done < MEANINGFUL:
            return None
        return self.latest[0] - self.started + passed * (1 - self.latest[1]) / done

    def left(self, expected: float | None) -> float | None:
        """Seconds left, given what missions of this kind take; None if nothing is known."""
        own = self.total()
        if self.started is None or own is None:
            total = expected
        elif expected is None:
            total = own
        else:
            trust = self.latest[1] if self.latest else 0.0
            total = trust * own + (1 - trust) * expected
        if total is None or self.started is None:
            return total
        return max(total - (time.monotonic() - self.started), 0.0)


def wall_seconds(missions: Iterable[float], workers: int) -> float:
    """Seconds until missions of given lengths are done by a number of workers."""
    lengths = list(missions)
    return max(max(lengths, default=0.0), sum(lengths) / max(workers, 1))


def duration(seconds: float) -> str:
    """Seconds as a person says them."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return sum(listed) / len(listed)
