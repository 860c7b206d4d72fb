"""The paper's claims against the stored results."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
import pandas as pd

from infoplan.analyse.commands import Wanted, commands
from infoplan.analyse.curves import EARLY, LATE, collapsed_ends, missions, summarise
from infoplan.analyse.detection import detector_options, rejudge
from infoplan.analyse.judging import Claim, Comparison, Stated, corrected, with_holm
from infoplan.analyse.relief import relief_at
from infoplan.analyse.tables import Selection, load_curves, load_maps, load_samples
from infoplan.collapse import counted_ends

NONE, BEST, UCT, PUCT = "UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"
METHODS = (NONE, BEST, UCT, PUCT)
"""The paper's four methods."""

MARGIN = 0.05
"""What is negligible: of shares five points in a hundred, of elevations and errors this share of
the terrain's standard deviation."""

HIGHER, LOWER = Stated(low=1.0), Stated(high=-1.0)
ALIKE, NOT_LOWER = Stated(-1.0, 1.0), Stated(low=-1.0)
"""Sides that claims state, in margins: an effect that is negligible is none."""

NEARBY = 2.0
"""A sample this near to a flagged one has gone back to it, workspace units."""

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
    "early": f"RMSE over {EARLY[0]}-{EARLY[1]} samples",
    "late": f"RMSE from {LATE} samples on",
    "rise": "final RMSE - its own minimum",
    "precision": "precision",
    "relief_gap": "relief, false alarms - true negatives",
    "spread": "spread of the final mean",
    "std": "mean of the final std",
    "recall_lost": "recall, own batch - all at the end",
    "returned": "share near an earlier flagged sample",
}
"""What the numbers a mission are, in words; docs/replication.md defines them."""

SHARES = ("precision", "recall_lost", "returned")
"""Numbers without a unit."""


def judge_claims(selection: Selection, names: Iterable[str] = TEXTS) -> list[Claim]:
    """Judge the paper's claims by the stored results.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`: the runs compared differ in planner, detector, scope and
        rho alone.
    names
        Which claims; all if not given.

    Returns
    -------
    list of Claim
        In the order of the names, with Holm's correction over all of them.
    """
    measures = Measures(selection)
    claims = []
    for name in names:
        measures.missing.clear()
        measures.asked.clear()
        made = corrected(COMPARISONS[name](measures))
        cures = commands(selection, measures.missing)
        where = WHERE.get(name, "rho 0.1, batch")
        claims.append(Claim(name, TEXTS[name], made, cures, where, measures.collapsed()))
    return with_holm(claims)


@dataclass
class Measures:
    """Numbers a mission, worked out when a comparison asks for them.

    Attributes
    ----------
    selection
        Where they come from.
    missing
        Runs that were asked for and are not there.
    asked
        Runs that were asked for and are there, by method.
    """

    selection: Selection
    missing: list[Wanted] = field(default_factory=list)
    asked: dict[str, str] = field(default_factory=dict)

    @cached_property
    def curves(self) -> pd.DataFrame:
        """The curves of all missions."""
        return load_curves(self.selection)

    @cached_property
    def summaries(self) -> pd.DataFrame:
        """Curves summed up, one row a mission."""
        summaries = summarise(self.curves)
        summaries["rise"] = summaries["final"] - summaries["minimum"]
        return summaries

    @cached_property
    def ends(self) -> dict[tuple[str, int], bool | None]:
        """Whether each mission ends with a collapsed model."""
        return collapsed_ends(self.curves, self.selection.results_dir)

    @cached_property
    def margin(self) -> float:
        """Margin of elevations and errors, the terrain's unit."""
        first = self.selection.missions["run"].iloc[0]
        return MARGIN * float(load_maps(self.selection.only([first]))["truth"].std(ddof=0))

    def collapsed(self) -> dict[str, tuple[int, int]]:
        """How many missions of the runs asked for end collapsed, of how many, by method."""
        return {
            method: counted_ends([end for (name, _), end in self.ends.items() if name == run])
            for method, run in self.asked.items()
        }

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float] | None":
        """One number a seed; None if there is no such run, which is noted."""
        run = self.selection.run(method, rho, scope)
        if run is None:
            self.missing.append((method, rho, scope))
            return None
        self.asked[method] = run
        if name in MEASURES:
            return MEASURES[name](self.selection.only([run]))
        of_run = self.summaries.xs(run, level="run")
        return of_run[name]

    def single(
        self, name: str, method: str, side: Stated, rho: float, scope: str = "batch"
    ) -> Comparison:
        """Compare a number of one method with the bounds stated, which are in margins."""
        effect = self.numbers(name, method, rho, scope)
        return self._comparison(f"{method}: {WORDS[name]}", name, side, effect)

    def pair(
        self, name: str, a: str, b: str, side: Stated, rho: float = 0.1, scope: str = "batch"
    ) -> Comparison:
        """Compare two methods by the difference a - b, paired by seed; the bounds in margins."""
        first, second = self.numbers(name, a, rho, scope), self.numbers(name, b, rho, scope)
        effect = None if first is None or second is None else first - second
        return self._comparison(f"{a} - {b}: {WORDS[name]}", name, side, effect)

    def _comparison(
        self, what: str, name: str, side: Stated, effect: "pd.Series[float] | None"
    ) -> Comparison:
        unit = "" if name in SHARES else self.selection.unit
        stated = side.times(MARGIN if name in SHARES else self.margin)
        known = [] if effect is None else effect.dropna().sort_index().items()
        values = {int(str(seed)): float(value) for seed, value in known}
        lacks = ""
        if effect is None:
            lacks = "a run is missing"
        elif not values:
            lacks = "not reached" if name in ("early", "late") else "no seed has it"
        return Comparison(what, unit, stated, values, lacks=lacks)


def _c1(e: Measures) -> list[Comparison]:
    return [e.pair("final", a, b, ALIKE, 0.05) for a, b in combinations(METHODS, 2)]


def _c2(e: Measures) -> list[Comparison]:
    return [e.pair("final", BEST, other, LOWER) for other in (NONE, UCT, PUCT)]


def _c3(e: Measures) -> list[Comparison]:
    # No final RMSE is below the minimum: how far chance alone lies above it, BEST's shows.
    rises = e.pair("rise", NONE, BEST, HIGHER)
    return [rises, *(e.pair("final", NONE, other, HIGHER) for other in (BEST, UCT, PUCT))]


def _c4(e: Measures) -> list[Comparison]:
    order = ((BEST, PUCT), (PUCT, UCT), (UCT, NONE))
    return [e.pair("late", lower, higher, LOWER) for lower, higher in order]


def _c5(e: Measures) -> list[Comparison]:
    return [e.pair("early", UCT, NONE, HIGHER)]


def _c6(e: Measures) -> list[Comparison]:
    return [
        e.pair("final", UCT, NONE, NOT_LOWER, 0.15),
        e.pair("final", PUCT, UCT, LOWER, 0.15),
        e.pair("final", PUCT, NONE, LOWER, 0.15),
    ]


def _c7(e: Measures) -> list[Comparison]:
    return [e.pair("final", m, NONE, NOT_LOWER, scope="historical") for m in (UCT, PUCT)]


def _c8(e: Measures) -> list[Comparison]:
    # COPOD's contamination fixes how many are flagged: false alarms are the flags that are wrong.
    return [e.pair("precision", PUCT, UCT, HIGHER)]


def _c9(e: Measures) -> list[Comparison]:
    return [e.single("relief_gap", method, HIGHER, 0.1) for method in (UCT, PUCT)]


def _c10(e: Measures) -> list[Comparison]:
    return [e.pair("spread", NONE, BEST, LOWER), e.pair("std", NONE, BEST, HIGHER)]


def _c11(e: Measures) -> list[Comparison]:
    return [e.single("recall_lost", m, HIGHER, 0.1, "historical") for m in (UCT, PUCT)]


def _c12(e: Measures) -> list[Comparison]:
    return [e.pair("returned", PUCT, UCT, HIGHER)]


COMPARISONS: dict[str, Callable[[Measures], list[Comparison]]] = {
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


def relief_gap(run: Selection) -> "pd.Series[float]":
    """Mean local relief at a mission's false alarms less that at its true negatives, by seed.

    Over the samples after the pilot, as judged at the end; NaN without a false alarm.
    """
    maps = dict(missions(load_maps(run)))
    gaps = {}
    for key, samples in missions(load_samples(run)):
        clean = samples[(samples["epoch"] > 0) & ~samples["is_outlier"].astype(bool)]
        relief, flagged = relief_at(clean, maps[key]), clean["flagged"].to_numpy(dtype=bool)
        both = flagged.any() and not flagged.all()
        gaps[key[1]] = relief[flagged].mean() - relief[~flagged].mean() if both else np.nan
    return pd.Series(gaps, dtype=float)


def spread(run: Selection) -> "pd.Series[float]":
    """Take the standard deviation of the final mean over the query grid, by seed."""
    return load_maps(run).groupby("seed")["mean"].std(ddof=0)


def mean_std(run: Selection) -> "pd.Series[float]":
    """Take the mean of the final standard deviation over the query grid, by seed."""
    return load_maps(run).groupby("seed")["std"].mean()


def recall_lost(run: Selection) -> "pd.Series[float]":
    """Recall of each epoch's own batch, pooled, less the recall over everything at the end."""
    options = detector_options(run, run.missions["run"].iloc[0])
    lost = {}
    for (_, seed), samples in missions(load_samples(run)):
        own = rejudge(samples, options)[["own_tp", "own_fn"]].sum()
        spikes = samples[samples["is_outlier"].astype(bool)]
        if len(spikes):
            lost[seed] = own["own_tp"] / own.sum() - spikes["flagged"].mean()
    return pd.Series(lost, dtype=float)


def returned(run: Selection) -> "pd.Series[float]":
    """Share of the samples after the pilot that lie near one flagged in an earlier epoch, by seed.

    Samples of the same epoch do not count: its flags were not known when it was planned.
    """
    shares = {}
    for (_, seed), samples in missions(load_samples(run)):
        planned, flagged = samples[samples["epoch"] > 0], samples[samples["flagged"].astype(bool)]
        x, places = planned[["x1", "x2"]].to_numpy(), flagged[["x1", "x2"]].to_numpy()
        near = np.hypot(*(x[:, None] - places[None]).transpose(2, 0, 1)) <= NEARBY
        earlier = flagged["epoch"].to_numpy()[None] < planned["epoch"].to_numpy()[:, None]
        shares[seed] = (near & earlier).any(axis=1).mean()
    return pd.Series(shares, dtype=float)


MEASURES: dict[str, Callable[[Selection], "pd.Series[float]"]] = {
    "relief_gap": relief_gap,
    "spread": spread,
    "std": mean_std,
    "recall_lost": recall_lost,
    "returned": returned,
}
