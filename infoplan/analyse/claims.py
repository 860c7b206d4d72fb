"""The paper's claims against the stored results."""

from collections.abc import Callable, Iterable
from itertools import combinations
from typing import Protocol

import pandas as pd

from infoplan.analyse.commands import commands
from infoplan.analyse.curves import LATE
from infoplan.analyse.judging import (
    USUAL,
    Claim,
    Claims,
    Comparison,
    Rules,
    Stated,
    corrected,
    with_holm,
)
from infoplan.analyse.measures import Measures
from infoplan.analyse.tables import Selection

NONE, BEST, UCT, PUCT = "UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"
METHODS = (NONE, BEST, UCT, PUCT)
"""The paper's four methods."""

HIGHER, LOWER = Stated(low=1.0), Stated(high=-1.0)
ALIKE, NOT_LOWER = Stated(-1.0, 1.0), Stated(low=-1.0)
"""Sides that claims state, in margins: an effect that is negligible is none."""

TEXTS = {
    "C1": "rho 0.05: all methods differ negligibly",
    "C2": "rho 0.10: UCT-BEST ends lowest",
    "C3": "rho 0.10: UCT-NONE falls, then rises, and ends highest",
    "C4": "rho 0.10: both COPOD methods lie between BEST and NONE, PUCT the lower",
    "C5": "rho 0.10: UCT-COPOD starts worse than UCT-NONE",
    "C6": "rho 0.15: UCT-COPOD loses its advantage over NONE, PUCT-COPOD keeps it",
    "C7": "historical scope: neither COPOD method is effective",
    "C8": "PUCT-COPOD raises fewer false alarms",
    "C9": "false alarms fall where the terrain varies",
    "C10": "unfiltered outliers flatten the mean and blur the uncertainty",
    "C11": "spikes are caught at once, and lost on re-examination",
    "C12": "PUCT does go back to flagged places",
}

WHERE = {
    "C1": "rho 0.05, batch",
    "C6": "rho 0.15, batch",
    "C7": "rho 0.1, historical",
    "C11": "rho 0.1, historical",
}
"""Runs that a claim compares; the others: rho 0.1, batch."""

WORDS = {
    "final": "final RMSE",
    "early": "RMSE over {}-{} samples",
    "late": f"RMSE from {LATE} samples on",
    "rise": "final RMSE - its own minimum",
    "precision": "precision",
    "relief_gap": "relief, false alarms - true negatives",
    "spread": "spread of the final mean",
    "std": "mean of the final std",
    "recall_lost": "recall, own batch - all at the end",
    "returned": "share near an earlier flagged sample",
}
"""What the numbers a mission are, in words; docs/replication.md defines them. Early samples are
those of the rules."""

SHARES = ("precision", "recall_lost", "returned")
"""Numbers without a unit."""


def judge_claims(
    selection: Selection, names: Iterable[str] = TEXTS, rules: Rules = USUAL
) -> Claims:
    """Judge the paper's claims by the stored results.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`: the runs compared differ in planner, detector, scope and
        rho alone.
    names
        Which claims; all if not given.
    rules
        What is negligible, and what is early.

    Returns
    -------
    Claims
        A list of `Claim` in the order of the names, with Holm's correction over all of them.
    """
    measures = Measures(selection, rules)
    claims = []
    for name in names:
        measures.missing.clear()
        measures.asked.clear()
        made = corrected(COMPARISONS[name](measures))
        cures = commands(selection, measures.missing)
        where = WHERE.get(name, "rho 0.1, batch")
        claims.append(Claim(name, TEXTS[name], made, cures, where, measures.collapsed()))
    return Claims(with_holm(claims))


class Numbers(Protocol):
    """Where the numbers that claims compare come from."""

    @property
    def unit(self) -> str:
        """Unit of elevations and errors."""

    @property
    def rules(self) -> Rules:
        """What is negligible of shares, and what is early."""

    @property
    def margin(self) -> float:
        """What is negligible of elevations and errors, in that unit."""

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float] | None":
        """Give one number a seed, of `WORDS`; None if there is no such run."""


def single(
    e: Numbers, name: str, method: str, side: Stated, rho: float, scope: str = "batch"
) -> Comparison:
    """Compare a number of one method with the bounds stated, which are in margins."""
    effect = e.numbers(name, method, rho, scope)
    return _comparison(e, f"{method}: {words(name, e.rules)}", name, side, effect)


def pair(
    e: Numbers,
    name: str,
    a: str,
    b: str,
    side: Stated,
    rho: float = 0.1,
    scope: str = "batch",
) -> Comparison:
    """Compare two methods by the difference a - b, paired by seed; the bounds in margins."""
    first, second = e.numbers(name, a, rho, scope), e.numbers(name, b, rho, scope)
    effect = None if first is None or second is None else first - second
    return _comparison(e, f"{a} - {b}: {words(name, e.rules)}", name, side, effect)


def words(name: str, rules: Rules) -> str:
    """Say what a number a mission is."""
    return WORDS[name].format(*rules.early) if name == "early" else WORDS[name]


def _comparison(
    e: Numbers, what: str, name: str, side: Stated, effect: "pd.Series[float] | None"
) -> Comparison:
    unit = "" if name in SHARES else e.unit
    stated = side.times(e.rules.margin if name in SHARES else e.margin)
    known = [] if effect is None else effect.dropna().sort_index().items()
    values = {int(str(seed)): float(value) for seed, value in known}
    above = {"early": e.rules.early[0], "late": LATE}.get(name, 0)
    lacks = ""
    if effect is None:
        lacks = "a run is missing"
    elif not values:
        lacks = "not reached" if above else "no seed has it"
    return Comparison(what, unit, stated, values, lacks=lacks, above=above)


def _c1(e: Numbers) -> list[Comparison]:
    return [pair(e, "final", a, b, ALIKE, 0.05) for a, b in combinations(METHODS, 2)]


def _c2(e: Numbers) -> list[Comparison]:
    return [pair(e, "final", BEST, other, LOWER) for other in (NONE, UCT, PUCT)]


def _c3(e: Numbers) -> list[Comparison]:
    # No final RMSE is below the minimum: how far chance alone lies above it, BEST's shows.
    rises = pair(e, "rise", NONE, BEST, HIGHER)
    return [rises, *(pair(e, "final", NONE, other, HIGHER) for other in (BEST, UCT, PUCT))]


def _c4(e: Numbers) -> list[Comparison]:
    order = ((BEST, PUCT), (PUCT, UCT), (UCT, NONE))
    return [pair(e, "late", lower, higher, LOWER) for lower, higher in order]


def _c5(e: Numbers) -> list[Comparison]:
    return [pair(e, "early", UCT, NONE, HIGHER)]


def _c6(e: Numbers) -> list[Comparison]:
    return [
        pair(e, "final", UCT, NONE, NOT_LOWER, 0.15),
        pair(e, "final", PUCT, UCT, LOWER, 0.15),
        pair(e, "final", PUCT, NONE, LOWER, 0.15),
    ]


def _c7(e: Numbers) -> list[Comparison]:
    return [pair(e, "final", m, NONE, NOT_LOWER, scope="historical") for m in (UCT, PUCT)]


def _c8(e: Numbers) -> list[Comparison]:
    # COPOD's contamination fixes how many are flagged: false alarms are the flags that are wrong.
    return [pair(e, "precision", PUCT, UCT, HIGHER)]


def _c9(e: Numbers) -> list[Comparison]:
    return [single(e, "relief_gap", method, HIGHER, 0.1) for method in (UCT, PUCT)]


def _c10(e: Numbers) -> list[Comparison]:
    return [pair(e, "spread", NONE, BEST, LOWER), pair(e, "std", NONE, BEST, HIGHER)]


def _c11(e: Numbers) -> list[Comparison]:
    return [single(e, "recall_lost", m, HIGHER, 0.1, "historical") for m in (UCT, PUCT)]


def _c12(e: Numbers) -> list[Comparison]:
    return [pair(e, "returned", PUCT, UCT, HIGHER)]


COMPARISONS: dict[str, Callable[[Numbers], list[Comparison]]] = {
    "C1": _c1,
    "C2": _c2,
    "C3": _c3,
    "C4": _c4,
    "C5": _c5,
    "C6": _c6,
    "C7": _c7,
    "C8": _c8,
    "C9": _c9,
    "C10": _c10,
    "C11": _c11,
    "C12": _c12,
}
