"""Methods ranked over several maps and outlier shares.

The score of a mission is the area under its RMSE curve from the pilot's end to the budget, divided
by the curve's length and by the standard deviation of its map on the query grid: the mean error in
standard deviations of the map, so that maps of any unit and height can be averaged.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.configurations import Options, option_text, stored_options
from infoplan.analyse.curves import mean_between
from infoplan.analyse.statistics import (
    Interval,
    probability_below_zero,
    stratified_mean,
)
from infoplan.analyse.stretches import NO_TRUTH
from infoplan.analyse.tables import REPLAY, demand_whole, stored_footers
from infoplan.config import METHODS, is_survey
from infoplan.errors import UsageError
from infoplan.files import user_path
from infoplan.method_identity import SPIKE, Method, labels, method_of
from infoplan.options import plain_number
from infoplan.study.store import read_table
from infoplan.study.stored_curves import ended_collapsed
from infoplan.text_options import as_command
from infoplan.wording import counted

CONDITIONS = ("terrain", "fault", "rho")
"""Parts of a configuration under which methods are compared, each with each."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Entry:
    """A stored mission that stands for its method.

    Attributes
    ----------
    run, seed
        The mission.
    method
        Whose it is.
    options
        All options of its configuration, by dotted names.
    """

    run: str
    seed: int
    method: Method
    options: Options

    def part(self, *groups: str) -> Options:
        """Options of some groups alone."""
        return {k: v for k, v in self.options.items() if k.partition(".")[0] in groups}

    @property
    def settings(self) -> Options:
        """Options that are neither its method's nor a condition."""
        return {k: v for k, v in self.options.items()
                if k.partition(".")[0] not in (*METHODS, *CONDITIONS)}  # fmt: skip


class Condition(NamedTuple):
    """What a mission is flown under: the label of its map, that of its fault, the outlier share."""

    terrain: str
    fault: str
    rho: float

    def __str__(self) -> str:
        """Write it for a note: ``helens rho 0.1``, ``helens stuck rho 0.1``."""
        fault = "" if self.fault == SPIKE.name else f"{self.fault} "
        return f"{self.terrain} {fault}rho {plain_number(self.rho)}"


Entries = dict[tuple[str, Condition, int], Entry]
"""Missions by the label of the method, the condition and the seed."""


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
    by_rho, by_fault, by_map
        Means by share of outliers, by fault, and by map.
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
    by_fault: dict[str, float]
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
    """

    standings: tuple[Standing, ...]
    maps: dict[str, list[int]]
    rhos: tuple[float, ...]
    faults: tuple[str, ...]
    budget: int
    missions: int
    notes: tuple[str, ...]


def rank(
    results_dir: str | Path,
    filters: dict[str, Any] | None = None,
) -> Leaderboard:
    """Rank the methods of a results folder.

    Parameters
    ----------
    results_dir
        Folder of the result tables.
    filters
        An option of the runs, ``terrain``, ``planner``, ``detector``, ``model``, ``fault`` or
        ``seed``, and its value, or a list of which any will do. A run without the option passes.

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
    folder = user_path(results_dir)
    chosen = _chosen(folder, filters or {})
    entries = [entry for entry in chosen if not is_survey(str(entry.options["terrain.name"]))]
    if not entries:
        raise UsageError(
            f"results_dir={folder} holds surveys alone, and {NO_TRUTH}: methods are ranked by "
            "their errors on missions that infoplan run has flown"
        )
    surveys = len(chosen) - len(entries)
    entries, notes = _with_common_settings(entries)
    if surveys:
        notes.append(f"{counted(surveys, 'survey')} left out: {NO_TRUTH}")
    where = _named(entries)
    cells = {(method, condition) for method, condition, _ in where}
    counts = Counter(condition for _, condition in cells)
    everyone = sorted({method for method, _ in cells})
    counting = {condition for condition, count in counts.items() if count > len(everyone) / 2}
    ranked = [m for m in everyone if counting and all((m, one) in cells for one in counting)]
    for method in everyone:
        lacking = sorted(one for one in counting if (method, one) not in cells)
        if lacking:
            notes.append(f"{method} is not ranked: it lacks {', '.join(map(str, lacking))}")
    for condition in sorted(set(counts) - counting):
        notes.append(f"{condition} does not count: most methods lack it")
    seeds = _common_seeds(where, ranked, counting)
    for terrain in [terrain for terrain, common in seeds.items() if not common]:
        notes.append(f"{terrain} does not count: its missions have no seed in common")
        del seeds[terrain]
    if len(ranked) < 2 or not seeds:
        raise UsageError(
            f"results_dir={folder} holds no two methods with the same maps, faults, rhos and "
            f"seeds, out of {', '.join(everyone)}: run more, or choose with rho=, terrain= or the "
            "like"
        )
    scores = _Scores(folder, where, ranked, counting, seeds)
    return replace(scores.standings(), notes=tuple(notes))


class _Scores:
    """Scores of all missions that count, an array of methods x seeds x conditions for each map."""

    def __init__(
        self,
        folder: Path,
        where: Entries,
        methods: list[str],
        conditions: set[Condition],
        seeds: dict[str, list[int]],
    ):
        self.methods, self.seeds = methods, seeds
        self.conditions = {t: sorted(one for one in conditions if one.terrain == t) for t in seeds}
        numbers = {
            terrain: np.array(
                [
                    [
                        [_numbers(folder, where[m, one, seed]) for one in self.conditions[terrain]]
                        for seed in common
                    ]
                    for m in methods
                ]
            )
            for terrain, common in seeds.items()
        }
        self.area, self.final, self.seconds, self.collapsed = (
            {terrain: array[..., part] for terrain, array in numbers.items()} for part in range(4)
        )
        self.budget = int(next(iter(where.values())).options["budget"])

    def standings(self) -> Leaderboard:
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
                {rho: self._under(m, "rho", rho) for rho in rhos},
                {fault: self._under(m, "fault", fault) for fault in faults},
                {terrain: float(area[m].mean()) for terrain, area in self.area.items()},
                float(finals[m]),
                float(seconds[m]),
                float(collapsed[m]),
            )
            for m in order
        ]  # fmt: skip
        missions = sum(area.size for area in self.area.values())
        return Leaderboard(
            tuple(rows), self.seeds, tuple(rhos), tuple(faults), self.budget, missions, ()
        )

    def _under(self, method: int, part: str, value: float | str) -> float:
        """Mean of a method where a part of the condition has a value, every such map alike."""
        areas = []
        for terrain, conditions in self.conditions.items():
            chosen = [i for i, one in enumerate(conditions) if getattr(one, part) == value]
            if chosen:
                areas.append(self.area[terrain][method][:, chosen].mean())
        return float(np.mean(areas))


def _over_maps(numbers: dict[str, Floats]) -> Floats:
    """Mean of each method over seeds and conditions of each map, and over maps, every map alike."""
    return np.mean([array.mean(axis=(1, 2)) for array in numbers.values()], axis=0)


def _numbers(folder: Path, mission: Entry) -> tuple[float, float, float, float]:
    """Area and final RMSE of a mission in deviations of its map, seconds, whether collapsed."""
    demand_whole(folder, [(mission.run, mission.seed)])
    curve, maps = (
        read_table(folder, name, mission.run, mission.seed).to_pandas()
        for name in ("curves", "maps")
    )
    deviation = float(maps["truth"].std(ddof=0))
    area = mean_between(curve, float(curve["collected"].iloc[0]), np.inf)
    seconds = float(curve.filter(like="_seconds").to_numpy().sum())
    last = curve.iloc[-1]
    ended = ended_collapsed(folder, mission.run, mission.seed, last.to_dict())
    collapsed = np.nan if ended is None else float(ended)
    return area / deviation, float(last["rmse"]) / deviation, seconds, collapsed


def _common_seeds(
    where: Entries, methods: Iterable[str], conditions: set[Condition]
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


def _chosen(folder: Path, filters: Mapping[str, Any]) -> list[Entry]:
    """List the missions that answer to all filters; at least one must."""
    entries = _stored(folder)
    chosen = [entry for entry in entries if _answers(entry, filters)]
    if chosen:
        return chosen
    asked = " ".join(f"{name}={option_text(value)}" for name, value in filters.items())
    none = f"results_dir={folder} holds no finished mission{f' with {asked}' if asked else ''}"
    if not entries:
        benchmark = as_command("infoplan run -m experiment=benchmark", folder)
        raise UsageError(f"{none}: make some with {benchmark}")
    there = {
        name: dict.fromkeys(sorted(option_text(_value(entry, name)) for entry in entries))
        for name in filters
    }
    listed = "; ".join(f"{name}={' or '.join(values)}" for name, values in there.items())
    raise UsageError(f"{none}: there is {listed}")


def _stored(folder: Path) -> list[Entry]:
    """List all finished missions that were flown; replays are nobody's method."""
    entries: list[Entry] = []
    options: dict[str, Options] = {}
    for run, seed, footer in stored_footers(folder):
        if run not in options:
            options[run] = stored_options(footer.configuration)
        if REPLAY not in options[run]:
            entries.append(Entry(run, seed, method_of(options[run]).faultless, options[run]))
    return entries


def _value(entry: Entry, name: str) -> Any:
    """Value of an option, a group's choice, the seed or the run; None where there is none."""
    has = {**entry.options, "seed": entry.seed, "run": entry.run}
    return has.get(f"{name}.name", has.get(name))


def _answers(entry: Entry, filters: Mapping[str, Any]) -> bool:
    for name, wanted in filters.items():
        value = _value(entry, name)
        several = isinstance(wanted, list) and not isinstance(value, list)
        if value is not None and value not in (wanted if several else [wanted]):
            return False
    return True


def _with_common_settings(entries: list[Entry]) -> tuple[list[Entry], list[str]]:
    """Keep the missions with the settings that most have: scores of others do not compare."""
    settings = {entry.run: entry.settings for entry in entries}
    counts = Counter(repr(settings[entry.run]) for entry in entries)
    most = max(counts, key=lambda one: counts[one])
    kept = [entry for entry in entries if repr(settings[entry.run]) == most]
    others = [entry for entry in entries if repr(settings[entry.run]) != most]
    if not others:
        return kept, []
    usual = settings[kept[0].run]
    differing = sorted(
        {
            name
            for run in {entry.run for entry in others}
            for name in {*settings[run], *usual}
            if settings[run].get(name) != usual.get(name)
        }
    )
    told = ", ".join(f"{name}={option_text(usual.get(name))}" for name in differing)
    are = "is" if len(others) == 1 else "are"
    left_out = counted(len(others), "mission")
    return kept, [f"{left_out} with other settings than {told} {are} left out"]


def _named(entries: list[Entry]) -> Entries:
    """Find a label for every method, map and fault."""
    called = labels([entry.method for entry in entries], with_scope=True)
    methods = _told_apart(
        [called[entry.method] for entry in entries],
        [entry.part("planner", "detector", "model") for entry in entries],
    )
    terrains, faults = (
        _told_apart([str(entry.options[f"{group}.name"]) for entry in entries],
                    [entry.part(group) for entry in entries])
        for group in ("terrain", "fault")
    )  # fmt: skip
    return {
        (method, Condition(terrain, fault, float(entry.options["rho"])), entry.seed): entry
        for method, terrain, fault, entry in zip(methods, terrains, faults, entries, strict=True)
    }


def _told_apart(names: Sequence[str], options: Sequence[Options]) -> list[str]:
    """Add to each name the options in which those of this name differ."""
    alike: dict[str, list[Options]] = {}
    for name, flat in zip(names, options, strict=True):
        known = alike.setdefault(name, [])
        if flat not in known:
            known.append(flat)
    found = []
    for name, flat in zip(names, options, strict=True):
        others = alike[name]
        differing = sorted(
            option for option in {key for other in others for key in other}
            if any(other.get(option) != flat.get(option) for other in others)
        )  # fmt: skip
        told = [
            f"{option}={_short(option, flat[option])}" for option in differing if option in flat
        ]
        found.append(" ".join([name, *told]))
    return found


def _short(name: str, value: Any) -> str:
    text = option_text(value)
    return text[:8] if name == "terrain.sha256" else text
