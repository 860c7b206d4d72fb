"""One run in the terminal: its curve, its detector, its time."""

import math

import pandas as pd
from rich.console import Console
from rich.text import Text

from infoplan.analyse.calibration import calibration_curve
from infoplan.analyse.configurations import changed_options, option_text
from infoplan.analyse.curves import collapse, missions, moving, on_common_axis, summarise
from infoplan.analyse.relief import by_relief
from infoplan.analyse.statistics import mean_interval
from infoplan.analyse.stretches import NO_TRUTH, load_scored_curves, read_stretches
from infoplan.analyse.tables import Selection, load_maps, load_samples
from infoplan.config import is_survey
from infoplan.draw.console import INDENT, say
from infoplan.draw.survey_table import print_logs, score_lines
from infoplan.draw.terminal import plot_lines, takes_braille
from infoplan.errors import UsageError
from infoplan.palette import TERMINAL
from infoplan.wording import counted, figure, interval

PARTS = ("plan", "fit", "predict", "detect")
"""Parts of an epoch that are timed."""

SHOWN_LEVELS = (0.5, 0.8, 0.95)
"""Levels of the calibration curve that are printed."""

MARGIN = 18
"""Where what was measured begins, after its name."""


def show(selection: Selection, console: Console) -> None:
    """Print one run: RMSE curve, mean over seeds; detector quality; where the time went.

    Raises
    ------
    UsageError
        If the selection holds several runs.
    """
    runs = list(selection.options)
    if len(runs) > 1:
        raise UsageError(f"there are {len(runs)} runs: name one, or its hash: {', '.join(runs)}")
    surveyed = is_survey(selection.terrain)
    curves = load_scored_curves(selection)
    _print_header(selection, runs[0], console)
    console.print()
    title, *plot = _curve(curves, selection, console)
    say(console, title)
    for line in plot:
        console.print(Text(line), soft_wrap=True)
    console.print()
    _print_fields(_survey(selection) if surveyed else _numbers(curves, selection), console)
    if surveyed:
        for seed in selection.seeds(runs[0]):
            print_logs(selection.results_dir, runs[0], seed, console)
    if said := collapse(curves, selection.results_dir):
        say(console, said, style=TERMINAL["caution"])
    if said := moving(curves, selection.results_dir, explain=not surveyed):
        say(console, said, style=TERMINAL["caution"])
    console.print()
    if not surveyed:
        _print_fields(_further_scores(curves, selection), console)
        console.print()
        _print_fields(_relief(selection), console)
        console.print()
    _print_fields(_time(curves), console)


def _print_header(selection: Selection, run: str, console: Console) -> None:
    seeds = selection.seeds(run)
    changed = changed_options(selection.options[run])
    # Of a survey nobody has asked the planner and the robot, and its log decides the sizes.
    hidden = ("terrain.", *(("planner.", "robot.", "pilot.", "budget", "grid")
                            if is_survey(selection.terrain) else ()))  # fmt: skip
    options = ", ".join(f"{name}={option_text(value)}" for name, value in changed.items()
                        if not name.startswith(hidden) or name == "planner.smoothing")  # fmt: skip
    say(console, run)
    say(console, f"{selection.terrain}, budget {selection.budget}, seeds "
        f"{', '.join(map(str, seeds))}")  # fmt: skip
    say(console, f"options that are not the default: {options or 'none'}", indent=INDENT)


def _print_fields(fields: dict[str, str], console: Console) -> None:
    """Print what was measured below each other, each after its name."""
    for name, text in fields.items():
        say(console, f"{name:<{MARGIN}}{text}", indent=" " * MARGIN)


def _curve(curves: pd.DataFrame, selection: Selection, console: Console) -> list[str]:
    mean = on_common_axis(curves).mean(axis=1)
    number = curves["seed"].nunique()
    return plot_lines(
        mean.index,
        mean,
        width=min(60, max(10, console.width - 20)),
        height=10,
        title=f"{'cross-validated ' * is_survey(selection.terrain)}RMSE ({selection.unit})"
        + (f", mean of {number} seeds" if number > 1 else ""),
        x_label="samples",
        braille=takes_braille(console.encoding),
    )


def _numbers(curves: pd.DataFrame, selection: Selection) -> dict[str, str]:
    summary, unit = summarise(curves), selection.unit
    fields = {
        "final RMSE": f"{_interval(summary['final'])} {unit}",
        "area under curve": f"{_interval(summary['area'])} {unit} (mean over samples)",
    }
    if curves["detector"].iloc[0] != "none":
        tp, fp, fn = (summary[key].mean() for key in ("tp", "fp", "fn"))
        fields |= {
            "flagged": f"{tp + fp:.1f} samples a mission, {tp:.1f} of them outliers; "
            f"{fn:.1f} outliers missed",
            "precision": _interval(summary["precision"], 2),
            "recall": _interval(summary["recall"], 2),
            "false-alarm rate": _interval(summary["false_alarm_rate"]),
        }
    return fields


def _survey(selection: Selection) -> dict[str, str]:
    """Tell of a survey what can be told without the truth."""
    (run, seed), samples = next(missions(load_samples(selection)))
    silent = int(samples["measured"].isna().sum())
    scores, filtered = score_lines(read_stretches(selection.results_dir, run, seed), selection.unit)
    flagged = int(samples["flagged"].sum()) - silent
    return {
        "flagged": f"{flagged} of {counted(len(samples) - silent, 'sample')}; precision and recall "
        f"need labels, and {NO_TRUTH}",
        "scores": scores,
        "without filter": filtered,
    }


def _further_scores(curves: pd.DataFrame, selection: Selection) -> dict[str, str]:
    """Scores of the last epoch, means over seeds, as far as they are stored."""
    final = curves.groupby("seed").last().mean(numeric_only=True)
    scores = {"CRPS": ("crps", selection.unit), "SMSE": ("smse", ""), "MSLL": ("msll", ""),
              "path length": ("path_length", "workspace units")}  # fmt: skip
    fields = {
        name: f"{figure(final[column])} {unit}".strip()
        for name, (column, unit) in scores.items()
        if pd.notna(final.get(column))
    }
    covered = calibration_curve(selection, SHOWN_LEVELS).groupby("level")["covered"].mean()
    told = ", ".join(
        f"{100 * covered[level]:.0f} % of the nodes in {100 * level:.0f} % intervals"
        for level in SHOWN_LEVELS
        if pd.notna(covered[level])
    )
    return fields | ({"calibration": told} if told else {})


def _relief(selection: Selection) -> dict[str, str]:
    samples = dict(missions(load_samples(selection)))
    judged = selection.missions["detector"].iloc[0] != "none"
    frames = [by_relief(samples[key], table) for key, table in missions(load_maps(selection))]
    mean = pd.concat(frames).groupby("class", sort=False).mean()
    unit = selection.unit
    return {
        f"{name} land": f"relief {figure(row['relief'])} {unit}, RMSE {figure(row['rmse'])} {unit}"
        + (f", false alarms {row['false_alarms']:.1f} of {row['clean']:.0f} clean samples"
           if judged else "")
        for name, row in mean.iterrows()
    }  # fmt: skip


def _time(curves: pd.DataFrame) -> dict[str, str]:
    seconds = {part: curves.groupby("seed")[f"{part}_seconds"].sum().mean() for part in PARTS}
    total = sum(seconds.values()) or 1.0
    parts = ", ".join(f"{part} {100 * spent / total:.0f} %" for part, spent in seconds.items())
    return {"time": f"{total:.1f} s a mission: {parts}"}


def _interval(values: "pd.Series[float]", decimals: int | None = None) -> str:
    """Mean with its interval: with the digits that it deserves, or of a share with two decimals."""
    mean = mean_interval(values)
    if decimals is None:
        return interval(mean.mean, mean.low, mean.high)
    numbers = [f"{value:.{decimals}f}" for value in (mean.mean, mean.low, mean.high)]
    return numbers[0] if math.isnan(mean.low) else f"{numbers[0]} [{numbers[1]}, {numbers[2]}]"
