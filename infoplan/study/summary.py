"""The closing table of ``infoplan run``."""

import numpy as np
import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table

from infoplan.analyse.curves import load_curve, value_at
from infoplan.analyse.statistics import Interval, bootstrap_mean
from infoplan.study.identity import Run
from infoplan.study.runner import Study
from infoplan.study.store import is_done


def wide_console() -> Console:
    """Return the console of a run; without a terminal its lines are not cut at 80 characters."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=120)


def print_summary(study: Study, console: Console) -> None:
    """Print RMSE along the budget, detector quality and time of every run of a study."""
    runs = [(run, _curves(study, run, seeds)) for run, seeds in study.runs]
    for budget in sorted({run.config.budget for run, _ in runs}):
        chosen = [(run, curves) for run, curves in runs if run.config.budget == budget and curves]
        if chosen:
            console.print(_table(chosen, budget))
    for label, failure in study.failed:
        console.print(f"FAILED {label}\n{failure.rstrip()}", style="red", soft_wrap=True,
                      markup=False)  # fmt: skip
    parts = [f"{study.computed} missions computed", f"{study.kept} kept"]
    if study.failed:
        parts.append(f"{len(study.failed)} failed (the same command tries them again)")
    console.print(f"{', '.join(parts)} in {study.seconds:.1f} s", soft_wrap=True)
    console.print(f"tables: {study.results_dir}/curves, samples, maps", soft_wrap=True)


def final_rmse(study: Study) -> list[float]:
    """Mean final RMSE over the seeds of each configuration; NaN where no seed is done."""
    finals = {}
    for run, seeds in study.runs:
        curves = _curves(study, run, seeds)
        finals[run.name] = float(np.mean([c["rmse"].iloc[-1] for c in curves] or [np.nan]))
    return [finals[name] for name in study.names]


def _curves(study: Study, run: Run, seeds: list[int]) -> list[pd.DataFrame]:
    return [
        load_curve(study.results_dir, run.name, seed)
        for seed in seeds
        if is_done(study.results_dir, run.name, seed)
    ]


def _table(runs: list[tuple[Run, list[pd.DataFrame]]], budget: int) -> Table:
    milestones = [round(budget * share) for share in (0.25, 0.5, 0.75, 1.0)]
    units = sorted({run.terrain.unit for run, _ in runs})
    table = Table(
        title=f"RMSE in {' or '.join(units)}: mean [95 % bootstrap interval over seeds]",
        box=box.SIMPLE,
        title_justify="left",
    )
    table.add_column("run", no_wrap=True)
    table.add_column("seeds", justify="right")
    for samples in milestones:
        table.add_column(f"at {samples}", justify="right")
    for name in ("precision", "recall", "false alarms", "s a seed"):
        table.add_column(name, justify="right")
    for run, curves in runs:
        errors = np.array([value_at(curve, milestones) for curve in curves])
        tp, fp, fn = (np.array([_counted(run, curve, key) for curve in curves])
                      for key in ("tp", "fp", "fn"))  # fmt: skip
        seconds = [curve.filter(like="_seconds").to_numpy().sum() for curve in curves]
        table.add_row(
            _label(run),
            str(len(curves)),
            *(_show(bootstrap_mean(column)) for column in errors.T),
            _ratio(tp, tp + fp),
            _ratio(tp, tp + fn),
            f"{fp.mean():.1f}",
            f"{np.mean(seconds):.1f}",
        )
    return table


def _label(run: Run) -> str:
    config = run.config
    return (
        f"{config.planner.name} {config.detector.name} {config.detector.scope}\n"
        f"{run.terrain.name} rho {config.rho:g}\n{run.name.rsplit('-', 1)[1]}"
    )


def _counted(run: Run, curve: pd.DataFrame, key: str) -> int:
    """Count over the mission: batch scope adds up the epochs, historical judges all at the end."""
    historical = run.config.detector.scope == "historical"
    return int(curve[key].iloc[-1] if historical else curve[key].sum())


def _show(interval: Interval) -> str:
    if np.isnan(interval.mean):
        return ""
    if np.isnan(interval.low):
        return f"{interval.mean:.0f}"
    return f"{interval.mean:.0f}\n[{interval.low:.0f}, {interval.high:.0f}]"


def _ratio(part: np.ndarray, whole: np.ndarray) -> str:
    return f"{part.sum() / whole.sum():.2f}" if whole.sum() else "-"
