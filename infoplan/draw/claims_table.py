"""The judged claims as a table for the terminal, as Markdown, JSON and CSV."""

import csv
import io
import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rich.console import Console
from rich.text import Text

from infoplan.analyse.judging import (
    FEW_SEEDS,
    MISSING,
    SEEDS_NEEDED,
    UNDECIDED,
    Claim,
    Comparison,
    Stated,
)
from infoplan.analyse.tables import Selection
from infoplan.collapse import share_text
from infoplan.draw.console import say, say_command
from infoplan.draw.table_layout import Cell, TextColumn, print_table
from infoplan.palette import TERMINAL
from infoplan.wording import counted, csv_cell, figure, harmless, interval, markdown_cell


def print_claims(claims: list[Claim], selection: Selection, console: Console) -> None:
    """Print the claims, every comparison on a line of its own; p is exact, by sign flips."""
    columns = [
        TextColumn("claim"),
        TextColumn("compared", least=24),
        TextColumn("effect [95 %]", right=True, least=18),
        TextColumn("p", right=True, spare=1),
        TextColumn("stated", right=True),
        TextColumn("seeds", right=True),
        TextColumn("verdict"),
    ]
    rows: list[list[Cell] | None] = []
    for claim in claims:
        verdict = Text(claim.verdict.upper(), style=TERMINAL[claim.verdict])
        said = f"{claim.text} ({claim.where})" if claim.where else claim.text
        bold = [Text(harmless(text), style="bold") for text in (claim.name, said)]
        rows.append([*bold, "", "", "", "", verdict])
        judged = any(not item.lacks for item in claim.comparisons)
        rows += [_row(item) for item in claim.comparisons if judged]
        rows += [["", Text(told, style="italic"), *[""] * 5] for told in cautions(claim)]
        rows.append(None)
    print_table(console, heading(selection), columns, rows, named=2)
    for note in selection.notes:
        say(console, note)
    for names, cures, budget in _missing(claims, selection):
        before = f"{names}: missing, to be had with"
        for cure in cures:
            say_command(console, before, cure)
        if not cures:
            say(console, f"{before} {budget}")
    for line in (holm_words(claims), *_few(selection)):
        say(console, line)


def markdown(claims: list[Claim], selection: Selection) -> str:
    """Write the claims as a Markdown table, a row a claim."""
    lines = [
        markdown_cell(heading(selection)),
        "",
        "| | claim | runs | compared: effect [95 % interval], n seeds, exact p | verdict |",
        "|---|---|---|---|---|",
    ]
    for claim in claims:
        compared = "<br>".join(
            f"{markdown_cell(item.what)}: {_effect_cell(item)}, n = {item.effect.n}, "
            f"p = {exact_p(item) or '-'}, {item.verdict}"
            for item in claim.comparisons
        )
        told = markdown_cell("; ".join(cautions(claim)))
        verdict = f"**{claim.verdict}**" + (f" ({told})" if told else "")
        said = " | ".join(markdown_cell(text) for text in (claim.name, claim.text, claim.where))
        lines.append(f"| {said} | {compared} | {verdict} |")
    below = [markdown_cell(note) for note in selection.notes]
    for names, cures, budget in _missing(claims, selection):
        told = "; ".join(map(_code, cures)) or budget
        below.append(f"{names}: missing, to be had with {told}")
    below += [holm_words(claims), *_few(selection)]
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


def as_csv(claims: list[Claim]) -> str:
    """Write the effect of every seed as CSV, a row a comparison and seed."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["claim", "compared", "unit", "seed", "effect"])
    for claim in claims:
        for item in claim.comparisons:
            named = [csv_cell(text) for text in (claim.name, item.what, item.unit)]
            writer.writerows([*named, seed, value] for seed, value in item.values.items())
    return stream.getvalue().rstrip("\n")


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
    low, high = (
        f"{figure(bound)} {unit}" if unit else f"{bound:g}" for bound in (side.low, side.high)
    )
    if math.isinf(side.low):
        return f"< {high}"
    return f"> {low}" if math.isinf(side.high) else f"within ±{high}"


def exact_p(item: Comparison) -> str:
    """Write the exact p of a comparison; empty if something is lacking."""
    if item.lacks:
        return ""
    return f"{item.p_exact:.3f}" if item.p_exact >= 0.0005 else "<0.001"


def cautions(claim: Claim) -> list[str]:
    """Say what the reader of a claim's verdict should know: few seeds, collapsed models."""
    told = []
    if claim.verdict == UNDECIDED and claim.seeds < SEEDS_NEEDED:
        told.append(f"{counted(claim.seeds, 'seed')}, at least six are needed")
    ended = [f"{method} {share_text(*ends)}" for method, ends in claim.collapsed.items()]
    if any(count for count, _ in claim.collapsed.values()):
        told.append(f"end collapsed: {', '.join(ended)}")
    return told


def holm_words(claims: Sequence[Claim]) -> str:
    """Say which verdicts survive the correction for the number of claims."""
    decided = [claim for claim in claims if claim.verdict in ("supported", "contradicted")]
    kept = [claim.name for claim in decided if claim.survives]
    lost = [claim.name for claim in decided if not claim.survives]
    after = f"Holm's correction over {counted(len(claims), 'claim')}"
    if not decided:
        return f"no verdict, so none to survive {after}"
    if not lost:
        return f"all {counted(len(kept), 'verdict')} survive {after}" if len(kept) > 1 else (
            f"the verdict survives {after}")  # fmt: skip
    told = f"after {after} remain: {', '.join(kept) or 'none'}"
    return f"{told}; not: {', '.join(lost)}"


def remarks(claims: list[Claim], selection: Selection) -> list[str]:
    """Say what the reader should know besides: what was left out, what to run, few seeds."""
    lines = list(selection.notes)
    for names, cures, budget in _missing(claims, selection):
        lines.append(f"{names}: missing, to be had with {'; '.join(cures) or budget}")
    return [*lines, *_few(selection)]


def _row(item: Comparison) -> list[Cell]:
    return [
        "",
        Text(harmless(item.what), style="none"),  # no heading, unlike a claim's
        harmless(effect(item)),
        exact_p(item),
        harmless(stated(item.stated, item.unit)),
        str(item.effect.n),
        item.verdict,
    ]


def _missing(
    claims: Sequence[Claim], selection: Selection
) -> list[tuple[str, tuple[str, ...], str]]:
    """Names of claims that lack something, commands that make it, and the budget it takes."""
    names: dict[tuple[tuple[str, ...], str], list[str]] = {}
    for claim in claims:
        if claim.verdict == MISSING:
            above = max([selection.budget, *(one.above for one in claim.comparisons)])
            cure = (claim.commands, f"a budget above {above}")
            names.setdefault(cure, []).append(claim.name)
    return [(", ".join(listed), *cure) for cure, listed in names.items()]


def _few(selection: Selection) -> list[str]:
    """Warn of too few seeds."""
    if selection.missions.groupby("run")["seed"].nunique().min() >= SEEDS_NEEDED:
        return []
    return [FEW_SEEDS]


def _claim(claim: Claim) -> dict[str, Any]:
    return {
        "name": claim.name,
        "text": claim.text,
        "where": claim.where,
        "verdict": claim.verdict,
        "p": claim.p,
        "p_holm": _finite(claim.p_holm),
        "survives_holm": claim.survives,
        "collapsed": {
            method: {"collapsed": count, "missions": known}
            for method, (count, known) in claim.collapsed.items()
        },
        "cautions": cautions(claim),
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
                "p_supported": item.p_supported,
                "p_contradicted": item.p_contradicted,
                "p_exact": None if item.lacks else item.p_exact,
                "seeds": {str(seed): _finite(value) for seed, value in item.values.items()},
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
