"""What a replay found: the run that was flown, its replay, and their difference paired by seed."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from infoplan.analyse.curves import on_common_axis, summarise
from infoplan.analyse.statistics import Interval, bootstrap_mean
from infoplan.analyse.tables import load_curves
from infoplan.study.replay import Replay

if TYPE_CHECKING:
    from rich.console import Console


def print_replay(done: Replay, results_dir: Path, console: "Console") -> None:
    """Print what was replayed, and how it compares with what was flown."""
    if done.seeds:
        _print_table(done, results_dir, console)
    console.print(f"flown:    {done.source.name}", soft_wrap=True)
    console.print(f"replayed: {done.run.name}", soft_wrap=True)
    counts = f"{done.computed} missions replayed, {len(done.seeds) - done.computed} kept"
    if done.failed:
        counts += f", {done.failed} failed"
    console.print(
        f"{counts} in {done.seconds:.1f} s; tables: {results_dir}/curves, samples, maps",
        soft_wrap=True,
    )


def _print_table(done: Replay, results_dir: Path, console: "Console") -> None:
    """Print RMSE along the budget and the detectors' counts of a run and its replay."""
    from rich import box
    from rich.table import Table

    budget, unit = done.run.config.budget, done.run.terrain.unit
    quarters = [round(budget * share) for share in (0.25, 0.5, 0.75, 1.0)]
    milestones = [samples for samples in quarters if samples >= done.run.config.pilot.samples]
    curves = {
        name: load_curves(results_dir, run=name, seed=done.seeds, terrain=done.run.terrain.name)
        for name in (done.source.name, done.run.name)
    }
    errors = [on_common_axis(table, milestones).to_numpy().T for table in curves.values()]
    table = Table(
        title=f"RMSE in {unit}: mean [95 % bootstrap interval over seeds]",
        box=box.SIMPLE,
        title_justify="left",
    )
    table.add_column("", no_wrap=True)
    for samples in milestones:
        table.add_column(f"at {samples}", justify="right")
    for name in ("caught", "missed", "false alarms"):
        table.add_column(name, justify="right")
    for what, values, of_run in zip(("flown", "replayed"), errors, curves.values(), strict=True):
        counts = summarise(of_run)[["tp", "fn", "fp"]].mean()
        shown = [_show(bootstrap_mean(column)) for column in values.T]
        table.add_row(what, *shown, *(f"{count:.1f}" for count in counts))
    gained = [_show(bootstrap_mean(column)) for column in (errors[1] - errors[0]).T]
    table.add_row("replayed less flown", *gained)
    console.print(table)


def _show(interval: Interval) -> str:
    if np.isnan(interval.mean):
        return ""
    if np.isnan(interval.low):
        return f"{interval.mean:.0f}"
    return f"{interval.mean:.0f}\n\\[{interval.low:.0f}, {interval.high:.0f}]"
