"""The judged claims as a table for the terminal, as Markdown and as JSON."""

import json
import math
from typing import TYPE_CHECKING, Any

from infoplan.analyse.judging import Claim, Comparison, Stated
from infoplan.analyse.tables import Selection

if TYPE_CHECKING:
    from rich.console import Console

FEW = 5
"""With fewer seeds a bootstrap interval is too narrow to lean on."""

COLOURS = {"supported": "green", "contradicted": "red", "undecided": "yellow", "missing": "magenta"}


def print_claims(claims: list[Claim], selection: Selection, console: "Console") -> None:
    """Print the claims, every comparison on a line of its own; IQM is its interquartile mean."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE, title=heading(selection), title_justify="left")
    for column in ("claim", "compared"):
        table.add_column(column)
    for column in ("effect [95 %]", "IQM", "stated", "seeds"):
        table.add_column(column, justify="right", no_wrap=column != "seeds")
    table.add_column("verdict", no_wrap=True)
    for claim in claims:
        colour = COLOURS[claim.verdict]
        verdict = f"[{colour}]{claim.verdict.upper()}[/]"
        table.add_row(
            f"[bold]{claim.name}[/]", f"[bold]{claim.text}[/]", claim.where, "", "", "", verdict
        )
        judged = any(not item.lacks for item in claim.comparisons)
        for item in claim.comparisons if judged else ():
            table.add_row(
                "",
                item.what,
                effect(item).replace("[", "\\["),
                "" if item.lacks else number(item.interquartile_mean),
                stated(item.stated, item.unit),
                str(item.effect.n),
                item.verdict,
            )
        if advice(claim):
            table.add_row("", f"[italic]{advice(claim)}[/]")
        table.add_section()
    console.print(table)
    for line in remarks(claims, selection):
        console.print(line, soft_wrap=True, markup=False)


def markdown(claims: list[Claim], selection: Selection) -> str:
    """Write the claims as a Markdown table, a row a claim."""
    lines = [
        heading(selection),
        "",
        "| | claim | runs | compared: effect [95 % interval], n seeds | verdict |",
        "|---|---|---|---|---|",
    ]
    for claim in claims:
        compared = "<br>".join(
            f"{item.what}: {effect(item)}, n = {item.effect.n}, {item.verdict}"
            for item in claim.comparisons
        )
        verdict = f"**{claim.verdict}**" + (f" ({advice(claim)})" if advice(claim) else "")
        lines.append(f"| {claim.name} | {claim.text} | {claim.where} | {compared} | {verdict} |")
    return "\n".join([*lines, "", *(f"{line}  " for line in remarks(claims, selection))]).rstrip()


def as_json(claims: list[Claim], selection: Selection) -> str:
    """Write the claims as JSON; what is not known or unbounded is null."""
    document = {
        "terrain": selection.terrain,
        "unit": selection.unit,
        "budget": selection.budget,
        "seeds": sorted({int(seed) for seed in selection.missions["seed"]}),
        "notes": list(selection.notes),
        "claims": [_claim(claim) for claim in claims],
    }
    return json.dumps(document, indent=2, allow_nan=False)


def heading(selection: Selection) -> str:
    """Say what the claims were judged on."""
    seeds = selection.missions["seed"].nunique()
    return f"{selection.terrain}, budget {selection.budget}, {seeds} seeds"


def effect(item: Comparison) -> str:
    """Effect with its interval and unit; what is lacking if there is none."""
    if item.lacks:
        return item.lacks
    mean, low, high = (
        number(value) for value in (item.effect.mean, item.effect.low, item.effect.high)
    )
    interval = "" if math.isnan(item.effect.low) else f" [{low}, {high}]"
    return f"{mean}{interval}{f' {item.unit}' if item.unit else ''}"


def stated(side: Stated, unit: str) -> str:
    """Say on which side the claim puts the effect."""
    unit = f" {unit}" if unit else ""
    if math.isinf(side.low):
        return f"< {number(side.high)}{unit if side.high else ''}"
    if math.isinf(side.high):
        return f"> {number(side.low)}{unit if side.low else ''}"
    return f"within ±{number(side.high)}{unit}"


def advice(claim: Claim) -> str:
    """Say how many more seeds an undecided claim roughly needs."""
    more = claim.more_seeds
    if more is None:
        return ""
    if math.isnan(more):
        return "a single seed has no interval: run more"
    if math.isinf(more):
        return "no number of seeds would help: an effect is about at its bound"
    return f"about {more:.0f} more seed{'s' if more > 1 else ''} would decide it"


def remarks(claims: list[Claim], selection: Selection) -> list[str]:
    """Say what the reader should know besides: what was left out, what to run, few seeds."""
    lines = list(selection.notes)
    lacking: dict[str, list[str]] = {}
    for claim in claims:
        if claim.verdict == "missing":
            cure = "; ".join(claim.commands) or f"a budget above {selection.budget}"
            lacking.setdefault(cure, []).append(claim.name)
    for cure, names in lacking.items():
        lines.append(f"{', '.join(names)}: missing, to be had with {cure}")
    if selection.missions.groupby("run")["seed"].nunique().min() < FEW:
        lines.append(f"with fewer than {FEW} seeds the intervals are too narrow to lean on")
    return lines


def number(value: float) -> str:
    """Write a number as its size deserves: 123, 12.3, 0.123."""
    size = abs(value)
    decimals = 0 if size >= 100 or value == 0 else 1 if size >= 10 else 2 if size >= 1 else 3
    return f"{value:.{decimals}f}"


def _claim(claim: Claim) -> dict[str, Any]:
    return {
        "name": claim.name,
        "text": claim.text,
        "where": claim.where,
        "verdict": claim.verdict,
        "more_seeds": None if claim.more_seeds is None else _finite(claim.more_seeds),
        "advice": advice(claim),
        "commands": list(claim.commands),
        "comparisons": [
            {
                "what": item.what,
                "unit": item.unit,
                "stated": {"low": _finite(item.stated.low), "high": _finite(item.stated.high)},
                "effect": _finite(item.effect.mean),
                "low": _finite(item.effect.low),
                "high": _finite(item.effect.high),
                "interquartile_mean": _finite(item.interquartile_mean),
                "n": item.effect.n,
                "verdict": item.verdict,
                "lacks": item.lacks,
            }
            for item in claim.comparisons
        ],
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
