"""The multiverse as tables for documents: claims, levels of choices, what is near the clip."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from infoplan.analyse.multiverse import (
    PAIRS,
    RULES,
    VERDICTS,
    ClaimCurve,
    compare_models,
    errors_by_universe,
    errors_jointly,
    nearness,
    orders_by_collapse,
)
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.draw.multiverse_page_data import Moved
from infoplan.draw.multiverse_table import chosen, default_verdict, heading, moved_by, remarks
from infoplan.study.universes import CHOICES, METHODS
from infoplan.wording import figure, interval, markdown_cell

RHO = 0.1
"""Share of outliers whose errors are told."""

STANDS = 0.05
"""P up to which a pair of choices is told."""


def markdown(
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    moved: Mapping[str, Moved],
    nearest: Sequence[str],
) -> str:
    """Write how claims fare, what every level does, and which universes are near the clip."""
    unit = markdown_cell(multiverse.unit)
    ends = f"final RMSE at rho {RHO:g}, {unit}"
    tables = {
        f"{markdown_cell(heading(multiverse))}: in how many universes a claim is supported, and "
        "what moves the comparison that binds. \\* is p below 0.05 after Holm's correction over "
        "choices.": _claims(curves, moved, nearest),
        "Universes in which most missions of UCT-NONE end with a collapsed model, and others, in "
        "which at most one choice or all choices vary: median over them of the mean final RMSE, "
        f"{unit}, and in how many a method ends below or above another by more than the "
        "margin.": _by_collapse(multiverse),
        f"The defaults, and every level alone: mean {ends}; share of collapsed missions, those of "
        "UCT-BEST left out; claims.": _alone(multiverse, curves),
        f"What a level adds to the {ends}, whatever the other choices are, with 95 % intervals: "
        "least squares over the joint universes.": _jointly(multiverse),
        "The claims by other readings of what is negligible and early, which no mission depends "
        f"on: in how many universes they are {', '.join(VERDICTS)}.": _by_rules(moved),
        "Pairs of choices that do to a claim's comparison what neither does alone, of the five "
        "choices that explain most, p by Holm: part of the variance beyond the main effects, and "
        "the combination that it moves most.": _pairs(moved),
        "The tenth of the universes that comes nearest to the authors' clip: distance, the root "
        "mean square of the logarithm of the ratio of the two RMSE, with its 95 % interval, and "
        f"the run that comes so near; {ends}.": _near(multiverse, curves, nearest),
    }
    written = [f"{told}\n\n{table}" for told, table in tables.items() if table]
    told = [f"{markdown_cell(line)}  " for line in remarks(multiverse, curves)]
    return "\n\n".join([*written, *(["\n".join(told)] if told else [])])


def control(first: Multiverse, second: Multiverse) -> str:
    """Write how methods end in universes flown with a second model, and what the first gives more.

    Parameters
    ----------
    first, second
        The same universes, with two models.
    """
    rows: dict[str, dict[str, str]] = {}
    for row in compare_models(first, second, RHO).to_dict("records"):
        more = interval(row["mean"], row["low"], row["high"])
        told = f"{figure(row['end'])}; {'+' if row['mean'] > 0 else ''}{more}"
        rows.setdefault(row["universe"], {})[row["method"]] = told
    return _table(
        ["universe", *METHODS],
        [[name, *(of.get(method, "") for method in METHODS)] for name, of in rows.items()],
    )


def _claims(
    curves: Sequence[ClaimCurve], moved: Mapping[str, Moved], nearest: Sequence[str]
) -> str:
    """Give each claim a row: its verdicts over all universes, near the clip, and what moves it."""
    rows = []
    for curve in curves:
        near = list(filter(None, map(curve.verdict_in, nearest)))
        test = moved[curve.name].test
        unit = f" {curve.unit}" if curve.unit else ""
        rows.append([
            curve.name, curve.text, *(str(curve.verdicts.count(one)) for one in VERDICTS),
            default_verdict(curve),
            *([f"{near.count(VERDICTS[0])} of {len(near)}"] if nearest else []),
            f"{curve.what}: {figure(test.median)}{unit}", figure(test.p_median),
            moved_by(moved[curve.name].jointly).replace("*", r"\*"),
        ])  # fmt: skip
    names = ["", "claim", *VERDICTS, "by default",
             *(["supported near the clip"] if nearest else []),
             "binding comparison, median effect", "joint p",
             "variance over joint universes that only this choice explains"]  # fmt: skip
    return _table(names, rows)


def _by_collapse(multiverse: Multiverse) -> str:
    """Give each kind of universes a row for each rho: how many, errors, and orders of methods."""
    rows = [
        [f"{rho:g}", str(kind), f"{row['universes']:.0f}",
         *(figure(row[method]) for method in METHODS),
         *(f"{row[f'{one} < {other}']:.0f} below, {row[f'{one} > {other}']:.0f} above"
           for one, other in PAIRS)]
        for rho in sorted(multiverse.missions["rho"].unique())
        for kind, row in orders_by_collapse(multiverse, rho).dropna().iterrows()
    ]  # fmt: skip
    pairs = [f"{one} against {other}" for one, other in PAIRS]
    return _table(["rho", "models", "universes", *METHODS, *pairs], rows)


def _alone(multiverse: Multiverse, curves: Sequence[ClaimCurve]) -> str:
    """Give the defaults and every level alone a row: errors, and the claims' verdicts."""
    ends: Any = errors_by_universe(multiverse, RHO)
    rows = [
        [universe.name, *_ends(ends.loc[universe.name]),
         *(_with_verdict(one, universe.name, curves) for one in VERDICTS[:2])]
        for universe in multiverse.universes if len(universe.changed) <= 1
    ]  # fmt: skip
    return _table(["universe", *METHODS, "collapsed", *VERDICTS[:2]], rows)


def _jointly(multiverse: Multiverse) -> str:
    """Give each level a row: what it adds to each method's error, whatever the others are."""
    told = {
        (row["choice"], row["level"], row["method"]): interval(row["mean"], row["low"], row["high"])
        for row in errors_jointly(multiverse, RHO).to_dict("records")
    }
    levels = [(choice.name, level) for choice in CHOICES for level in choice.levels]
    rows = [[*level, *(told.get((*level, method), "") for method in METHODS)] for level in levels]
    return _table(["choice", "level", *METHODS], [row for row in rows if any(row[2:])])


def _by_rules(moved: Mapping[str, Moved]) -> str:
    """Give each claim a row: its verdicts under each rule that needs no mission."""
    others = [(choice, level) for choice, levels in RULES.items() for level in list(levels)[1:]]
    usual = ("margin", next(iter(RULES["margin"])))
    rows = []
    for name, found in moved.items():
        of = {(rule["choice"], rule["level"]): rule for rule in found.rules.to_dict("records")}
        told = [of.get(one) for one in (usual, *others)]
        rows.append([name, *(", ".join(str(rule[one]) for one in VERDICTS) if rule else ""
                             for rule in told)])  # fmt: skip
    usually = ", ".join(f"{choice} {next(iter(levels))}" for choice, levels in RULES.items())
    return _table(["", usually, *(f"{choice} {level}" for choice, level in others)], rows)


def _pairs(moved: Mapping[str, Moved]) -> str:
    """Give each pair of choices that stands a row: which combination does what."""
    rows = [
        [name, f"{pair['first']} and {pair['second']}", f"{100 * pair['share']:.0f} %",
         figure(pair["p"]), pair["levels"], interval(pair["mean"], pair["low"], pair["high"])]
        for name, found in moved.items()
        for pair in found.pairs.to_dict("records") if pair["p"] <= STANDS
    ]  # fmt: skip
    return _table(["", "pair", "share", "p", "combination", "does beyond both alone"], rows)


def _near(multiverse: Multiverse, curves: Sequence[ClaimCurve], nearest: Sequence[str]) -> str:
    """Give each universe near the clip a row: which run comes so near, and its claims."""
    ends: Any = errors_by_universe(multiverse, RHO)
    far: Any = nearness(multiverse).set_index("universe")
    there = {one.name: one for one in multiverse.universes}
    rows = []
    for name in nearest:
        one = far.loc[name]
        rows.append([
            name, interval(one["mean"], one["low"], one["high"]),
            f"{one['method']}, rho {one['rho']:g}", *_ends(ends.loc[name]),
            _with_verdict(VERDICTS[0], name, curves), chosen(there[name]),
        ])  # fmt: skip
    names = ["universe", "distance", "by", *METHODS, "collapsed", VERDICTS[0], "chooses"]
    return _table(names, rows)


def _with_verdict(verdict: str, universe: str, curves: Sequence[ClaimCurve]) -> str:
    return " ".join(curve.name for curve in curves if curve.verdict_in(universe) == verdict)


def _ends(row: "pd.Series[float]") -> list[str]:
    return [*(figure(row[method]) for method in METHODS), f"{100 * row['collapsed']:.0f} %"]


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in (names, *rows)]
    return "\n".join([lines[0], f"|{'---|' * len(names)}", *lines[1:]]) if rows else ""
