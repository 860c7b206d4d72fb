"""Methods ranked over several maps and outlier shares.

The score of a mission is the area under its RMSE curve from the pilot's end to the budget, divided
by the curve's length and by the standard deviation of its map on the query grid: the mean error in
standard deviations of the map, so that maps of any unit and height can be averaged.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.curves import mean_between
from infoplan.analyse.statistics import RESAMPLES, Interval
from infoplan.analyse.tables import (
    REPLAY,
    Options,
    demand_whole,
    flatten,
    option_text,
    stored_footers,
)
from infoplan.errors import UsageError
from infoplan.study.store import read_table
from infoplan.study.terms import as_meant
from infoplan.wording import counted

METHOD = ("planner", "detector", "model")
"""Parts of a configuration that make a method."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stored:
    """A stored mission: its method, map, settings, and where it is.

    Attributes
    ----------
    run, seed
        The mission.
    method, terrain, settings
        Options of planner, detector and model; of the map; and all others but rho.
    rho
        Share of outliers.
    """

    run: str
    seed: int
    method: Options
    terrain: Options
    settings: Options
    rho: float


@dataclass(frozen=True)
class Standing:
    """A row of the leaderboard.

    Attributes
    ----------
    method
        ``planner-detector-model-scope``, and the options that methods of this name differ in.
    score
        Mean normalised area over maps, rhos and seeds; its interval from a bootstrap over maps and
        over whole seeds of each.
    behind
        Score less that of the first, resampled together with it: paired by map and seed.
    by_rho, by_map
        Means by share of outliers, and by map.
    final
        Mean RMSE at the budget, in standard deviations of the map.
    seconds
        Mean computing time of a mission.
    """

    method: str
    score: Interval
    behind: Interval
    by_rho: dict[float, float]
    by_map: dict[str, float]
    final: float
    seconds: float


@dataclass(frozen=True)
class Leaderboard:
    """Methods, best first, on maps, rhos and seeds that all of them have.

    Attributes
    ----------
    standings
        Best first.
    maps
        Seeds that count, by map.
    rhos
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
    budget: int
    missions: int
    notes: tuple[str, ...]


def rank(
    results_dir: str | Path,
    filters: dict[str, Any] | None = None,
    *,
    resamples: int = RESAMPLES,
) -> Leaderboard:
    """Rank the methods of a results folder.

    Parameters
    ----------
    results_dir
        Folder of the result tables.
    filters
        An option of the runs, ``terrain``, ``planner``, ``detector``, ``model`` or ``seed``, and
        its value, or a list of which any will do. A run without the option passes.
    resamples
        Bootstrap resamples, drawn from a fixed seed.

    Returns
    -------
    Leaderboard
        Of the missions with the settings that most have. A map with its rho counts if more than
        half of the methods have it; a method that lacks one that counts is not ranked.

    Raises
    ------
    UsageError
        If no missions answer, or not two methods have the same maps, rhos and seeds.
    RunError
        If a table cannot be read.
    """
    folder = Path(results_dir).expanduser()
    missions = [mission for mission in _stored(folder) if _answers(mission, filters or {})]
    if not missions:
        asked = " ".join(f"{name}={value}" for name, value in (filters or {}).items())
        raise UsageError(
            f"results_dir={folder} holds no finished mission{f' with {asked}' if asked else ''}: "
            "make some with infoplan run -m experiment=benchmark"
        )
    missions, notes = _with_common_settings(missions)
    methods = _labels([mission.method for mission in missions], _method)
    terrains = _labels([mission.terrain for mission in missions], _terrain)
    where: dict[tuple[str, str, float, int], Stored] = {
        (method, terrain, mission.rho, mission.seed): mission
        for method, terrain, mission in zip(methods, terrains, missions, strict=True)
    }
    cells = {(method, terrain, rho) for method, terrain, rho, _ in where}
    counts = Counter((terrain, rho) for _, terrain, rho in cells)
    everyone = sorted(set(methods))
    counting = {cell for cell, count in counts.items() if count > len(everyone) / 2}
    ranked = [m for m in everyone if counting and all((m, *cell) in cells for cell in counting)]
    for method in everyone:
        lacking = sorted(cell for cell in counting if (method, *cell) not in cells)
        if lacking:
            listed = ", ".join(f"{terrain} rho {rho:g}" for terrain, rho in lacking)
            notes.append(f"{method} is not ranked: it lacks {listed}")
    for terrain, rho in sorted(set(counts) - counting):
        notes.append(f"{terrain} rho {rho:g} does not count: most methods lack it")
    seeds = _common_seeds(where, ranked, counting)
    for terrain in [terrain for terrain, common in seeds.items() if not common]:
        notes.append(f"{terrain} does not count: its missions have no seed in common")
        del seeds[terrain]
    if len(ranked) < 2 or not seeds:
        raise UsageError(
            f"results_dir={folder} holds no two methods with the same maps, rhos and seeds, out of "
            f"{', '.join(everyone)}: run more, or choose with rho=, terrain= or the like"
        )
    scores = _Scores(folder, where, ranked, counting, seeds)
    return replace(scores.standings(resamples), notes=tuple(notes))


class _Scores:
    """Scores of all missions that count, an array of methods x seeds x rhos for each map."""

    def __init__(
        self,
        folder: Path,
        where: dict[tuple[str, str, float, int], Stored],
        methods: list[str],
        cells: set[tuple[str, float]],
        seeds: dict[str, list[int]],
    ):
        self.methods, self.seeds = methods, seeds
        self.rhos = {t: sorted(rho for terrain, rho in cells if terrain == t) for t in seeds}
        numbers = {
            terrain: np.array(
                [
                    [
                        [_numbers(folder, where[m, terrain, r, seed]) for r in self.rhos[terrain]]
                        for seed in common
                    ]
                    for m in methods
                ]
            )
            for terrain, common in seeds.items()
        }
        self.area, self.final, self.seconds = (
            {terrain: array[..., part] for terrain, array in numbers.items()} for part in range(3)
        )
        self.budget = int(next(iter(where.values())).settings["budget"])

    def standings(self, resamples: int) -> Leaderboard:
        """Rank by the mean area."""
        means = _over_maps(self.area)
        order = np.argsort(means, kind="stable")
        drawn = self._resampled(resamples)
        best = order[0]
        n = sum(len(common) for common in self.seeds.values())
        rhos = sorted({rho for listed in self.rhos.values() for rho in listed})
        finals, seconds = _over_maps(self.final), _over_maps(self.seconds)
        rows = [
            Standing(
                self.methods[m],
                _interval(means[m], drawn[:, m], n),
                _interval(means[m] - means[best], drawn[:, m] - drawn[:, best], n),
                {rho: self._at_rho(m, rho) for rho in rhos},
                {terrain: float(area[m].mean()) for terrain, area in self.area.items()},
                float(finals[m]),
                float(seconds[m]),
            )
            for m in order
        ]
        missions = sum(area.size for area in self.area.values())
        return Leaderboard(tuple(rows), self.seeds, tuple(rhos), self.budget, missions, ())

    def _at_rho(self, method: int, rho: float) -> float:
        areas = [
            self.area[terrain][method, :, rhos.index(rho)].mean()
            for terrain, rhos in self.rhos.items()
            if rho in rhos
        ]
        return float(np.mean(areas))

    def _resampled(self, resamples: int) -> Floats:
        """Mean scores of all methods on resampled maps and seeds, shape (resamples, methods).

        Maps are drawn with replacement, and for each drawn map its seeds, as a whole: all methods
        and all rhos of a resample stand on the same ones.
        """
        rng = np.random.default_rng(0)
        by_seed = [area.mean(axis=2) for area in self.area.values()]  # methods x seeds, each map
        total = np.zeros((resamples, len(self.methods)))
        for _ in by_seed:
            chosen = rng.integers(len(by_seed), size=resamples)
            for number, area in enumerate(by_seed):
                rows = np.flatnonzero(chosen == number)
                drawn = rng.integers(area.shape[1], size=(len(rows), area.shape[1]))
                total[rows] += area[:, drawn].mean(axis=2).T
        return total / len(by_seed)


def _over_maps(numbers: dict[str, Floats]) -> Floats:
    """Mean of each method over seeds and rhos of each map, and over maps, every map alike."""
    return np.mean([array.mean(axis=(1, 2)) for array in numbers.values()], axis=0)


def _interval(mean: float, drawn: Floats, n: int) -> Interval:
    if n < 2:
        return Interval(float(mean), np.nan, np.nan, n)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Interval(float(mean), float(low), float(high), n)


def _numbers(folder: Path, mission: Stored) -> tuple[float, float, float]:
    """Area and final RMSE of a mission in standard deviations of its map, and its seconds."""
    demand_whole(folder, [(mission.run, mission.seed)])
    curve, maps = (
        read_table(folder, name, mission.run, mission.seed).to_pandas()
        for name in ("curves", "maps")
    )
    deviation = float(maps["truth"].std(ddof=0))
    area = mean_between(curve, float(curve["collected"].iloc[0]), np.inf)
    seconds = float(curve.filter(like="_seconds").to_numpy().sum())
    return area / deviation, float(curve["rmse"].iloc[-1]) / deviation, seconds


def _common_seeds(
    where: dict[tuple[str, str, float, int], Stored],
    methods: Iterable[str],
    cells: set[tuple[str, float]],
) -> dict[str, list[int]]:
    """Seeds of each map that all methods have at all of its rhos."""
    found: dict[tuple[str, str, float], set[int]] = {}
    for method, terrain, rho, seed in where:
        found.setdefault((method, terrain, rho), set()).add(seed)
    common: dict[str, set[int]] = {}
    for terrain, rho in sorted(cells):
        for method in methods:
            seeds = found[method, terrain, rho]
            common[terrain] = common.get(terrain, seeds) & seeds
    return {terrain: sorted(seeds) for terrain, seeds in common.items()}


def _stored(folder: Path) -> list[Stored]:
    """List all finished missions that were flown; replays are nobody's method."""
    missions, parts = [], {}
    for run, seed, footer in stored_footers(folder):
        science = as_meant(footer.configuration)
        if REPLAY in science:
            continue
        if run not in parts:
            rest = {k: v for k, v in science.items() if k not in (*METHOD, "terrain", "rho")}
            parts[run] = (
                flatten({part: science[part] for part in METHOD}),
                flatten({"terrain": science["terrain"]}),
                flatten(rest),
                float(science["rho"]),
            )
        missions.append(Stored(run, seed, *parts[run]))
    return missions


def _answers(mission: Stored, filters: dict[str, Any]) -> bool:
    has = {**mission.method, **mission.terrain, **mission.settings}
    has |= {"rho": mission.rho, "seed": mission.seed, "run": mission.run}
    for name, wanted in filters.items():
        value = has.get(f"{name}.name", has.get(name))
        several = isinstance(wanted, list) and not isinstance(value, list)
        if value is not None and value not in (wanted if several else [wanted]):
            return False
    return True


def _with_common_settings(missions: list[Stored]) -> tuple[list[Stored], list[str]]:
    """Keep the missions with the settings that most have: scores of others do not compare."""
    counts = Counter(repr(mission.settings) for mission in missions)
    most = max(counts, key=lambda settings: counts[settings])
    kept = [mission for mission in missions if repr(mission.settings) == most]
    others = [mission for mission in missions if repr(mission.settings) != most]
    if not others:
        return kept, []
    differing = sorted(
        {
            name
            for mission in others
            for name in {*mission.settings, *kept[0].settings}
            if mission.settings.get(name) != kept[0].settings.get(name)
        }
    )
    told = ", ".join(f"{name}={option_text(kept[0].settings.get(name))}" for name in differing)
    are = "is" if len(others) == 1 else "are"
    left_out = counted(len(others), "mission")
    return kept, [f"{left_out} with other settings than {told} {are} left out"]


def _method(flat: Options) -> str:
    """Call a method by planner, detector, model and scope; one of the user's by its function."""
    parts = []
    for group in METHOD:
        name, function = flat[f"{group}.name"], flat.get(f"{group}.function")
        parts.append(str(function).rpartition(".")[2] if function else str(name))
    return "-".join([*parts, str(flat["detector.scope"])])


def _terrain(flat: Options) -> str:
    return str(flat["terrain.name"])


def _labels(options: list[Options], called: Callable[[Options], str]) -> list[str]:
    """Name each of several sets of options, different sets differently."""
    alike: dict[str, list[Options]] = {}
    for flat in options:
        known = alike.setdefault(called(flat), [])
        if flat not in known:
            known.append(flat)
    labels = []
    for flat in options:
        others = alike[called(flat)]
        differing = sorted(
            name for name in {key for other in others for key in other}
            if any(other.get(name) != flat.get(name) for other in others)
        )  # fmt: skip
        told = [f"{name}={_short(name, flat[name])}" for name in differing if name in flat]
        labels.append(" ".join([called(flat), *told]))
    return labels


def _short(name: str, value: Any) -> str:
    text = option_text(value)
    return text[:8] if name == "terrain.sha256" else text
