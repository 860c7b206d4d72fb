"""What a survey has found, in the terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console

from infoplan.analyse.detector_check import Checked, agreement
from infoplan.analyse.later_logs import COUNTS, COUNTS_TITLE, read_origins, verdict_counts
from infoplan.analyse.stretches import NO_TRUTH, gain, read_stretches, scores_by_epoch
from infoplan.collapse import collapse_sentence
from infoplan.draw.console import INDENT, say
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table
from infoplan.palette import TERMINAL
from infoplan.study.store import present_tables, read_table
from infoplan.study.stored_curves import ended_collapsed
from infoplan.study.study import Study
from infoplan.wording import counted, figure, interval


def print_survey(study: Study, console: Console, folder: Path, files: Sequence[str]) -> None:
    """Print what was flagged, how well the rest predicts itself, and what was written.

    Parameters
    ----------
    study
        Of one survey, done.
    console
        Where to.
    folder, files
        What one takes away: where it lies, and a line on each file.
    """
    run, (seed,) = study.runs[0]
    flagged, told = (
        read_table(study.results_dir, "samples", run.name, seed)[name].to_numpy()
        for name in ("flagged", "measured")
    )
    silent = int(pd.isna(told).sum())
    say(console, run.name)
    say(
        console,
        f"flagged: {int(flagged.sum()) - silent} of {counted(len(flagged) - silent, 'sample')}",
        indent=INDENT,
    )
    print_logs(study.results_dir, run.name, seed, console)
    stretches = read_stretches(study.results_dir, run.name, seed)
    for line in score_lines(stretches, run.terrain.unit):
        say(console, line, indent=INDENT)
    last = read_table(study.results_dir, "curves", run.name, seed).to_pylist()[-1]
    if said := collapse_sentence([ended_collapsed(study.results_dir, run.name, seed, last)]):
        say(console, said, indent=INDENT, style=TERMINAL["caution"])
    say(console, f"{folder}:")
    for file in files:
        say(console, f"{INDENT}{file}", indent=2 * INDENT)
    tables = present_tables(study.results_dir, run.name, seed)
    say(console, f"tables: {study.results_dir}/{', '.join(tables)}")


def print_logs(results_dir: Path, run: str, seed: int, console: Console) -> None:
    """Print, for a survey of several logs, what the later ones say of the flags of the earlier."""
    origins = read_origins(results_dir, run, seed)
    if origins is None:
        return
    samples = read_table(results_dir, "samples", run, seed).to_pandas()
    counts = verdict_counts(origins, samples)
    columns = [TextColumn("log", least=WHOLE)]
    columns += [TextColumn(title, right=True) for title in COUNTS.values()]
    rows = [
        [str(name), *(str(row[column]) for column in COUNTS)] for name, row in counts.iterrows()
    ]
    print_table(console, COUNTS_TITLE, columns, rows)


def print_check(checked: Mapping[str, Checked], unit: str, console: Console) -> None:
    """Print how detectors compare on a survey: planted spikes, predictions, agreement."""
    planted = next(iter(checked.values())).planted
    columns = [TextColumn("detector", least=WHOLE)]
    columns += [
        TextColumn(title, right=True)
        for title in ("flags", "planted found", "others flagged", "change of RMSE")
    ]
    rows = [
        [
            name, str(int(one.flagged.sum())), f"{one.found} of {planted}", str(one.besides),
            interval(one.gain.mean, one.gain.low, one.gain.high),
        ]
        for name, one in checked.items()
    ]  # fmt: skip
    title = (
        "Detectors on the log, all samples at once, and on a copy with "
        f"{counted(planted, 'planted spike')}; change of the cross-validated RMSE in "
        f"{unit or 'unit unknown'} without its flags [95 % interval]"
    )
    print_table(console, title, columns, rows)
    both = agreement({name: one.flagged for name, one in checked.items()})
    columns = [TextColumn("flagged by both", least=WHOLE)]
    columns += [TextColumn(str(name), right=True) for name in both]
    rows = [[str(name), *(str(count) for count in row)] for name, row in both.iterrows()]
    print_table(console, "Agreement: samples that two detectors flag", columns, rows)


def score_lines(stretches: pd.DataFrame, unit: str) -> list[str]:
    """Tell the cross-validated scores of a survey at its end."""
    last, count = scores_by_epoch(stretches).iloc[-1], stretches["stretch"].nunique()
    change = gain(stretches)
    return [
        f"RMSE ({unit or 'unit unknown'}), cross-validated, as {NO_TRUTH}: "
        f"{figure(last['rmse'])} with each of {count} stretches of the track predicted from the "
        f"others, {figure(last['loo_rmse']) or 'unknown'} with each sample from all others",
        f"with flagged samples in the model: {figure(last['rmse_unfiltered'])}; leaving them out "
        f"changes it by {interval(change.mean, change.low, change.high)} a stretch",
    ]
