"""``infoplan status``: what of a study, or of all stored runs, is done, failed, missing."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich.console import Console

from infoplan.analyse.tables import Options, differing, flatten
from infoplan.config import Config
from infoplan.draw.table_layout import WHOLE, Column, print_table, say
from infoplan.errors import UsageError
from infoplan.study.estimate import duration
from infoplan.study.locks import list_held
from infoplan.study.records import Footer
from infoplan.study.run_names import choose_run
from infoplan.study.runner import check_study, identify_study
from infoplan.study.store import inspect, list_failures, list_foreign, list_missions
from infoplan.study.summary import option_cells, spans, wide_console
from infoplan.wording import figure


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
        options = {run.name: flatten(run.science) for run, _ in study.runs}
        _print(look(study.results_dir, wanted, options), as_json)
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
                    known[name] = flatten(stored.footer.configuration)
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


def _print(found: Status, as_json: bool) -> None:
    if as_json:
        print(json.dumps(asdict(found), indent=2))
        return
    console = wide_console()
    if found.runs:
        _print_table(found, console)
    else:
        say(console, f"there is no run in {found.results_dir} yet")
    for problem in found.problems:
        say(console, problem, style="yellow")


def _print_table(found: Status, console: Console) -> None:
    rare = [name for name in ("failed", "running", "broken")
            if any(getattr(run, name) for run in found.runs)]  # fmt: skip
    kept = ["done", *rare, "missing"]
    apart = list(dict.fromkeys(name for run in found.runs for name in run.options))
    columns = [
        Column("run", least=WHOLE),
        *(Column(name, right=True) for name in apart),
        *(
            Column(
                name, right=True, empty="none", style="red" if name in ("failed", "broken") else ""
            )
            for name in kept
        ),
        Column("last (UTC)", right=True, spare=1),
        Column("s a seed", right=True, spare=2),
        Column("in all", right=True, spare=3),
    ]
    rows = []
    for run in found.runs:
        mean = figure(run.seconds / len(run.done)) if run.done else ""
        ended = run.last[:16].replace("T", " ") if run.last else ""
        rows.append([run.run, *option_cells(run.options, apart).values(),
                     *(spans(getattr(run, name)) for name in kept), ended, mean,
                     duration(run.seconds) if run.done else ""])  # fmt: skip
    print_table(console, f"runs in {found.results_dir}", columns, rows)
