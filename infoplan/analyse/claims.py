"""The paper's claims against the stored results."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
import pandas as pd

from infoplan.analyse.commands import Wanted, commands
from infoplan.analyse.curves import EARLY, LATE, missions, summarise
from infoplan.analyse.detection import detector_options, rejudge
from infoplan.analyse.judging import ABOVE_ZERO, BELOW_ZERO, Claim, Comparison, Stated
from infoplan.analyse.relief import relief_at
from infoplan.analyse.statistics import Interval, bootstrap_mean, interquartile_mean
from infoplan.analyse.tables import Selection, load_curves, load_maps, load_samples

NONE, BEST, UCT, PUCT = "UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"
METHODS = (NONE, BEST, UCT, PUCT)
"""The paper's four methods."""

MARGIN = 0.05
"""What is negligible: this share of the terrain's standard deviation."""

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
    "fp": "false alarms",
    "false_alarm_rate": "false-alarm rate",
    "relief_gap": "relief, false alarms - true negatives",
    "spread": "spread of the final mean",
    "std": "mean of the final std",
    "recall_lost": "recall, own batch - all at the end",
    "returned": "share near an earlier flagged sample",
}
"""What the numbers a mission are, in words; docs/replication.md defines them."""

WITHOUT_UNIT = ("fp", "false_alarm_rate", "recall_lost", "returned")


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
        In the order of the names. The margin m is 5 % of the standard deviation of the terrain on
        the query grid.
    """
    measures = Measures(selection)
    claims = []
    for name in names:
        measures.missing.clear()
        made = tuple(COMPARISONS[name](measures))
        cures = commands(selection, measures.missing)
        claims.append(Claim(name, TEXTS[name], made, cures, WHERE.get(name, "rho 0.1, batch")))
    return claims


@dataclass
class Measures:
    """Numbers a mission, worked out when a comparison asks for them.

    Attributes
    ----------
    selection
        Where they come from.
    missing
        Runs that were asked for and are not there.
    """

    selection: Selection
    missing: list[Wanted] = field(default_factory=list)

    @cached_property
    def summaries(self) -> pd.DataFrame:
        """Curves summed up, one row a mission."""
        summaries = summarise(load_curves(self.selection))
        summaries["rise"] = summaries["final"] - summaries["minimum"]
        return summaries

    @cached_property
    def margin(self) -> float:
        """Margin m of what is negligible, the terrain's unit."""
        first = self.selection.missions["run"].iloc[0]
        return MARGIN * float(load_maps(self.selection.only([first]))["truth"].std(ddof=0))

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float] | None":
        """One number a seed; None if there is no such run, which is noted."""
        run = self.selection.run(method, rho, scope)
        if run is None:
            self.missing.append((method, rho, scope))
            return None
        if name in MEASURES:
            return MEASURES[name](self.selection.only([run]))
        of_run = self.summaries.xs(run, level="run")
        return of_run[name]

    def single(
        self, name: str, method: str, stated: Stated, rho: float, scope: str = "batch"
    ) -> Comparison:
        """Compare a number of one method with the bounds stated."""
        effect = self.numbers(name, method, rho, scope)
        return self._comparison(f"{method}: {WORDS[name]}", name, stated, effect)

    def pair(
        self,
        name: str,
        a: str,
        b: str,
        stated: Stated,
        rho: float = 0.1,
        scope: str = "batch",
        share: float = 1.0,
    ) -> Comparison:
        """Compare two methods by the difference a - share b, paired by seed."""
        first, second = self.numbers(name, a, rho, scope), self.numbers(name, b, rho, scope)
        effect = None if first is None or second is None else first - share * second
        minus = "" if share == 1.0 else f"{share:g} x "
        what = f"{a} - {minus}{b}: {WORDS[name]}"
        return self._comparison(what, name, stated, effect)

    def _comparison(
        self, what: str, name: str, stated: Stated, effect: "pd.Series[float] | None"
    ) -> Comparison:
        unit = "" if name in WITHOUT_UNIT else self.selection.unit
        if effect is None:
            lacks = "a run is missing"
        elif effect.dropna().empty:
            lacks = "not reached" if name in ("early", "late") else "no seed has it"
        else:
            values = effect.dropna().astype(float)
            middle = float(interquartile_mean(values))
            return Comparison(what, unit, stated, bootstrap_mean(values), middle)
        return Comparison(what, unit, stated, Interval(np.nan, np.nan, np.nan, 0), lacks=lacks)


def _c1(e: Measures) -> list[Comparison]:
    negligible = Stated(-e.margin, e.margin)
    return [e.pair("final", a, b, negligible, 0.05) for a, b in combinations(METHODS, 2)]


def _c2(e: Measures) -> list[Comparison]:
    return [e.pair("final", BEST, other, BELOW_ZERO) for other in (NONE, UCT, PUCT)]


def _c3(e: Measures) -> list[Comparison]:
    rises = e.single("rise", NONE, Stated(low=e.margin), 0.1)
    return [rises, *(e.pair("final", NONE, other, ABOVE_ZERO) for other in (BEST, UCT, PUCT))]


def _c4(e: Measures) -> list[Comparison]:
    order = ((BEST, PUCT), (PUCT, UCT), (UCT, NONE))
    return [e.pair("late", lower, higher, BELOW_ZERO) for lower, higher in order]


def _c5(e: Measures) -> list[Comparison]:
    return [e.pair("early", UCT, NONE, ABOVE_ZERO)]


def _c6(e: Measures) -> list[Comparison]:
    return [
        e.pair("final", UCT, NONE, Stated(low=-e.margin), 0.15),
        e.pair("final", PUCT, UCT, BELOW_ZERO, 0.15),
        e.pair("final", PUCT, NONE, BELOW_ZERO, 0.15),
    ]


def _c7(e: Measures) -> list[Comparison]:
    return [
        e.pair("final", method, NONE, ABOVE_ZERO, scope="historical", share=0.9)
        for method in (UCT, PUCT)
    ]


def _c8(e: Measures) -> list[Comparison]:
    return [e.pair(name, PUCT, UCT, BELOW_ZERO) for name in ("fp", "false_alarm_rate")]


def _c9(e: Measures) -> list[Comparison]:
    return [e.single("relief_gap", method, ABOVE_ZERO, 0.1) for method in (UCT, PUCT)]


def _c10(e: Measures) -> list[Comparison]:
    return [e.pair("spread", NONE, BEST, BELOW_ZERO), e.pair("std", NONE, BEST, ABOVE_ZERO)]


def _c11(e: Measures) -> list[Comparison]:
    methods = (UCT, PUCT)
    return [e.single("recall_lost", method, ABOVE_ZERO, 0.1, "historical") for method in methods]


def _c12(e: Measures) -> list[Comparison]:
    return [e.pair("returned", PUCT, UCT, ABOVE_ZERO)]


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
