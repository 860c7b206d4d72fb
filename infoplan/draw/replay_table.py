"""What a replay found: the run that was flown, its replay, and their difference paired by seed."""

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from infoplan.analyse.curves import collapsed_ends, on_common_axis, summarise
from infoplan.analyse.statistics import mean_interval
from infoplan.analyse.stretches import read_stretches
from infoplan.analyse.tables import load_curves
from infoplan.collapse import counted_ends, share_text
from infoplan.config import is_survey
from infoplan.draw.console import say
from infoplan.draw.survey_table import score_lines
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table
from infoplan.study.study import Study
from infoplan.wording import counted, interval


def print_replay(study: Study, console: Console) -> None:
    """Print what was replayed, and how it compares with what was flown."""
    run, _ = study.runs[0]
    seeds = sorted(seed for _, seed in study.done)
    if seeds and is_survey(run.terrain.name):
        for what, name in (("flown", study.flown), ("replayed", run.name)):
            stretches = read_stretches(study.results_dir, str(name), seeds[0])
            for line in score_lines(stretches, run.terrain.unit):
                say(console, f"{what}: {line}")
    elif seeds:
        _print_table(study, seeds, console)
    say(console, f"flown:    {study.flown}")
    say(console, f"replayed: {run.name}")
    counts = f"{counted(study.computed, 'mission')} replayed, {study.kept} kept"
    counts += f", {len(study.failed)} failed" if study.failed else ""
    counts += f", {study.unstarted} not started (on_error=stop)" if study.unstarted else ""
    say(
        console,
        f"{counts} in {study.seconds:.1f} s; tables: {study.results_dir}/curves, samples, maps",
    )


def _print_table(study: Study, seeds: list[int], console: Console) -> None:
    """Print RMSE along the budget and the detectors' counts of a run and its replay."""
    run, _ = study.runs[0]
    budget, unit = run.config.budget, run.terrain.unit
    quarters = [round(budget * share) for share in (0.25, 0.5, 0.75, 1.0)]
    milestones = [samples for samples in quarters if samples >= run.config.pilot.samples]
    curves = {
        name: load_curves(study.results_dir, run=name, seed=seeds, terrain=run.terrain.name)
        for name in (study.flown, run.name)
    }
    errors = [on_common_axis(table, milestones).to_numpy().T for table in curves.values()]
    columns = [TextColumn("", least=WHOLE)]
    columns += [TextColumn(f"at {samples}", right=True) for samples in milestones]
    columns += [
        TextColumn(name, right=True) for name in ("caught", "missed", "false alarms", "collapsed")
    ]
    rows = []
    for what, values, of_run in zip(("flown", "replayed"), errors, curves.values(), strict=True):
        counts = summarise(of_run)[["tp", "fn", "fp"]].mean()
        shown = [_show(column) for column in values.T]
        ends = collapsed_ends(of_run, study.results_dir)
        ended = share_text(*counted_ends(list(ends.values())))
        rows.append([what, *shown, *(f"{count:.1f}" for count in counts), ended])
    gained = [_show(column) for column in (errors[1] - errors[0]).T]
    rows.append(["replayed less flown", *gained, "", "", "", ""])
    title = f"RMSE in {unit}: mean [95 % interval over seeds]"
    print_table(console, title, columns, rows)


def _show(values: NDArray[np.float64]) -> str:
    mean = mean_interval(values)
    return interval(mean.mean, mean.low, mean.high).replace(" ", "\n", 1)
