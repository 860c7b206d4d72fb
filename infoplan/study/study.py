"""A study: configurations x seeds, what of them is stored, and what was done."""

from dataclasses import dataclass, field
from pathlib import Path

from infoplan.later_logs import Origins
from infoplan.samples import Samples
from infoplan.study.estimate import Pace, kind_of
from infoplan.study.flight import Task
from infoplan.study.identity import Run
from infoplan.study.store import Stored, inspect, inspect_derived

TAIL = 100
"""Missions at the end of a study that are started by their length: before, nobody is left alone."""


@dataclass
class Study:
    """A study of flights, replays or refits: what it consists of, what was done (`carry_out`).

    Attributes
    ----------
    names
        Name of the run of each configuration, in their order.
    runs
        The different runs with the seeds asked for.
    results_dir
        Where their tables are.
    stored
        What was there of each mission, by run and seed, when the study began.
    flown
        Of replays, the run whose samples they get; else None.
    surveyed
        Of a survey, its samples by batch; else None.
    origins
        Of a survey of several logs, where its samples come from; else None.
    refit
        Whether hyperparameters of stored missions are fit anew: what is wanted then, done and
        stored are those.
    pace
        Seconds of all missions in the results.
    done
        Missions that were kept or computed now, by run and seed: those that tables and numbers
        count.
    computed, kept, unstarted
        Number of missions computed now, found done, and left by ``on_error=stop``.
    failed
        Label, one-line reason and file of each failed mission.
    seconds
        Wall time.
    """

    names: list[str]
    runs: list[tuple[Run, list[int]]]
    results_dir: Path
    flown: str | None = None
    surveyed: Samples | None = None
    origins: Origins | None = None
    refit: bool = False
    stored: dict[tuple[str, int], Stored] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)
    done: set[tuple[str, int]] = field(default_factory=set)
    computed: int = 0
    kept: int = 0
    unstarted: int = 0
    failed: list[tuple[str, str, Path]] = field(default_factory=list)
    seconds: float = 0.0

    def todo(self, resume: bool) -> list[Task]:
        """List what is to be done, in order but for the last `TAIL` missions.

        Of those the longest come first, so that none is left alone at the end.
        """
        missions = [
            (run, seed)
            for run, seeds in self.runs
            for seed in seeds
            if not (resume and self.stored[run.name, seed].state == "done")
        ]
        kinds = {run.name: kind_of(run.science, run.config) for run, _ in self.runs}
        length = {name: self.pace.seconds(kind) or kind.work for name, kind in kinds.items()}
        missions[-TAIL:] = sorted(missions[-TAIL:], key=lambda mission: -length[mission[0].name])
        flown = None if self.flown is None else (self.results_dir, self.flown)
        return [
            Task(run, seed, number, flown, self.surveyed, self.origins,
                 self.results_dir if self.refit else None)
            for number, (run, seed) in enumerate(missions)
        ]  # fmt: skip

    def look(self) -> None:
        """See what is stored of each mission."""
        for run, seeds in self.runs:
            for seed in seeds:
                self.stored[run.name, seed] = self.inspect(run.name, seed)

    def inspect(self, run: str, seed: int) -> Stored:
        """See what is stored of a mission now: its tables, or its refits."""
        if self.refit:
            return inspect_derived(self.results_dir, "refits", run, seed)
        return inspect(self.results_dir, run, seed)
