"""``infoplan status``: what of a study, or of all stored runs, is done, failed, missing."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from infoplan.config import Config
from infoplan.errors import UsageError
from infoplan.study.estimate import duration
from infoplan.study.locks import list_held
from infoplan.study.records import Footer
from infoplan.study.runner import check_study, identify_study
from infoplan.study.store import inspect, list_failures, list_foreign, list_missions
from infoplan.study.summary import spans, wide_console

JSON = "--json"
MULTIRUN = ("-m", "--multirun")
"""A status is always one of all values, with the flag or without it."""


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


def status(arguments: list[str]) -> int:
    """Run ``infoplan status``.

    Parameters
    ----------
    arguments
        ``--json``, and overrides as of ``infoplan run -m``. Without any but ``results_dir=``, all
        stored runs are shown, with the seeds of all of them as those wanted of each.

    Returns
    -------
    int
        0, whatever is done or missing.
    """
    as_json = JSON in arguments
    overrides = [argument for argument in arguments if argument != JSON]
    chosen = [override for override in overrides if not override.startswith("results_dir=")]
    if not chosen:
        folder = [override.partition("=")[2] for override in overrides] or ["results"]
        _print(look_at_all(Path(folder[-1]).expanduser()), as_json)
        return 0
    from infoplan.hydra_front import compose_and

    def act(configs: list[Config]) -> tuple[int, list[float]]:
        check_study(configs)
        # A warning about the map would not be JSON.
        study = identify_study(configs, Console(stderr=True) if as_json else wide_console())
        wanted = {run.name: seeds for run, seeds in study.runs}
        _print(look(study.results_dir, wanted), as_json)
        return 0, [float("nan")] * len(configs)

    rest = [override for override in overrides if override not in MULTIRUN]
    return compose_and(act, [MULTIRUN[0], *rest])


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


def look(results_dir: Path, wanted: dict[str, list[int]]) -> Status:
    """Look at the state of runs.

    Parameters
    ----------
    results_dir
        Where their tables are, if there are any.
    wanted
        Seeds that are wanted of each run.
    """
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
    problems += [f"{path} is no mission's: readers may trip over it, move it elsewhere"
                 for path in list_foreign(results_dir)]  # fmt: skip
    return Status(str(results_dir), runs, problems)


def _add_times(state: RunStatus, footer: Footer) -> None:
    # ISO 8601 in UTC: the order of the strings is that of the times.
    state.first = min(state.first or footer.started, footer.started)
    state.last = max(state.last or footer.ended, footer.ended)
    state.seconds += footer.seconds


def _print(found: Status, as_json: bool) -> None:
    if as_json:
        print(json.dumps(asdict(found), indent=2))
        return
    console = wide_console(160)
    if not found.runs:
        console.print(f"there is no run in {found.results_dir} yet", soft_wrap=True)
    else:
        console.print(_table(found))
    for problem in found.problems:
        console.print(Text(problem, style="yellow"), soft_wrap=True)


def _table(found: Status) -> Table:
    rare = [name for name in ("failed", "running", "broken")
            if any(getattr(run, name) for run in found.runs)]  # fmt: skip
    kept = ["done", *rare, "missing"]
    table = Table(title=f"runs in {found.results_dir}", box=box.SIMPLE, title_justify="left")
    table.add_column("run", no_wrap=True)
    for name in kept:
        table.add_column(name, justify="right", style="red" if name in ("failed", "broken") else "")
    for name in ("last (UTC)", "s a seed", "in all"):
        table.add_column(name, justify="right", no_wrap=True)
    for run in found.runs:
        mean = f"{run.seconds / len(run.done):.1f}" if run.done else ""
        ended = run.last[:16].replace("T", " ") if run.last else ""
        table.add_row(run.run, *(spans(getattr(run, name)) for name in kept), ended, mean,
                      duration(run.seconds) if run.done else "")  # fmt: skip
    return table
