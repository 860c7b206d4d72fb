"""Which method stands which sensor fault, on the maps that were flown."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from infoplan.analyse.mission_scores import Condition
from infoplan.analyse.statistics import stratified_mean
from infoplan.config import METHODS
from infoplan.options import plain_number

NO_FAULT = "none"
"""What rho 0 is called, whatever the fault."""

Strata = list["pd.Series[float]"]
"""Mean area over rhos by seed, one of each map."""


@dataclass(frozen=True)
class FaultTable:
    """Methods and faults: a cell for each pair that was flown on all maps and at all rhos.

    Attributes
    ----------
    cells
        One row a cell: ``method``, ``fault``, ``reference`` (given the true labels, and therefore
        no contestant); ``mean``, the normalised area over rhos, seeds and maps, with ``low`` and
        ``high``, its 95 % interval over seeds of these maps; ``n``, its seeds of all maps together,
        and how many of them have errors that are not finite (``lost``): then there is no mean.
        ``behind`` is how far the mean lies behind the best contestant's of its fault, paired by map
        and seed, and ``behind_at_least`` a lower bound of it: all bounds of a fault hold together
        with 95 %. ``among_best``: a contestant whose bound is not above 0, or that has none.
    methods
        References, then contestants, by their mean rank under the faults.
    faults
        None (rho 0) first, then in the order of the documents.
    maps, rhos
        That count; the rhos without 0.
    seeds
        Fewest and most seeds of a cell on a map.
    notes
        What was left out, and why: sentences for the reader.
    """

    cells: pd.DataFrame
    methods: tuple[str, ...]
    faults: tuple[str, ...]
    maps: tuple[str, ...]
    rhos: tuple[float, ...]
    seeds: tuple[int, int]
    notes: tuple[str, ...]

    @property
    def references(self) -> list[str]:
        """Methods that are given the true labels."""
        marked = set(self.cells.loc[self.cells["reference"], "method"])
        return [method for method in self.methods if method in marked]

    def grid(self, column: str) -> pd.DataFrame:
        """Lay out a column of the cells, methods x faults; NaN where there is no cell."""
        laid_out = self.cells.pivot(index="method", columns="fault", values=column)
        return laid_out.reindex(index=list(self.methods), columns=list(self.faults))


def by_fault(scores: pd.DataFrame) -> FaultTable:
    """Sum up the scores of missions by method and fault.

    Parameters
    ----------
    scores
        As of `infoplan.analyse.mission_scores.MissionScores`.

    Returns
    -------
    FaultTable
        A map and rho count for a fault if more than half of the methods under it have them; a
        method that lacks one has no cell. A cell stands on the seeds that its method has at all
        rhos; two are compared on those that both have.
    """
    table = scores.assign(fault=scores["fault"].where(scores["rho"] > 0, NO_FAULT))
    # At rho 0 there is no fault: missions under any are the same.
    table = table.drop_duplicates(["method", "fault", "rho", "terrain", "seed"])
    references = set(table.loc[table["reference"], "method"])
    rows: list[dict[str, Any]] = []
    notes: list[str] = []
    counting: dict[str, list[Condition]] = {}
    for fault in sorted(set(table["fault"]), key=_place):
        here = table[table["fault"] == fault]
        counting[fault] = _counting(here)
        notes += [
            f"{_told(one)} does not count: most methods lack it"
            for one in sorted(_conditions(here) - set(counting[fault]))
        ]
        rows += _compared(fault, _strata(here, counting[fault]), references)
    cells = pd.DataFrame(rows, columns=CELL_COLUMNS)
    faults = tuple(fault for fault in counting if fault in set(cells["fault"]))
    notes += _uneven({fault: counting[fault] for fault in faults if fault != NO_FAULT})
    kept = [one for fault in faults for one in counting[fault]]
    sizes = [size for sizes in cells.pop("seeds") for size in sizes] or [0]
    return FaultTable(
        cells,
        _ordered(cells),
        faults,
        tuple(dict.fromkeys(sorted(one.terrain for one in kept))),
        tuple(sorted({one.rho for one in kept} - {0.0})),
        (min(sizes), max(sizes)),
        tuple(notes),
    )


CELL_COLUMNS = [
    "method", "fault", "reference", "mean", "low", "high", "n", "lost", "behind",
    "behind_at_least", "among_best", "seeds",
]  # fmt: skip


def _place(fault: str) -> tuple[int, str]:
    """Place of a fault by its label, which may tell options behind the name."""
    known = [NO_FAULT, *METHODS["fault"]]
    name = fault.split(" ")[0]
    return (known.index(name) if name in known else len(known), fault)


def _conditions(missions: pd.DataFrame) -> set[Condition]:
    listed = missions[["terrain", "fault", "rho"]].drop_duplicates()
    return {Condition(*row) for row in listed.itertuples(index=False)}


def _counting(missions: pd.DataFrame) -> list[Condition]:
    """List the conditions of a fault that more than half of its methods have."""
    there = missions[["method", "terrain", "fault", "rho"]].drop_duplicates()
    counts = Counter(Condition(*row[1:]) for row in there.itertuples(index=False))
    return sorted(one for one, n in counts.items() if n > there["method"].nunique() / 2)


def _strata(missions: pd.DataFrame, conditions: Sequence[Condition]) -> dict[str, Strata]:
    """Mean area by seed on each map, of the methods that have all the conditions."""
    # What is not finite stays so, what was not flown is NaN.
    known = missions.assign(area=missions["area"].fillna(np.inf))
    areas = known.pivot(index=["terrain", "method", "seed"], columns="rho", values="area")
    of_maps = []
    for terrain in dict.fromkeys(one.terrain for one in conditions):
        rhos = [one.rho for one in conditions if one.terrain == terrain]
        on_map: Any = areas.loc[terrain, rhos]
        of_maps.append(on_map.dropna().mean(axis=1))
    everyone = dict.fromkeys(missions["method"]) if of_maps else {}
    there = [set(of_map.index.get_level_values("method")) for of_map in of_maps]
    return {
        str(method): [of_map.loc[method] for of_map in of_maps]
        for method in everyone
        if all(method in methods for methods in there)
    }


def _compared(fault: str, strata: dict[str, Strata], references: set[str]) -> list[dict[str, Any]]:
    """Sum up every method under a fault, and compare it with the best."""
    rows = {method: _cell(method, fault, found) for method, found in strata.items()}
    contest = {m: rows[m]["mean"] for m in rows if m not in references and not rows[m]["lost"]}
    best = min(contest, key=lambda method: float(contest[method]), default="")
    for method, row in rows.items():
        row["reference"] = method in references
        row["behind"], row["behind_at_least"] = np.nan, np.nan
        if method in contest and method != best:
            row["behind"], row["behind_at_least"] = _behind(
                strata[method], strata[best], comparisons=len(contest) - 1
            )
        elif method == best:
            row["behind"] = 0.0
        row["among_best"] = method in contest and not row["behind_at_least"] > 0
    return list(rows.values())


def _cell(method: str, fault: str, strata: Strata) -> dict[str, Any]:
    areas = np.concatenate([stratum.to_numpy() for stratum in strata])
    lost = int(np.sum(~np.isfinite(areas)))
    found = None if lost else stratified_mean(strata)
    return {
        "method": method,
        "fault": fault,
        "mean": found.mean if found else np.nan,
        "low": found.low if found else np.nan,
        "high": found.high if found else np.nan,
        "n": len(areas),
        "lost": lost,
        "seeds": [len(stratum) for stratum in strata],
    }


def _behind(strata: Strata, best: Strata, comparisons: int) -> tuple[float, float]:
    """Mean difference on the seeds that both have, and a lower bound of it (Bonferroni).

    So the method that truly is the best of a fault is among those not told apart from the apparent
    one with a probability of at least 95 %, although that one was chosen by the same data.
    """
    differences = [(own - other).dropna() for own, other in zip(strata, best, strict=True)]
    if not all(map(len, differences)):
        return np.nan, np.nan
    found = stratified_mean(differences, 1 - 2 * 0.05 / comparisons)
    return found.mean, found.low


def _ordered(cells: pd.DataFrame) -> tuple[str, ...]:
    """Put references before contestants, each by mean rank under the faults, the lost last."""
    ranks = cells.groupby("fault")["mean"].rank(na_option="bottom")
    means = ranks.groupby(cells["method"]).mean()
    marked = cells.groupby("method")["reference"].first()
    return tuple(sorted(means.index, key=lambda one: (not marked[one], means[one], one)))


def _uneven(counting: dict[str, list[Condition]]) -> list[str]:
    """Name the faults that stand on fewer maps or rhos than others."""
    where = {fault: {(c.terrain, c.rho) for c in found} for fault, found in counting.items()}
    everywhere = set().union(*where.values()) if where else set()
    return [
        f"{fault}: {', '.join(f'{terrain} rho {plain_number(rho)}' for terrain, rho in sorted(s))} "
        "alone"
        for fault, s in where.items()
        if s != everywhere
    ]


def _told(condition: Condition) -> str:
    return f"{condition.terrain} {condition.fault} rho {plain_number(condition.rho)}"
