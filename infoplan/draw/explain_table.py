"""Where a run's error comes from, for the terminal, as CSV and as JSON."""

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import Any

from rich.console import Console

from infoplan.analyse.error_sources import PARTS, ErrorSources
from infoplan.analyse.statistics import Interval
from infoplan.collapse import GAIN, collapse_sentence, moving_sentence
from infoplan.draw.console import say
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table
from infoplan.palette import TERMINAL
from infoplan.wording import counted, csv_cell, figure, interval, like

WORDS = {"rmse": "final RMSE", "best_rmse": "less that of BEST", "gap": "gap", **PARTS}
"""Columns of `ErrorSources.table` that are errors, and what people call them."""


def print_sources(
    sources: Sequence[ErrorSources], console: Console, *, single_seeds: bool = False
) -> None:
    """Print the parts of each run's gap, and what is known of its models.

    Parameters
    ----------
    sources
        One a run.
    console
        Where to.
    single_seeds
        Print each seed, too.
    """
    for number, one in enumerate(sources):
        if number:
            console.print()
        say(console, f"{one.run}, compared with {one.best}")
        print_table(
            console,
            f"RMSE in {one.unit}: mean [95 % interval over seeds]",
            [TextColumn("", least=WHOLE), TextColumn("mean", right=True, least=WHOLE),
             TextColumn("share", right=True)],
            [[words, span(one.interval(name)), share(one, name)] for name, words in WORDS.items()],
        )  # fmt: skip
        if single_seeds:
            print_table(
                console,
                f"each seed, in {one.unit}",
                [TextColumn("seed", right=True),
                 *(TextColumn(words, right=True) for words in WORDS.values()),
                 TextColumn("nats gained", right=True)],
                [[str(row["seed"]), *(like(row[name], row["rmse"]) for name in WORDS),
                  figure(row["gain"])] for row in one.table.to_dict("records")],
            )  # fmt: skip
        for said in remarks(one):
            say(console, said, style=TERMINAL["caution"])


def remarks(sources: ErrorSources) -> list[str]:
    """Say what is known of the models of a run: far from the optimum, collapsed, on the way."""
    table = sources.table
    count = counted(len(table), "mission")
    told = []
    if sources.far:
        verb = "gains" if sources.far == 1 else "gain"
        told.append(
            f"{sources.far} of {count} {verb} more than {GAIN:g} nats by a refit: their "
            "hyperparameters were far from the likelihood's optimum"
        )
    ends = {name: [None if math.isnan(end) else bool(end) for end in table[name]]
            for name in ("collapsed", "moving")}  # fmt: skip
    told += [collapse_sentence(ends["collapsed"]), moving_sentence(ends["moving"], explain=False)]
    if wrong := int((~table["converged"]).sum()):
        told.append(f"the refits of {wrong} of {count} have not converged: their parts are rough")
    if len(table) < 2:
        told.append("one seed has no interval")
    return [sentence for sentence in told if sentence]


def span(mean: Interval) -> str:
    """Write a mean with its interval."""
    return interval(mean.mean, mean.low, mean.high)


def share(sources: ErrorSources, part: str) -> str:
    """Write a part's share of the gap; empty of what is no part, or of no gap above zero."""
    gap = sources.table["gap"].mean()
    if part not in PARTS or not gap > 0:
        return ""
    return f"{round(100 * sources.table[part].mean() / gap)} %"


def as_csv(sources: Sequence[ErrorSources]) -> str:
    """Write the parts of every seed as CSV, a row a mission."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["run", "compared_with", "unit", *sources[0].table])
    for one in sources:
        for row in one.table.to_dict("records"):
            texts = [csv_cell(text) for text in (one.run, one.best, one.unit)]
            writer.writerow([*texts, *(_known(value) for value in row.values())])
    return stream.getvalue().rstrip("\n")


def as_json(sources: Sequence[ErrorSources]) -> str:
    """Write the parts as JSON; what is not known is null."""
    return json.dumps([_document(one) for one in sources], indent=2, allow_nan=False)


def _document(one: ErrorSources) -> dict[str, Any]:
    means = {name: one.interval(name) for name in WORDS}
    return {
        "run": one.run,
        "compared_with": one.best,
        "unit": one.unit,
        "parts": list(PARTS),
        "means": {
            name: {"mean": mean.mean, "low": _known(mean.low), "high": _known(mean.high)}
            for name, mean in means.items()
        },
        "far_from_optimum": one.far,
        "remarks": remarks(one),
        "seeds": [
            {str(name): _known(value) for name, value in row.items()}
            for row in one.table.to_dict("records")
        ],
    }


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
