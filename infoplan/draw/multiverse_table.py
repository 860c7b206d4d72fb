"""The multiverse in words: claims over all universes, what moves them, and single universes."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from rich.console import Console
from rich.text import Text

from infoplan.analyse.claims import COMPARISONS, TEXTS
from infoplan.analyse.judging import FEW_SEEDS, SEEDS_NEEDED, Claim, corrected
from infoplan.analyse.multiverse import VERDICTS, ClaimCurve, JointTest, why_unjudged
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.draw.claims_table import effect
from infoplan.draw.console import say, say_command
from infoplan.draw.table_layout import Cell, TextColumn, print_table
from infoplan.palette import TERMINAL
from infoplan.study.universes import CHOICES, DEFAULT, Universe
from infoplan.wording import counted, figure, interval

FEW = 0.02
"""A choice that explains less of a claim's variance is not named."""


def print_multiverse(
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    tests: Sequence[JointTest],
    nearest: Sequence[str],
    moves: dict[str, pd.DataFrame],
    console: Console,
) -> None:
    """Print how each claim fares over all universes, and which choices move it."""
    columns = [
        TextColumn("claim"),
        TextColumn("median effect", right=True),
        TextColumn("supported", right=True),
        TextColumn("contradicted", right=True),
        TextColumn("by default"),
        *([TextColumn("near the clip", right=True, spare=1)] if nearest else []),
        TextColumn("joint p", right=True, spare=2),
    ]
    rows: list[list[Cell] | None] = [
        [Text(curve.name, style="bold"), *_fate(curve, test, nearest)]
        for curve, test in zip(curves, tests, strict=True)
    ]
    print_table(console, heading(multiverse), columns, rows, named=1)
    for curve in curves:
        told = moved_by(moves.get(curve.name)) or "nothing that stands out"
        say(console, f"{curve.name} {curve.text}. {curve.what}; moved by {told}", indent="    ")
    for line in remarks(multiverse, curves):
        say(console, line, indent="    ")
    near = (
        f"near the clip: supported in so many of the {counted(len(nearest), 'universe')} nearest "
        "to the authors' clip; " if nearest else ""
    )  # fmt: skip
    say(console, "effect: of the comparison that binds, named above; moved by: the part of the "
                 "variance over joint universes that only this choice explains, with * where p is "
                 f"below 0.05 after Holm's correction over choices; {near}joint p: that the "
                 "effect's median over universes is chance, by sign flips of the "
                 "seeds")  # fmt: skip


def remarks(multiverse: Multiverse, curves: Sequence[ClaimCurve]) -> list[str]:
    """Say which claims are not judged, and why, and whether there are too few seeds."""
    judged = {curve.name for curve in curves}
    without = [
        f"{name} {text}: not judged, {why_unjudged(name, multiverse)}"
        for name, text in TEXTS.items() if name not in judged
    ]  # fmt: skip
    return [*without, *few_seeds(multiverse)]


def few_seeds(multiverse: Multiverse) -> list[str]:
    """Say so where some runs have too few seeds for a verdict."""
    return [FEW_SEEDS] if min(multiverse.seeds_of_runs) < SEEDS_NEEDED else []


def print_claim(
    multiverse: Multiverse,
    curve: ClaimCurve,
    alone: pd.DataFrame,
    jointly: pd.DataFrame,
    pairs: pd.DataFrame,
    rules: pd.DataFrame,
    test: JointTest,
    console: Console,
) -> None:
    """Print how much every level moves the effect that binds a claim, alone and jointly."""
    unit = f", {curve.unit}" if curve.unit else ""
    say(console, f"{curve.name} {curve.text}: {curve.what}{unit}", style="bold")
    columns = [
        TextColumn("choice"),
        TextColumn("level"),
        TextColumn("alone [95 %]", right=True),
        TextColumn("verdict"),
        TextColumn("jointly [95 %]", right=True),
        TextColumn("share", right=True, spare=2),
        TextColumn("p", right=True, spare=1),
    ]
    rows: list[list[Cell] | None] = []
    singly, together = (
        {(row["choice"], row["level"]): row for row in table.to_dict("records")}
        for table in (alone, jointly)
    )
    for choice in CHOICES:
        for level in choice.levels:
            one, other = singly.get((choice.name, level)), together.get((choice.name, level))
            if one or other:
                verdict = str(one["verdict"]) if one else ""
                rows.append([
                    choice.name, level, _moved(one), Text(verdict, style=TERMINAL.get(verdict, "")),
                    _moved(other), f"{100 * other['share']:.0f} %" if other else "",
                    figure(other["p"]) if other else "",
                ])  # fmt: skip
    for row in rules.to_dict("records"):
        verdict = str(row["verdict"])
        rows.append([
            row["choice"], row["level"], _moved(row) if verdict else "",
            Text(verdict, style=TERMINAL.get(verdict, "")), "", "", "",
        ])  # fmt: skip
    print_table(console, heading(multiverse), columns, rows, named=2)
    for row in rules.to_dict("records"):
        told = ", ".join(f"{row[one]} {one}" for one in VERDICTS)
        say(console, f"{row['choice']} {row['level']}, all universes: {told}", indent="    ")
    if test.flips:
        say(console, _all_at_once(test, curve.unit), indent="    ")
    for pair in pairs.to_dict("records"):
        named = f"{pair['first']} x {pair['second']}: {100 * pair['share']:.0f} % more"
        told = f"{named}, p {figure(pair['p'])}; {pair['levels']}: {_moved(pair)}"
        say(console, told, indent="    ")
    for line in few_seeds(multiverse):
        say(console, line)
    say(console, "alone: against the defaults, paired by seed; jointly: whatever the other choices "
                 "are, by least squares over the joint universes; share: of the variance over "
                 "these that only this choice explains, p of its surest level, corrected; pairs: "
                 "what both together do beyond both alone; margin and early samples are no "
                 "missions' choices: the claim is judged anew in all universes")  # fmt: skip


def _all_at_once(test: JointTest, unit: str) -> str:
    """Say what the joint test of a claim finds."""
    return (
        f"over all universes at once, by {test.flips} sign flips of the seeds: median effect "
        f"{figure(test.median)}{f' {unit}' if unit else ''}, p {figure(test.p_median)}; "
        f"mean t {figure(test.mean_t)}, p {figure(test.p_mean_t)}; {100 * test.one_side:.0f} % of "
        "the universes on one side of zero"
    )


def _moved(effect: Mapping[Any, Any] | None) -> str:
    return interval(effect["mean"], effect["low"], effect["high"]) if effect else ""


def print_universe(
    multiverse: Multiverse, universe: Universe, commands: Sequence[str], console: Console
) -> None:
    """Print one universe: what it chooses, the claims in it, and how to fly it again."""
    say(console, f"universe {universe.name}: {chosen(universe)}")
    columns = [
        TextColumn("claim"),
        TextColumn("compared"),
        TextColumn("effect [95 %]", right=True),
        TextColumn("verdict"),
    ]
    rows: list[list[Cell] | None] = []
    numbers = multiverse.numbers[universe.name]
    for name, text in TEXTS.items():
        made = corrected(COMPARISONS[name](numbers))
        claim = Claim(name, text, made)
        verdict = Text(claim.verdict.upper(), style=TERMINAL[claim.verdict])
        rows.append([Text(name, style="bold"), Text(text, style="bold"), "", verdict])
        rows += [["", item.what, effect(item), item.verdict] for item in made]
        rows.append(None)
    print_table(console, heading(multiverse), columns, rows, named=2)
    for line in few_seeds(multiverse):
        say(console, line)
    for command in commands:
        say_command(console, "fly it again:", command)


def print_unflown(universe: Universe, why: str, commands: Sequence[str], console: Console) -> None:
    """Print what a universe chooses of which there are no numbers, and how to fly it."""
    say(console, f"universe {universe.name}: {chosen(universe)}")
    say(console, f"no numbers: {why}")
    for command in commands:
        say_command(console, "fly it:", command)


def chosen(universe: Universe) -> str:
    """Say what a universe chooses other than the defaults."""
    changed = [
        f"{choice} {universe.levels[choice]}{' (without use)' if choice in universe.idle else ''}"
        for choice in universe.changed
    ]
    return ", ".join(changed) or "all defaults"


def heading(multiverse: Multiverse) -> str:
    """Say what was flown."""
    least, most = min(multiverse.seeds_of_runs), max(multiverse.seeds_of_runs)
    seeds = counted(most, "seed") if least == most else f"{least} to {most} seeds"
    return (
        f"{multiverse.terrain}, budget {multiverse.budget}, model={multiverse.model}, "
        f"{counted(len(multiverse.universes), 'universe')}, {seeds}"
    )


def default_verdict(curve: ClaimCurve) -> str:
    """Verdict in the default universe; a stroke if that was not flown."""
    return curve.verdict_in(DEFAULT) or "-"


def _fate(curve: ClaimCurve, test: JointTest, nearest: Sequence[str]) -> list[Cell]:
    verdict = default_verdict(curve)
    near = [curve.verdict_in(name) for name in nearest].count("supported")
    unit = f" {curve.unit}" if curve.unit else ""
    return [
        f"{figure(test.median)}{unit}",
        str(curve.verdicts.count("supported")),
        str(curve.verdicts.count("contradicted")),
        Text(verdict, style=TERMINAL.get(verdict, "")),
        *([str(near)] if nearest else []),
        figure(test.p_median),
    ]


def moved_by(effects: pd.DataFrame | None) -> str:
    """Name the choices that explain most of a claim's variance."""
    if effects is None or effects.empty:
        return ""
    once = effects.drop_duplicates("choice").sort_values("share", ascending=False)
    named = once[once["share"] >= FEW].head(4)
    sure = named["p"].le(0.05).map({True: "*", False: ""})
    told = named["choice"] + " " + (100 * named["share"]).map("{:.0f} %".format) + sure
    return ", ".join(told)
