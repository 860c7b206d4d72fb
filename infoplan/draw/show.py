"""One run in the terminal: its curve, its detector, its time."""

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.curves import missions, on_common_axis, summarise
from infoplan.analyse.relief import by_relief
from infoplan.analyse.statistics import bootstrap_mean
from infoplan.analyse.tables import (
    Selection,
    changed_options,
    load_curves,
    load_maps,
    load_samples,
)
from infoplan.draw.terminal import plot_lines, takes_braille
from infoplan.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

PARTS = ("plan", "fit", "predict", "detect")
"""Parts of an epoch that are timed."""


def show(selection: Selection, console: "Console") -> None:
    """Print one run: RMSE curve, mean over seeds; detector quality; where the time went.

    Raises
    ------
    UsageError
        If the selection holds several runs.
    """
    runs = list(selection.options)
    if len(runs) > 1:
        raise UsageError(f"there are {len(runs)} runs: name one, or its hash: {', '.join(runs)}")
    curves = load_curves(selection)
    for line in [
        *_header(selection, runs[0]),
        "",
        *_curve(curves, selection, console),
        "",
        *_numbers(curves, selection),
        "",
        *_relief(selection),
        "",
        *_time(curves),
    ]:
        console.print(line, markup=False, soft_wrap=True)


def _header(selection: Selection, run: str) -> list[str]:
    seeds = selection.seeds(run)
    changed = changed_options(selection.options[run])
    options = ", ".join(f"{name}={value}" for name, value in changed.items()
                        if not name.startswith("terrain."))  # fmt: skip
    return [
        run,
        f"{selection.terrain}, budget {selection.budget}, seeds {', '.join(map(str, seeds))}",
        f"options that are not the default: {options or 'none'}",
    ]


def _curve(curves: pd.DataFrame, selection: Selection, console: "Console") -> list[str]:
    mean = on_common_axis(curves).mean(axis=1)
    number = curves["seed"].nunique()
    return plot_lines(
        mean.index,
        mean,
        width=min(60, max(20, console.width - 30)),
        height=10,
        title=f"RMSE ({selection.unit})" + (f", mean of {number} seeds" if number > 1 else ""),
        x_label="samples",
        braille=takes_braille(console.encoding),
    )


def _numbers(curves: pd.DataFrame, selection: Selection) -> list[str]:
    summary = summarise(curves)
    lines = [
        f"final RMSE        {_interval(summary['final'])} {selection.unit}",
        f"area under curve  {_interval(summary['area'])} {selection.unit} (mean over samples)",
    ]
    if curves["detector"].iloc[0] != "none":
        tp, fp, fn = (summary[key].mean() for key in ("tp", "fp", "fn"))
        lines += [
            f"flagged           {tp + fp:.1f} samples a mission, {tp:.1f} of them outliers; "
            f"{fn:.1f} outliers missed",
            f"precision         {_interval(summary['precision'], 2)}",
            f"recall            {_interval(summary['recall'], 2)}",
            f"false-alarm rate  {_interval(summary['false_alarm_rate'], 3)}",
        ]
    return lines


def _relief(selection: Selection) -> list[str]:
    samples = dict(missions(load_samples(selection)))
    judged = selection.missions["detector"].iloc[0] != "none"
    frames = [by_relief(samples[key], table) for key, table in missions(load_maps(selection))]
    mean = pd.concat(frames).groupby("class", sort=False).mean()
    unit = selection.unit
    return [
        f"{f'{name} land':<17} relief {row['relief']:.0f} {unit}, RMSE {row['rmse']:.0f} {unit}"
        + (f", false alarms {row['false_alarms']:.1f} of {row['clean']:.0f} clean samples"
           if judged else "")
        for name, row in mean.iterrows()
    ]  # fmt: skip


def _time(curves: pd.DataFrame) -> list[str]:
    seconds = {part: curves.groupby("seed")[f"{part}_seconds"].sum().mean() for part in PARTS}
    total = sum(seconds.values()) or 1.0
    parts = ", ".join(f"{part} {100 * spent / total:.0f} %" for part, spent in seconds.items())
    return [f"time              {total:.1f} s a mission: {parts}"]


def _interval(values: "pd.Series[float]", decimals: int = 0) -> str:
    estimate = bootstrap_mean(values)
    text = f"{estimate.mean:.{decimals}f}"
    if not np.isnan(estimate.low):
        text += f" [{estimate.low:.{decimals}f}, {estimate.high:.{decimals}f}]"
    return text
