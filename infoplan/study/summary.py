"""The tables around a study: what would run, and what came out."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from infoplan.analyse.statistics import Interval, bootstrap_mean
from infoplan.config import Config, options
from infoplan.draw.terminal import small_curves, takes_braille
from infoplan.methods import method_label
from infoplan.output import Output
from infoplan.study.estimate import duration, kind_of, wall_seconds
from infoplan.study.identity import Run
from infoplan.study.pool import worker_count
from infoplan.study.runner import Study
from infoplan.study.store import read_table

LABELLED = ("planner.name", "detector.name", "detector.scope", "rho", "terrain.name")
"""Options that a run's label shows in any case."""


@dataclass(frozen=True)
class Curve:
    """A stored learning curve: its columns as arrays."""

    columns: dict[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    @property
    def seconds(self) -> float:
        """Seconds of planning, fitting, predicting and detecting."""
        return float(sum(self[name].sum() for name in self.columns if name.endswith("_seconds")))


def wide_console(width: int = 120) -> Console:
    """Return the console of a command; without a terminal its lines are not cut so soon."""
    output: Any = Output()  # a study goes on without it
    console = Console(file=output, highlight=False)
    return console if console.is_terminal else Console(file=output, highlight=False, width=width)


def print_summary(study: Study, console: Console) -> None:
    """Print RMSE along the budget, detector quality, time and failures of a study's runs."""
    curves = {run.name: stored_curves(study, run, seeds) for run, seeds in study.runs}
    console.print(_closing_table(study, curves, takes_braille(console.encoding)))
    for label, reason, path in study.failed:
        console.print(Text(f"FAILED {label}: {reason} ({path})", style="bold red"), soft_wrap=True)
    computed = f"{study.computed} {'mission' if study.computed == 1 else 'missions'} computed"
    parts = [computed, f"{study.kept} kept"]
    if study.failed:
        parts.append(f"{len(study.failed)} failed (the same command tries them again)")
    if study.unstarted:
        parts.append(f"{study.unstarted} not started (on_error=stop)")
    console.print(f"{', '.join(parts)} in {duration(study.seconds)}", soft_wrap=True)
    console.print(f"tables: {study.results_dir}/curves, samples, maps", soft_wrap=True)


def print_plan(study: Study, config: Config, console: Console) -> None:
    """Print what a study would fly, what is stored already, and how long it would take."""
    todo = study.todo(config.resume)
    table = _table("what would run")
    for name in ("stored", "to run", "seeds to run", "about"):
        table.add_column(name, justify="right" if name != "seeds to run" else "left")
    named = labels([run for run, _ in study.runs])
    for run, seeds in study.runs:
        own = [task.seed for task in todo if task.run.name == run.name]
        one = study.pace.seconds(kind_of(run.science))
        about = duration(one * len(own)) if one and own else ""
        table.add_row(named[run.name], str(len(seeds) - len(own)), str(len(own)),
                      spans(own), about)  # fmt: skip
    console.print(table)
    for stored in study.stored.values():
        if stored.state == "broken":
            console.print(Text(f"broken: {stored.reason}", style="yellow"), soft_wrap=True)
    console.print(f"{len(todo)} missions would run, {len(study.stored) - len(todo)} are stored in "
                  f"{study.results_dir}", soft_wrap=True)  # fmt: skip
    if todo:
        console.print(_estimate(study, config, [kind_of(task.run.science) for task in todo]))


def final_rmse(study: Study) -> list[float]:
    """Mean final RMSE over the seeds of each configuration; NaN where no seed is done."""
    finals = {}
    for run, seeds in study.runs:
        curves = stored_curves(study, run, seeds)
        finals[run.name] = float(np.mean([curve["rmse"][-1] for curve in curves] or [np.nan]))
    return [finals[name] for name in study.names]


def stored_curves(study: Study, run: Run, seeds: list[int]) -> list[Curve]:
    """Read the learning curves of the missions of a run that are done: kept, or flown now."""
    curves = []
    for seed in [seed for seed in seeds if (run.name, seed) in study.done]:
        table = read_table(study.results_dir, "curves", run.name, seed)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        curves.append(Curve(columns))
    return curves


def labels(runs: list[Run]) -> dict[str, str]:
    """Label runs by method, map, and the options in which they differ, by the runs' names."""
    varying, made = _varying(runs), {}
    for run in runs:
        config, words = run.config, [run.terrain.name, f"rho {run.config.rho:g}"]
        words += [f"{name}={value}" for name, value in _flat(run).items() if name in varying]
        made[run.name] = (
            f"{method_label(config.planner)} {method_label(config.detector)} "
            f"{config.detector.scope}\n"
            f"{' '.join(words)}\n{run.name.rsplit('-', 1)[1]}"
        )
    return made


def spans(numbers: list[int]) -> str:
    """Write a list of integers in short: ``0-3, 7``."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1] = [parts[-1][0], number]
        else:
            parts.append([number])
    return ", ".join("-".join(map(str, part)) for part in parts)


def _closing_table(study: Study, curves: dict[str, list[Curve]], braille: bool) -> Table:
    runs = [run for run, _ in study.runs]
    budgets = {run.config.budget for run in runs}
    pilot = min(run.config.pilot.samples / run.config.budget for run in runs)
    shares = [share for share in (0.25, 0.5, 0.75, 1.0) if share >= pilot]
    units = sorted({run.terrain.unit for run in runs})
    table = _table(f"RMSE in {' or '.join(units)}: mean [95 % bootstrap interval over seeds]")
    table.add_column("curve", no_wrap=True)
    table.add_column("seeds", justify="right")
    for share in shares:
        at = f"at {round(min(budgets) * share)}" if len(budgets) == 1 else f"at {share:.0%}"
        table.add_column(at, justify="right")
    for name in ("precision", "recall", "false alarms", "s a seed"):
        table.add_column(name, justify="right", min_width=max(map(len, name.split())))
    named = labels(runs)
    drawn = small_curves([curves[run.name] for run in runs], braille=braille)
    for (run, seeds), drawing in zip(study.runs, drawn, strict=True):
        table.add_row(named[run.name], drawing, *_cells(run, seeds, curves[run.name], shares))
    return table


def _table(title: str) -> Table:
    table = Table(title=title, box=box.SIMPLE, title_justify="left")
    table.add_column("run", no_wrap=True)
    return table


def _cells(run: Run, seeds: list[int], curves: list[Curve], shares: list[float]) -> list[str]:
    count = str(len(seeds)) if len(curves) == len(seeds) else f"{len(curves)} of {len(seeds)}"
    if not curves:
        return [count]
    milestones = [round(run.config.budget * share) for share in shares]
    errors = np.array(
        [np.interp(milestones, curve["collected"], curve["rmse"], left=np.nan) for curve in curves]
    )
    tp, fp, fn = (
        np.array([_counted(run, curve, key) for curve in curves]) for key in ("tp", "fp", "fn")
    )
    return [
        count,
        *(_show(bootstrap_mean(column)) for column in errors.T),
        _ratio(tp, tp + fp),
        _ratio(tp, tp + fn),
        f"{fp.mean():.1f}",
        f"{np.mean([curve.seconds for curve in curves]):.1f}",
    ]


def _estimate(study: Study, config: Config, kinds: list[Any]) -> str:
    seconds = [study.pace.seconds(kind) for kind in kinds]
    known = [value for value in seconds if value is not None]
    if len(known) < len(seconds):
        return "no mission is stored yet to estimate the time from"
    if config.backend == "dask" and config.scheduler and config.n_jobs < 0:
        return f"about {duration(sum(known))} of one worker's time, by the missions stored"
    workers = 1 if config.backend == "sequential" else worker_count(config.n_jobs)
    workers = min(workers, len(known))
    return (
        f"about {duration(wall_seconds(known, workers))} with {workers} "
        f"{'worker' if workers == 1 else 'workers'}, by the missions stored"
    )


def _flat(run: Run) -> dict[str, Any]:
    return {name: value for name, value, _ in options(run.config)}


def _varying(runs: list[Run]) -> set[str]:
    """Options, those in every label apart, that are not the same in all runs that have them."""
    flat = [_flat(run) for run in runs]
    return {
        name
        for name in {name for one in flat for name in one} - {*LABELLED, "terrain.path"}
        if len({repr(one[name]) for one in flat if name in one}) > 1
    }


def _counted(run: Run, curve: Curve, key: str) -> int:
    """Count over the mission: batch scope adds up the epochs, historical judges all at the end."""
    historical = run.config.detector.scope == "historical"
    return int(curve[key][-1] if historical else curve[key].sum())


def _show(interval: Interval) -> str:
    if np.isnan(interval.mean):
        return ""
    if np.isnan(interval.low):
        return f"{interval.mean:.0f}"
    return f"{interval.mean:.0f}\n[{interval.low:.0f}, {interval.high:.0f}]"


def _ratio(part: NDArray[np.int64], whole: NDArray[np.int64]) -> str:
    return f"{part.sum() / whole.sum():.2f}" if whole.sum() else "-"
