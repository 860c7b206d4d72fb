"""The tables around a study: what would run, and what came out."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from infoplan.analyse.configurations import Options, differing, option_text, stored_options
from infoplan.analyse.statistics import mean_interval
from infoplan.collapse import collapse_sentence, counted_ends, moving_sentence, share_text
from infoplan.config import Config
from infoplan.draw.console import say
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table
from infoplan.draw.terminal import small_curves, takes_braille
from infoplan.machine import size
from infoplan.method_identity import method_of
from infoplan.mission_cost import WORKER_BYTES, memory_of, seconds_of
from infoplan.palette import TERMINAL
from infoplan.study.estimate import duration, kind_of, wall_seconds
from infoplan.study.identity import Run
from infoplan.study.pool import worker_count
from infoplan.study.stored_curves import (
    StoredCurve,
    ended_collapsed,
    ended_moving,
    stored_curves,
)
from infoplan.study.study import Study
from infoplan.wording import counted, figure, harmless, interval, spans

MANY = 200
"""Tables of more runs have a row for those of a method, map and rho together."""


def print_summary(study: Study, console: Console) -> None:
    """Print RMSE along the budget, detector quality, time and failures of a study's runs."""
    curves = {run.name: stored_curves(study, run, seeds) for run, seeds in study.runs}
    ends = {run.name: _ends(study, run, curves[run.name]) for run, _ in study.runs}
    if len(study.runs) > MANY:
        _print_closing_groups(study, curves, ends, console)
    else:
        _print_closing_table(study, curves, ends, console)
    if said := collapse_sentence([end for of_run in ends.values() for end in of_run]):
        say(console, said, style=TERMINAL["caution"])
    if said := moving_sentence([
        ended_moving(study.results_dir, name, int(curve["seed"][-1]), curve.columns)
        for name, of_run in curves.items() for curve in of_run
    ]):  # fmt: skip
        say(console, said, style=TERMINAL["caution"])
    for label, reason, path in study.failed:
        say(console, f"FAILED {label}: {reason} ({path})", style=TERMINAL["failure"])
    parts = [f"{counted(study.computed, 'mission')} computed", f"{study.kept} kept"]
    if study.failed:
        parts.append(f"{len(study.failed)} failed (the same command tries them again)")
    if study.unstarted:
        parts.append(f"{study.unstarted} not started (on_error=stop)")
    say(console, f"{', '.join(parts)} in {duration(study.seconds)}")
    say(console, f"tables: {study.results_dir}/curves, samples, maps")


def print_plan(study: Study, config: Config, console: Console) -> None:
    """Print what a study would fly, what is stored already, and how long it would take."""
    todo = study.todo(config.resume)
    own: dict[str, list[int]] = {run.name: [] for run, _ in study.runs}
    for task in todo:
        own[task.run.name].append(task.seed)
    if len(study.runs) > MANY:
        _print_groups(study, own, console)
    else:
        _print_runs(study, own, console)
    for stored in study.stored.values():
        if stored.state == "broken":
            say(console, f"broken: {stored.reason}", style=TERMINAL["caution"])
    there = len(study.stored) - len(todo)
    say(console, f"{counted(len(todo), 'mission')} would run, {there} "
        f"{'is' if there == 1 else 'are'} stored in {study.results_dir}")  # fmt: skip
    if todo:
        of_run = {task.run.name: task.run for task in todo}
        kinds = {name: kind_of(run.science, run.config) for name, run in of_run.items()}
        seconds = {name: study.pace.seconds(kind) for name, kind in kinds.items()}
        by = "by the missions stored"
        if None in seconds.values():
            by = "by their operations: no mission is stored yet to tell better"
            seconds = {name: seconds_of(run.config) for name, run in of_run.items()}
        say(console, _time(config, [seconds[task.run.name] or 0.0 for task in todo], by))
        most = max(memory_of(run.config) for run in of_run.values())
        say(console, f"a worker takes about {size(WORKER_BYTES + most)} of memory")


def _print_runs(study: Study, own: Mapping[str, Sequence[int]], console: Console) -> None:
    """Print each run, and which seeds of it would be flown."""
    swept = varying([run for run, _ in study.runs])
    columns = [
        TextColumn("run", least=WHOLE),
        *(TextColumn(name, right=True) for name in next(iter(swept.values()))),
        TextColumn("stored", right=True),
        TextColumn("to run", right=True),
        TextColumn("seeds to run"),
        TextColumn("about", right=True),
    ]
    rows = []
    for run, seeds in study.runs:
        left = own[run.name]
        one = study.pace.seconds(kind_of(run.science, run.config))
        about = duration(one * len(left)) if one and left else ""
        rows.append([label(run), *swept[run.name].values(), str(len(seeds) - len(left)),
                     str(len(left)), spans(left), about])  # fmt: skip
    print_table(console, "what would run", columns, rows)


def _print_groups(study: Study, own: Mapping[str, Sequence[int]], console: Console) -> None:
    """Print how many missions of each method, map and rho would be flown."""
    columns = [
        TextColumn("method"),
        TextColumn("map"),
        *(TextColumn(name, right=True) for name in ("runs", "stored", "to run")),
    ]
    rows = [
        [*key, str(len(group)), str(sum(len(seeds) - len(own[run.name]) for run, seeds in group)),
         str(sum(len(own[run.name]) for run, _ in group))]
        for key, group in _groups(study).items()
    ]  # fmt: skip
    print_table(console, _in_groups(study, "what would run"), columns, rows, named=2)


def _groups(study: Study) -> dict[tuple[str, str], list[tuple[Run, list[int]]]]:
    """Put the runs of a method, map and rho together."""
    groups: dict[tuple[str, str], list[tuple[Run, list[int]]]] = {}
    for run, seeds in study.runs:
        method, where, _ = label_lines(run)
        groups.setdefault((method, where), []).append((run, seeds))
    return groups


def _in_groups(study: Study, title: str) -> str:
    return f"{title}: {len(study.runs)} runs, those of a method, map and rho together"


def label(run: Run) -> str:
    """Label a run by method, map and rho, and by the hash that its name ends in: three lines."""
    return "\n".join(label_lines(run))


def label_lines(run: Run) -> tuple[str, str, str]:
    """Write method, map and rho, and hash of a run."""
    method = method_of(stored_options(run.science))
    return (
        harmless(f"{' '.join(choice.name for choice in method.choices)} {method.scope}"),
        harmless(f"{run.terrain.name} rho {run.config.rho:g}"),
        harmless(run.name.rsplit("-", 1)[1]),
    )


def varying(runs: list[Run]) -> dict[str, dict[str, str]]:
    """Give the options in which runs differ, by the runs' names; empty where a run has none."""
    flat = {run.name: stored_options(run.science) for run in runs}
    differ = differing(flat)
    return {name: option_cells(own, differ) for name, own in flat.items()}


def option_cells(flat: Options, names: list[str]) -> dict[str, str]:
    """Write a run's options for a table; a digest in short, empty what the run does not have."""
    cells = {name: option_text(flat[name]) if name in flat else "" for name in names}
    if "terrain.sha256" in cells:
        cells["terrain.sha256"] = cells["terrain.sha256"][:8]
    return cells


def _print_closing_table(
    study: Study,
    curves: dict[str, list[StoredCurve]],
    ends: dict[str, list[bool | None]],
    console: Console,
) -> None:
    runs = [run for run, _ in study.runs]
    budgets = {run.config.budget for run in runs}
    pilot = min(run.config.pilot.samples / run.config.budget for run in runs)
    shares = [share for share in (0.25, 0.5, 0.75, 1.0) if share >= pilot]
    units = sorted({run.terrain.unit for run in runs})
    swept = varying(runs)
    columns = [
        TextColumn("run", least=WHOLE),
        *(TextColumn(name, right=True) for name in next(iter(swept.values()))),
        TextColumn("curve", spare=1, drawn=True),
        TextColumn("seeds", right=True),
    ]
    at = [f"at {round(min(budgets) * share)}" if len(budgets) == 1 else f"at {share:.0%}"
          for share in shares]  # fmt: skip
    numbers = [*at, "precision", "recall", "false alarms", "collapsed", "s a seed"]
    columns += [TextColumn(name, right=True) for name in numbers]
    drawn = small_curves(
        [curves[run.name] for run in runs], braille=takes_braille(console.encoding)
    )
    rows = [
        [label(run), *swept[run.name].values(), drawing,
         *_cells(run, seeds, curves[run.name], ends[run.name], shares)]
        for (run, seeds), drawing in zip(study.runs, drawn, strict=True)
    ]  # fmt: skip
    title = f"RMSE in {' or '.join(units)}: mean [95 % interval over seeds]"
    print_table(console, title, columns, rows)


def _print_closing_groups(
    study: Study,
    curves: dict[str, list[StoredCurve]],
    ends: dict[str, list[bool | None]],
    console: Console,
) -> None:
    columns = [TextColumn("method"), TextColumn("map")]
    numbers = ("runs", "missions", "RMSE", "collapsed", "s a seed")
    columns += [TextColumn(name, right=True) for name in numbers]
    rows = []
    for key, group in _groups(study).items():
        names = [run.name for run, _ in group]
        flown = [curve for name in names for curve in curves[name]]
        finals = [
            float(np.mean([curve["rmse"][-1] for curve in curves[name]]))
            for name in names if curves[name]
        ]  # fmt: skip
        middle = interval(float(np.median(finals)), min(finals), max(finals)) if finals else ""
        rows.append([
            *key, str(len(group)), str(len(flown)), middle,
            share_text(*counted_ends([end for name in names for end in ends[name]])),
            figure(float(np.mean([curve.seconds for curve in flown]))) if flown else "",
        ])  # fmt: skip
    units = " or ".join(sorted({run.terrain.unit for run, _ in study.runs}))
    title = _in_groups(study, f"RMSE in {units} at the end")
    print_table(console, title, columns, rows, named=2)
    say(console, "RMSE: median of the runs' means [least, greatest]; infoplan show tells of one "
                 "run, infoplan leaderboard ranks methods, infoplan multiverse sums up readings of "
                 "the paper")  # fmt: skip


def _ends(study: Study, run: Run, curves: list[StoredCurve]) -> list[bool | None]:
    """Tell of each mission of a run that is done whether its model has collapsed at the end."""
    return [
        ended_collapsed(study.results_dir, run.name, int(curve["seed"][-1]), curve.last)
        for curve in curves
    ]


def _cells(
    run: Run,
    seeds: list[int],
    curves: list[StoredCurve],
    ends: list[bool | None],
    shares: list[float],
) -> list[str]:
    count = str(len(seeds)) if len(curves) == len(seeds) else f"{len(curves)} of {len(seeds)}"
    if not curves:
        return [count, *[""] * (len(shares) + 5)]
    milestones = [round(run.config.budget * share) for share in shares]
    errors = np.array(
        [np.interp(milestones, curve["collected"], curve["rmse"], left=np.nan) for curve in curves]
    )
    tp, fp, fn = (
        np.array([_counted(run, curve, key) for curve in curves]) for key in ("tp", "fp", "fn")
    )
    return [
        count,
        *(_show(column) for column in errors.T),
        _ratio(tp, tp + fp),
        _ratio(tp, tp + fn),
        f"{fp.mean():.1f}",
        share_text(*counted_ends(ends)),
        figure(float(np.mean([curve.seconds for curve in curves]))),
    ]


def _time(config: Config, seconds: list[float], by: str) -> str:
    if config.backend == "dask" and config.scheduler and config.n_jobs < 0:
        return f"about {duration(sum(seconds))} of one worker's time, {by}"
    workers = 1 if config.backend == "sequential" else worker_count(config.n_jobs)
    workers = min(workers, len(seconds))
    wall = duration(wall_seconds(seconds, workers))
    return f"about {wall} with {counted(workers, 'worker')}, {by}"


def _counted(run: Run, curve: StoredCurve, key: str) -> int:
    """Count over the mission: batch scope adds up the epochs, historical judges all at the end."""
    historical = run.config.detector.scope == "historical"
    return int(curve[key][-1] if historical else curve[key].sum())


def _show(values: NDArray[np.float64]) -> str:
    mean = mean_interval(values)
    return interval(mean.mean, mean.low, mean.high).replace(" ", "\n", 1)


def _ratio(part: NDArray[np.int64], whole: NDArray[np.int64]) -> str:
    return f"{part.sum() / whole.sum():.2f}" if whole.sum() else "-"
