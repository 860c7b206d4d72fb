"""Methods ranked over several maps, faults and outlier shares."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.by_fault import FaultTable, by_fault
from infoplan.analyse.mission_scores import Condition, read_scores
from infoplan.analyse.statistics import Interval, probability_below_zero, stratified_mean
from infoplan.errors import UsageError
from infoplan.files import user_path

Floats = NDArray[np.float64]

Key = tuple[str, Condition, int]
"""A mission: the label of its method, its condition, its seed."""

Numbers = tuple[float, float, float, float]
"""Its area, final RMSE, seconds, and whether its model has collapsed."""


@dataclass(frozen=True)
class Standing:
    """A row of the leaderboard.

    Attributes
    ----------
    method
        Its label, as in all drawings, and the options that methods of this label differ in.
    score
        Mean normalised area over maps, faults, rhos and seeds; its t interval on these maps, over
        the seeds of each.
    behind
        Score less that of the first, paired by map and seed.
    beaten
        Probability that the first has the smaller area, by map and seed.
    by_rho, by_map
        Means by share of outliers, and by map.
    final
        Mean RMSE at the budget, in standard deviations of the map.
    seconds
        Mean computing time of a mission.
    collapsed
        Share of the missions that end with a collapsed model; NaN if that is not known of all.
    """

    method: str
    score: Interval
    behind: Interval
    beaten: Interval
    by_rho: dict[float, float]
    by_map: dict[str, float]
    final: float
    seconds: float
    collapsed: float


@dataclass(frozen=True)
class Leaderboard:
    """Methods, best first, on maps, faults, rhos and seeds that all of them have.

    Attributes
    ----------
    standings
        Best first.
    maps
        Seeds that count, by map.
    rhos, faults
        Ascending.
    budget
        Samples of a mission.
    missions
        How many missions count.
    notes
        What was left out, and why: sentences for the reader.
    by_fault
        Every method under every fault, ranked or not; None where there is but one fault.
    """

    standings: tuple[Standing, ...]
    maps: dict[str, list[int]]
    rhos: tuple[float, ...]
    faults: tuple[str, ...]
    budget: int
    missions: int
    notes: tuple[str, ...]
    by_fault: FaultTable | None = None


def rank(
    results_dir: str | Path,
    filters: dict[str, Any] | None = None,
) -> Leaderboard:
    """Rank the methods of a results folder.

    Parameters
    ----------
    results_dir, filters
        As of `infoplan.analyse.mission_scores.read_scores`.

    Returns
    -------
    Leaderboard
        Of the missions with the settings that most have. A map with its fault and rho counts
        if more than half of the methods have it; a method that lacks one that counts is not ranked.

    Raises
    ------
    UsageError
        If no missions answer, or not two methods have the same maps, faults, rhos and seeds; of
        surveys, whose truth nobody knows, none counts.
    RunError
        If a table cannot be read.
    """
    read = read_scores(results_dir, filters)
    notes = list(read.notes)
    where = _by_key(read.table)
    cells = {(method, condition) for method, condition, _ in where}
    counts = Counter(condition for _, condition in cells)
    everyone = sorted({method for method, _ in cells})
    counting = {condition for condition, count in counts.items() if count > len(everyone) / 2}
    ranked = [m for m in everyone if counting and all((m, one) in cells for one in counting)]
    for method in everyone:
        lacking = sorted(one for one in counting if (method, one) not in cells)
        if lacking:
            notes.append(f"{method} is not ranked: it lacks {', '.join(map(str, lacking))}")
    notes += [
        f"{one} does not count: most methods lack it" for one in sorted(set(counts) - counting)
    ]
    seeds = _common_seeds(where, ranked, counting)
    for terrain in [terrain for terrain, common in seeds.items() if not common]:
        notes.append(f"{terrain} does not count: its missions have no seed in common")
        del seeds[terrain]
    if len(ranked) < 2 or not seeds:
        raise UsageError(
            f"results_dir={user_path(results_dir)} holds no two methods with the same maps, "
            f"faults, rhos and seeds, out of {', '.join(everyone)}: run more, or choose with "
            "rho=, terrain= or the like"
        )
    board = _Scores(where, ranked, counting, seeds).standings(read.budget)
    several = read.table["fault"].nunique() > 1
    return replace(board, notes=tuple(notes), by_fault=by_fault(read.table) if several else None)


def _by_key(table: pd.DataFrame) -> dict[Key, Numbers]:
    """Area, final, seconds and collapsed of every mission."""
    names = ["method", "terrain", "fault", "rho", "seed", "area", "final", "seconds", "collapsed"]
    rows: Any = table[names].itertuples(index=False, name=None)
    return {
        (method, Condition(terrain, fault, rho), seed): (area, final, seconds, collapsed)
        for method, terrain, fault, rho, seed, area, final, seconds, collapsed in rows
    }


class _Scores:
    """Scores of all missions that count, an array of methods x seeds x conditions for each map."""

    def __init__(
        self,
        where: dict[Key, Numbers],
        methods: list[str],
        conditions: set[Condition],
        seeds: dict[str, list[int]],
    ):
        self.methods, self.seeds = methods, seeds
        self.conditions = {t: sorted(one for one in conditions if one.terrain == t) for t in seeds}
        numbers = {
            terrain: np.array(
                [
                    [[where[m, one, seed] for one in self.conditions[terrain]] for seed in common]
                    for m in methods
                ]
            )
            for terrain, common in seeds.items()
        }
        self.area, self.final, self.seconds, self.collapsed = (
            {terrain: array[..., part] for terrain, array in numbers.items()} for part in range(4)
        )

    def standings(self, budget: int) -> Leaderboard:
        """Rank by the mean area."""
        means = _over_maps(self.area)
        order = np.argsort(means, kind="stable")
        by_seed = [area.mean(axis=2) for area in self.area.values()]  # methods x seeds, each map
        best = order[0]
        conditions = [one for listed in self.conditions.values() for one in listed]
        rhos = sorted({one.rho for one in conditions})
        faults = sorted({one.fault for one in conditions})
        finals, seconds = _over_maps(self.final), _over_maps(self.seconds)
        collapsed = _over_maps(self.collapsed)
        rows = [
            Standing(
                self.methods[m],
                stratified_mean(areas[m] for areas in by_seed),
                stratified_mean(areas[m] - areas[best] for areas in by_seed),
                probability_below_zero(areas[best] - areas[m] for areas in by_seed),
                {rho: self._at(m, rho) for rho in rhos},
                {terrain: float(area[m].mean()) for terrain, area in self.area.items()},
                float(finals[m]),
                float(seconds[m]),
                float(collapsed[m]),
            )
            for m in order
        ]  # fmt: skip
        missions = sum(area.size for area in self.area.values())
        return Leaderboard(
            tuple(rows), self.seeds, tuple(rhos), tuple(faults), budget, missions, ()
        )

    def _at(self, method: int, rho: float) -> float:
        """Mean of a method at a share of outliers, every map that has it alike."""
        areas = []
        for terrain, conditions in self.conditions.items():
            chosen = [i for i, one in enumerate(conditions) if one.rho == rho]
            if chosen:
                areas.append(self.area[terrain][method][:, chosen].mean())
        return float(np.mean(areas))


def _over_maps(numbers: dict[str, Floats]) -> Floats:
    """Mean of each method over seeds and conditions of each map, and over maps, every map alike."""
    return np.mean([array.mean(axis=(1, 2)) for array in numbers.values()], axis=0)


def _common_seeds(
    where: Iterable[Key], methods: Iterable[str], conditions: set[Condition]
) -> dict[str, list[int]]:
    """Seeds of each map that all methods have under all of its conditions."""
    found: dict[tuple[str, Condition], set[int]] = {}
    for method, condition, seed in where:
        found.setdefault((method, condition), set()).add(seed)
    common: dict[str, set[int]] = {}
    for condition in sorted(conditions):
        for method in methods:
            seeds = found[method, condition]
            common[condition.terrain] = common.get(condition.terrain, seeds) & seeds
    return {terrain: sorted(seeds) for terrain, seeds in common.items()}
