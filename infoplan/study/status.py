"""``infoplan status``: what of a study, or of all stored runs, is done, failed, missing."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from infoplan.config import Config
from infoplan.errors import UsageError
from infoplan.study.estimate import duration
from infoplan.study.locks import list_held
from infoplan.study.run_names import choose_run
from infoplan.study.runner import check_study, identify_study
from infoplan.study.store import inspect, list_failures, list_foreign, list_missions
from infoplan.study.summary import spans, wide_console


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


def status(
    results_dir: Path,
    overrides: Sequence[str] = (),
    *,
    run: str | None = None,
    as_json: bool = False,
) -> int:
    """Run ``infoplan status``.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    overrides
        As of ``infoplan run -m``: the study that is looked at. Without any, all stored runs are,
        with the seeds of all of them as those wanted of each.
    run
        One stored run, as `infoplan.study.run_names` finds it.
    as_json
        Write it for scripts.

    Returns
    -------
    int
        0, whatever is done or missing.

    Raises
    ------
    UsageError
        If there is no such folder, no such run, or the overrides are wrong.
    """
    if not overrides:
        found = look_at_all(results_dir)
        if run is not None:
            name = choose_run(run, [one.run for one in found.runs], str(results_dir))
            found.runs = [one for one in found.runs if one.run == name]
            found.problems = [problem for problem in found.problems if name in problem]
        _print(found, as_json)
        return 0
    if run is not None:
        raise UsageError(
            f"run={run} and {overrides[0]} ask for two things: name a stored run, or describe a "
            "study"
        )
    from infoplan.hydra_front import compose_and

    def act(configs: list[Config]) -> tuple[int, list[float]]:
        check_study(configs)
        # A warning about the map would not be JSON.
        study = identify_study(configs, Console(stderr=True) if as_json else wide_console())
        wanted = {run.name: seeds for run, seeds in study.runs}
        _print(look(study.results_dir, wanted), as_json)
        return 0, [float("nan")] * len(configs)

    return compose_and(act, ["-m", *overrides])


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
            if stored.state == "done":
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


def _add_times(state: RunStatus, footer: dict[str, Any]) -> None:
    began, ended = footer.get("started"), footer.get("ended")
    # ISO 8601 in UTC: the order of the strings is that of the times.
    state.first = min(filter(None, [state.first, began]), default=None)
    state.last = max(filter(None, [state.last, ended]), default=None)
    state.seconds += float(footer.get("seconds") or 0.0)


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
