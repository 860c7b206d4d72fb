"""The judged claims as a table for the terminal, as Markdown and as JSON."""

import json
import math
import re
from dataclasses import replace
from typing import Any

from rich.console import Console
from rich.text import Text

from infoplan.analyse.judging import Claim, Comparison, Stated
from infoplan.analyse.tables import Selection
from infoplan.draw.console import say, say_command
from infoplan.draw.table_layout import Cell, TextColumn, print_table
from infoplan.wording import counted, figure, harmless, interval, markdown_cell

FEW = 5
"""With fewer seeds a bootstrap interval is too narrow to lean on."""

COLOURS = {"supported": "green", "contradicted": "red", "undecided": "yellow", "missing": "magenta"}


def print_claims(claims: list[Claim], selection: Selection, console: Console) -> None:
    """Print the claims, every comparison on a line of its own; IQM is its interquartile mean."""
    columns = [
        TextColumn("claim"),
        TextColumn("compared", least=24),
        TextColumn("effect [95 %]", right=True, least=18),
        TextColumn("IQM", right=True, spare=1),
        TextColumn("stated", right=True),
        TextColumn("seeds", right=True),
        TextColumn("verdict"),
    ]
    rows: list[list[Cell] | None] = []
    for claim in claims:
        verdict = Text(claim.verdict.upper(), style=COLOURS[claim.verdict])
        said = f"{claim.text} ({claim.where})" if claim.where else claim.text
        bold = [Text(harmless(text), style="bold") for text in (claim.name, said)]
        rows.append([*bold, "", "", "", "", verdict])
        judged = any(not item.lacks for item in claim.comparisons)
        rows += [_row(item) for item in claim.comparisons if judged]
        if advice(claim):
            rows.append(["", Text(advice(claim), style="italic"), *[""] * 5])
        rows.append(None)
    print_table(console, heading(selection), columns, rows, named=2)
    for note in selection.notes:
        say(console, note)
    for names, cures in _missing(claims).items():
        before = f"{', '.join(names)}: missing, to be had with"
        for cure in cures:
            say_command(console, before, cure)
        if not cures:
            say(console, f"{before} a budget above {selection.budget}")
    for warning in _few(selection):
        say(console, warning)


def markdown(claims: list[Claim], selection: Selection) -> str:
    """Write the claims as a Markdown table, a row a claim."""
    lines = [
        markdown_cell(heading(selection)),
        "",
        "| | claim | runs | compared: effect [95 % interval], n seeds | verdict |",
        "|---|---|---|---|---|",
    ]
    for claim in claims:
        compared = "<br>".join(
            f"{markdown_cell(item.what)}: {_effect_cell(item)}, n = {item.effect.n}, {item.verdict}"
            for item in claim.comparisons
        )
        verdict = f"**{claim.verdict}**" + (f" ({advice(claim)})" if advice(claim) else "")
        said = " | ".join(markdown_cell(text) for text in (claim.name, claim.text, claim.where))
        lines.append(f"| {said} | {compared} | {verdict} |")
    below = [markdown_cell(note) for note in selection.notes]
    for names, cures in _missing(claims).items():
        told = "; ".join(map(_code, cures)) or f"a budget above {selection.budget}"
        below.append(f"{', '.join(names)}: missing, to be had with {told}")
    below += _few(selection)
    return "\n".join([*lines, "", *(f"{line}  " for line in below)]).rstrip()


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
    seeds = counted(selection.missions["seed"].nunique(), "seed")
    return f"{selection.terrain}, budget {selection.budget}, {seeds}"


def effect(item: Comparison) -> str:
    """Effect with its interval and unit; what is lacking if there is none."""
    if item.lacks:
        return item.lacks
    numbers = interval(item.effect.mean, item.effect.low, item.effect.high)
    return f"{numbers}{f' {item.unit}' if item.unit else ''}"


def stated(side: Stated, unit: str) -> str:
    """Say on which side the claim puts the effect."""
    unit = f" {unit}" if unit else ""
    if math.isinf(side.low):
        return f"< {figure(side.high)}{unit if side.high else ''}"
    if math.isinf(side.high):
        return f"> {figure(side.low)}{unit if side.low else ''}"
    return f"within ±{figure(side.high)}{unit}"


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
    for names, cures in _missing(claims).items():
        cure = "; ".join(cures) or f"a budget above {selection.budget}"
        lines.append(f"{', '.join(names)}: missing, to be had with {cure}")
    return [*lines, *_few(selection)]


def _row(item: Comparison) -> list[Cell]:
    return [
        "",
        Text(harmless(item.what), style="none"),  # no heading, unlike a claim's
        harmless(effect(item)),
        "" if item.lacks else figure(item.interquartile_mean),
        harmless(stated(item.stated, item.unit)),
        str(item.effect.n),
        item.verdict,
    ]


def _missing(claims: list[Claim]) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Commands that make what claims lack, by the claims' names."""
    names: dict[tuple[str, ...], list[str]] = {}
    for claim in claims:
        if claim.verdict == "missing":
            names.setdefault(claim.commands, []).append(claim.name)
    return {tuple(listed): cures for cures, listed in names.items()}


def _few(selection: Selection) -> list[str]:
    """Warn of too few seeds."""
    if selection.missions.groupby("run")["seed"].nunique().min() >= FEW:
        return []
    return [f"with fewer than {FEW} seeds the intervals are too narrow to lean on"]


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


def _effect_cell(item: Comparison) -> str:
    """Write an effect for Markdown, where the brackets of an interval need no escape."""
    if item.lacks:
        return markdown_cell(item.lacks)
    return effect(replace(item, unit=markdown_cell(item.unit)))


def _code(command: str) -> str:
    """Write a command as Markdown's code, whatever it holds."""
    ticks = max(map(len, re.findall("`+", command)), default=0)
    fence, pad = "`" * (ticks + 1), " " if ticks else ""
    return f"{fence}{pad}{harmless(command)}{pad}{fence}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
