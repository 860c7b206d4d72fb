"""What of a study, or of all stored runs, is done, failed, missing."""

from dataclasses import dataclass, field
from pathlib import Path

from infoplan.analyse.configurations import Options, differing, stored_options
from infoplan.errors import UsageError
from infoplan.study.locks import list_held
from infoplan.study.records import Footer
from infoplan.study.store import inspect, list_failures, list_foreign, list_missions


@dataclass
class RunStatus:
    """State of a run.

    Attributes
    ----------
    run
        Its name.
    done, failed, running, broken, missing
        Seeds: with sound tables; whose last attempt failed; that some process is flying; whose
        tables cannot be trusted; of which there is nothing. A seed is in one list only.
    first, last
        When its first mission began and its last one ended, ISO 8601; None if none is done.
    seconds
        Computing time of all missions that are done.
    options
        Those in which the runs of the status differ, dotted names; none where nothing of the run is
        done and only its name is known.
    """

    run: str
    done: list[int] = field(default_factory=list)
    failed: list[int] = field(default_factory=list)
    running: list[int] = field(default_factory=list)
    broken: list[int] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)
    first: str | None = None
    last: str | None = None
    seconds: float = 0.0
    options: Options = field(default_factory=dict)


@dataclass
class Status:
    """State of a results folder, as `look` saw it.

    Attributes
    ----------
    results_dir
        The folder.
    runs
        State of each run.
    problems
        Why missions are broken, and files among the tables that are no mission's.
    """

    results_dir: str
    runs: list[RunStatus]
    problems: list[str]


def look_at_all(results_dir: Path) -> Status:
    """Look at all runs of a folder.

    Raises
    ------
    UsageError
        If there is no such folder.
    """
    if not results_dir.is_dir():
        raise UsageError(
            f"results_dir={results_dir} is no folder: name one that infoplan run has written to"
        )
    stored, failed = list_missions(results_dir), list_failures(results_dir)
    running: dict[str, list[int]] = {}
    for run, seed in list_held(results_dir):
        running.setdefault(run, []).append(seed)
    found = [stored, failed, running]
    seeds = sorted({seed for runs in found for listed in runs.values() for seed in listed})
    names = sorted({run for runs in found for run in runs})
    return look(results_dir, dict.fromkeys(names, seeds))


def look(
    results_dir: Path, wanted: dict[str, list[int]], options: dict[str, Options] | None = None
) -> Status:
    """Look at the state of runs.

    Parameters
    ----------
    results_dir
        Where their tables are, if there are any.
    wanted
        Seeds that are wanted of each run.
    options
        Configuration of each run, dotted names; None: as its missions that are done tell.
    """
    known = dict(options or {})
    failed, held = list_failures(results_dir), list_held(results_dir)
    problems, runs = [], []
    for name, seeds in wanted.items():
        state = RunStatus(name)
        for seed in seeds:
            stored = inspect(results_dir, name, seed)
            if stored.state == "broken":
                problems.append(stored.reason)
            if stored.footer:
                state.done.append(seed)
                if name not in known:
                    known[name] = stored_options(stored.footer.configuration)
                _add_times(state, stored.footer)
            elif (name, seed) in held:
                state.running.append(seed)
            elif stored.state == "broken":
                state.broken.append(seed)
            elif seed in failed.get(name, []):
                state.failed.append(seed)
            else:
                state.missing.append(seed)
        runs.append(state)
    apart = differing(known)
    for state in runs:
        own = known.get(state.run, {})
        state.options = {option: own[option] for option in apart if option in own}
    problems += [f"{path} is no mission's: readers may trip over it, move it elsewhere"
                 for path in list_foreign(results_dir)]  # fmt: skip
    return Status(str(results_dir), runs, problems)


def _add_times(state: RunStatus, footer: Footer) -> None:
    # ISO 8601 in UTC: the order of the strings is that of the times.
    state.first = min(state.first or footer.started, footer.started)
    state.last = max(state.last or footer.ended, footer.ended)
    state.seconds += footer.seconds
