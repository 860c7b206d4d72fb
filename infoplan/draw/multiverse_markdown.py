"""The multiverse as tables for documents: claims, levels of choices, what is near the clip."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from infoplan.analyse.multiverse import (
    PAIRS,
    VERDICTS,
    ClaimCurve,
    errors_by_universe,
    errors_jointly,
    nearness,
    orders_by_collapse,
)
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.draw.multiverse_page_data import Moved
from infoplan.draw.multiverse_table import chosen, default_verdict, heading, moved_by
from infoplan.study.universes import CHOICES, METHODS
from infoplan.wording import figure, interval, markdown_cell

RHO = 0.1
"""Share of outliers whose errors are told."""


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
        "Universes in which most missions of UCT-NONE end with a collapsed model, and others: "
        f"median over them of the mean {ends}, and in how many a method ends below or above "
        "another by more than the margin.": _by_collapse(multiverse),
        f"The defaults, and every level alone: mean {ends}; share of collapsed missions, those of "
        "UCT-BEST left out; claims.": _alone(multiverse, curves),
        f"What a level adds to the {ends}, whatever the other choices are, with 95 % intervals: "
        "least squares over all universes.": _jointly(multiverse),
        "The tenth of the universes that comes nearest to the authors' clip: distance, the root "
        "mean square of the logarithm of the ratio of the two RMSE, with its 95 % interval, and "
        f"the run that comes so near; {ends}.": _near(multiverse, curves, nearest),
    }
    return "\n\n".join(f"{told}\n\n{table}" for told, table in tables.items() if table)


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
            default_verdict(curve), f"{near.count(VERDICTS[0])} of {len(near)}",
            f"{curve.what}: {figure(test.median)}{unit}", figure(test.p_median),
            moved_by(moved[curve.name].jointly).replace("*", r"\*"),
        ])  # fmt: skip
    names = ["", "claim", *VERDICTS, "by default", "supported near the clip",
             "binding comparison, median effect", "joint p",
             "variance that only this choice explains"]  # fmt: skip
    return _table(names, rows)


def _by_collapse(multiverse: Multiverse) -> str:
    """Give the universes with a collapsed UCT-NONE a row, and the others."""
    found = orders_by_collapse(multiverse, RHO).dropna()
    rows = [
        ["collapsed" if collapses else "not", f"{row['universes']:.0f}",
         *(figure(row[method]) for method in METHODS),
         *(f"{row[f'{one} < {other}']:.0f} below, {row[f'{one} > {other}']:.0f} above"
           for one, other in PAIRS)]
        for collapses, row in found.iterrows()
    ]  # fmt: skip
    pairs = [f"{one} against {other}" for one, other in PAIRS]
    return _table(["UCT-NONE", "universes", *METHODS, *pairs], rows)


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
    found: Any = errors_jointly(multiverse, RHO)
    concerned = {one.name: one.methods for one in CHOICES}
    rows = []
    for (choice, level), effects in found.groupby(["choice", "level"], sort=False):
        of = effects.set_index("column")
        # What a choice cannot change has no effect but that of universes that happen to have it.
        told = [interval(*of.loc[method, ["mean", "low", "high"]]) if method in concerned[choice]
                else "" for method in METHODS]  # fmt: skip
        share = 100.0 * of.loc["collapsed", ["mean", "low", "high"]]
        rows.append([choice, level, *told, f"{interval(*share)} %"])
    return _table(["choice", "level", *METHODS, "collapsed"], rows)


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
