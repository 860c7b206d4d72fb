"""What the paper's claims hang on: each claim in every universe, and what moves it.

A claim names one or several comparisons. Its curve is that of the one that binds: the comparison
that falls farthest short of what is stated, or passes it by least, in most universes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.claims import COMPARISONS, TEXTS
from infoplan.analyse.clustered import ClusteredFit, differences, fit
from infoplan.analyse.judging import (
    CONTRADICTED,
    SUPPORTED,
    UNDECIDED,
    USUAL,
    Comparison,
    Rules,
    Stated,
    corrected,
    overall,
)
from infoplan.analyse.statistics import Interval, holm, mean_interval
from infoplan.analyse.universe_numbers import EARLY_WINDOWS, Multiverse, OfUniverse
from infoplan.study.universes import CHOICES, DEFAULT, METHODS, Universe

Floats = NDArray[np.float64]

CLIP: tuple[tuple[int, float], ...] = (
    (108, 1072.0), (331, 390.0), (585, 375.0), (783, 290.0), (1021, 261.0), (1260, 237.0),
    (1477, 214.0), (1703, 205.0), (1930, 198.0),
)  # fmt: skip
"""Samples and RMSE in ft, read off the authors' clip of one mission on helens; neither its method
nor its share of outliers is told."""

CLIP_OF = ("helens", "ft")
"""Its map and unit."""

NEAREST = 0.1
"""Share of the universes that is looked at as the nearest to the clip."""


VERDICTS = (SUPPORTED, CONTRADICTED, UNDECIDED)

MARGINS = (USUAL.margin, 0.025, 0.1)
"""Readings of what is negligible, the usual first."""

RULES: Mapping[str, Mapping[str, Rules]] = {
    "margin": {f"{100 * margin:g} %": Rules(margin=margin) for margin in MARGINS},
    "early samples": {f"{low}-{high}": Rules(early=(low, high)) for low, high in EARLY_WINDOWS},
}
"""Choices that no mission depends on, with their levels, the usual first."""


@dataclass(frozen=True)
class ClaimCurve:
    """One claim over all universes.

    Attributes
    ----------
    name
        As C1.
    binding
        Place of the comparison that binds among those of the claim.
    what, unit, stated
        That comparison.
    universes
        Names, in the order in which they are flown.
    effects
        Of the binding comparison, by universe and seed: shape (universes, seeds), NaN where a
        seed is missing.
    seeds
        Which.
    verdicts
        Of the whole claim, by universe.
    """

    name: str
    binding: int
    what: str
    unit: str
    stated: Stated
    universes: tuple[str, ...]
    effects: Floats
    seeds: tuple[int, ...]
    verdicts: tuple[str, ...]

    @property
    def text(self) -> str:
        """What it says."""
        return TEXTS[self.name]

    @property
    def means(self) -> Floats:
        """Mean effect of each universe."""
        return np.nanmean(self.effects, axis=1)

    def interval(self, place: int) -> Interval:
        """Mean effect of one universe with its 95 % t interval over seeds."""
        return mean_interval(self.effects[place])

    def verdict_in(self, universe: str) -> str:
        """Verdict in one universe; empty if that lacks the runs."""
        return self.verdicts[self.universes.index(universe)] if universe in self.universes else ""


@dataclass(frozen=True)
class JointTest:
    """Whether a claim's effect over all universes could be chance (Simonsohn et al., 2020).

    Under the null hypothesis the labels of the two sides mean nothing: the effects of a seed have
    the opposite sign in all universes as likely as not.

    Attributes
    ----------
    median, p_median
        Median over universes of the mean effect, and how often that of flipped signs is as far
        from zero.
    one_side
        Larger share of universes whose mean effect is on one side of zero. It is no test: universes
        that share their seeds mostly stay on one side when signs are flipped, too.
    mean_t, p_mean_t
        Mean over universes of Student's t, and how often that of flipped signs is as far from zero.
    flips
        How many sign flips there are: no p is below two in so many; of a single seed there is no
        test, and the numbers but the median are NaN.
    """

    median: float
    p_median: float
    one_side: float
    mean_t: float
    p_mean_t: float
    flips: int


def claim_curves(multiverse: Multiverse, names: Sequence[str] = tuple(TEXTS)) -> list[ClaimCurve]:
    """Judge claims in every universe.

    Parameters
    ----------
    multiverse
        The numbers.
    names
        Which claims.

    Returns
    -------
    list of ClaimCurve
        Of the claims of which some universe has the runs.
    """
    universes = [universe.name for universe in multiverse.universes]
    curves = []
    for name in names:
        there = _compared(name, {one: multiverse.numbers[one] for one in universes})
        if there:
            short = np.array([[_slack(item) for item in items] for items in there.values()])
            binding = int(np.bincount(short.argmin(axis=1)).argmax())
            curves.append(_curve(name, there, binding))
    return curves


def why_unjudged(name: str, multiverse: Multiverse) -> str:
    """Say what all universes lack to judge a claim, which has no curve then."""
    made = [one for found in multiverse.numbers.values() for one in COMPARISONS[name](found)]
    above = max(one.above for one in made)
    if above >= multiverse.budget:
        return f"it takes a budget above {above}"
    return f"{next(one.lacks for one in made if one.lacks)} in every universe"


def effects_of_rules(curve: ClaimCurve, multiverse: Multiverse) -> pd.DataFrame:
    """Judge a claim by other rules, from the same missions.

    Parameters
    ----------
    curve
        Of the claim by the usual rules; the comparison that binds stays that one.
    multiverse
        The numbers.

    Returns
    -------
    DataFrame
        A row a level of `RULES`, of those choices that can matter to the claim: choice, level;
        mean, low, high of the difference of the effect from that by the usual rules in the default
        universe, paired by seed, with 95 % t intervals, and the claim's verdict there (NaN and
        empty without the default universe); in how many universes it is ``supported``,
        ``contradicted`` and ``undecided``.
    """
    rows = []
    for choice, levels in RULES.items():
        if choice == "early samples" and not _uses_early(curve, multiverse):
            continue
        for level, rules in levels.items():
            other = curve
            if rules != USUAL:
                compared = _compared(curve.name, multiverse.judged_by(rules))
                if not compared:
                    continue
                other = _curve(curve.name, compared, curve.binding)
            verdict, moved = "", mean_interval([])
            if DEFAULT in other.universes and DEFAULT in curve.universes:
                verdict = other.verdicts[other.universes.index(DEFAULT)]
                moved = mean_interval(_default_effects(other) - _default_effects(curve))
            rows.append(
                {"choice": choice, "level": level, "mean": moved.mean, "low": moved.low,
                 "high": moved.high, "verdict": verdict,
                 **{one: other.verdicts.count(one) for one in VERDICTS}}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _uses_early(curve: ClaimCurve, multiverse: Multiverse) -> bool:
    """Tell whether a claim compares numbers of early samples."""
    first, compare = curve.universes[0], COMPARISONS[curve.name]
    by = [multiverse.judged_by(rules)[first] for rules in RULES["early samples"].values()]
    return len({one.what for numbers in by for one in compare(numbers)}) > len(compare(by[0]))


def _default_effects(curve: ClaimCurve) -> Floats:
    return curve.effects[curve.universes.index(DEFAULT)]


def _compared(name: str, numbers: Mapping[str, OfUniverse]) -> dict[str, tuple[Comparison, ...]]:
    """Make a claim's comparisons in every universe that has the runs."""
    compared = {one: corrected(COMPARISONS[name](found)) for one, found in numbers.items()}
    return {one: items for one, items in compared.items() if not any(i.lacks for i in items)}


def _curve(name: str, compared: Mapping[str, Sequence[Comparison]], binding: int) -> ClaimCurve:
    chosen = [items[binding] for items in compared.values()]
    seeds = tuple(sorted({seed for item in chosen for seed in item.values}))
    effects = [[item.values.get(seed, np.nan) for seed in seeds] for item in chosen]
    return ClaimCurve(
        name, binding, chosen[0].what, chosen[0].unit, chosen[0].stated, tuple(compared),
        np.array(effects), seeds,
        tuple(overall([item.verdict for item in items]) for items in compared.values()),
    )  # fmt: skip


def _slack(item: Comparison) -> float:
    """By how much the mean effect lies on the stated side; negative: it does not."""
    return min(item.effect.mean - item.stated.low, item.stated.high - item.effect.mean)


def effects_alone(curve: ClaimCurve, multiverse: Multiverse) -> pd.DataFrame:
    """How much every level alone moves a claim's effect from that of the defaults.

    Returns
    -------
    DataFrame
        A row a level: choice, level; mean, low, high of the difference, paired by seed, with 95 %
        t intervals; verdict of the claim there. Empty without the default universe.
    """
    if DEFAULT not in curve.universes:
        return pd.DataFrame(columns=["choice", "level", "mean", "low", "high", "verdict"])
    base = _default_effects(curve)
    rows = []
    for universe in multiverse.universes:
        if len(universe.changed) == 1 and universe.name in curve.universes:
            (choice,) = universe.changed
            place, level = curve.universes.index(universe.name), universe.levels[choice]
            moved = mean_interval(curve.effects[place] - base)
            rows.append(
                {"choice": choice, "level": level, "mean": moved.mean, "low": moved.low,
                 "high": moved.high, "verdict": curve.verdicts[place]}
            )  # fmt: skip
    return pd.DataFrame(rows)


def effects_jointly(curve: ClaimCurve, multiverse: Multiverse) -> pd.DataFrame:
    """How much every level moves a claim's effect, whatever the other choices are.

    Ordinary least squares of the universes' mean effects on the levels, over the joint universes:
    there the levels of a choice are equally frequent among those of the others, and what single
    choices do to the defaults is not spread over them. Intervals are for other universes and other
    seeds: errors have a part that differs from universe to universe, and what the coefficients of
    single seeds vary beyond that, because all universes share a seed's reaction to a level.

    Returns
    -------
    DataFrame
        A row a level other than the default: choice, level; mean, low, high of its coefficient,
        with 95 % t intervals; and for each choice, in all its rows, ``share``, the part of the
        variance that only it explains, and ``p``, the least of t tests of any two of its levels,
        adjusted by Bonferroni over these and by Holm over choices. Empty where there are too few
        universes.
    """
    there, effects = _joint_effects(curve, multiverse)
    design, named = _design([one.levels_in_use for one in there])
    if len(there) <= design.shape[1]:
        return pd.DataFrame(columns=["choice", "level", "mean", "low", "high", "share", "p"])
    fitted, total = fit(design, effects), _squares(effects)
    coefficients = _coefficients(fitted)
    rows = []
    for choice in dict.fromkeys(one for one, *_ in named):
        mine = {column: level for one, level, column in named if one == choice}
        kept = [column for column in range(design.shape[1]) if column not in mine]
        gained = fit(design[:, kept], effects).squares - fitted.squares
        share = gained / total if total else np.nan
        p = fitted.estimates(differences(list(mine), design.shape[1])).p()
        rows += [
            {"choice": choice, "level": level, **coefficients[column], "share": share, "p": p}
            for column, level in mine.items()
        ]
    table = pd.DataFrame(rows)
    of_choice = table.drop_duplicates("choice").set_index("choice")["p"]
    adjusted = pd.Series(holm(of_choice), index=of_choice.index)
    return table.assign(p=table["choice"].map(adjusted))


def pairs_of_choices(curve: ClaimCurve, multiverse: Multiverse, most: int = 5) -> pd.DataFrame:
    """Which pairs of choices move a claim's effect by more than both alone.

    Each pair's interaction is added to the main effects; those of ``most`` choices that explain
    most are looked at.

    Returns
    -------
    DataFrame
        A row a pair: first, second; ``share``, the part of the variance that the interaction
        explains beyond the main effects; ``p``, the least of t tests of its combinations, adjusted
        by Bonferroni over these and by Holm over pairs; and of the
        combination that it moves most: ``levels``, mean, low, high. Sorted by p.
    """
    main = effects_jointly(curve, multiverse)
    columns = ["first", "second", "share", "p", "levels", "mean", "low", "high"]
    if main.empty:
        return pd.DataFrame(columns=columns)
    there, effects = _joint_effects(curve, multiverse)
    design, named = _design([one.levels_in_use for one in there])
    ranked = main.drop_duplicates("choice").sort_values("share", ascending=False)["choice"]
    base, total = fit(design, effects), _squares(effects)
    rows = []
    for first, second in combinations(ranked.head(most), 2):
        crossed = [
            (f"{a} x {b}", design[:, i] * design[:, j])
            for (one, a, i), (two, b, j) in product(named, named)
            if one == first and two == second
        ]
        # A combination that no universe has, or that others make up, tells nothing.
        wide = np.column_stack([design, *(product_ for _, product_ in crossed)])
        kept = _independent(wide, design.shape[1])
        added = list(range(design.shape[1], len(kept)))
        if not added or len(there) <= len(kept):
            continue
        fitted = fit(wide[:, kept], effects)
        coefficients = _coefficients(fitted)
        moved = [
            (crossed[kept[place] - design.shape[1]][0], coefficients[place]) for place in added
        ]
        label, largest = max(moved, key=lambda one: abs(one[1]["mean"]))
        gained = base.squares - fitted.squares
        rows.append(
            {"first": first, "second": second, "share": gained / total if total else np.nan,
             "p": fitted.estimates(np.eye(len(kept))[added]).p(), "levels": label, **largest}
        )  # fmt: skip
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(p=holm(table["p"])).sort_values("p", ignore_index=True)


def errors_by_universe(multiverse: Multiverse, rho: float = 0.1) -> pd.DataFrame:
    """Tell how each method ends in each universe, scope batch.

    Returns
    -------
    DataFrame
        A row a universe: one column a method, its mean final RMSE over the seeds that all methods
        flown there have, NaN where it was not flown; and ``collapsed``, the share of the missions
        that end with a collapsed model, those of UCT-BEST left out.
    """
    missions = multiverse.missions
    missions = missions[(missions["rho"] == rho) & (missions["scope"] == "batch")]
    by_seed = missions.pivot(index=["universe", "seed"], columns="method", values="final")
    there = by_seed.notna()
    paired = (there == there.groupby("universe").transform("any")).all(axis=1)
    ends = by_seed[paired].groupby("universe").mean()
    judged = missions[missions["method"] != "UCT-BEST"]
    collapsed = judged.groupby("universe")["collapsed"].mean()
    names = [one.name for one in multiverse.universes]
    return ends.reindex(columns=list(METHODS)).assign(collapsed=collapsed).reindex(names)


def compare_models(first: Multiverse, second: Multiverse, rho: float = 0.1) -> pd.DataFrame:
    """Compare how methods end in universes that were flown with two models, paired by seed.

    Returns
    -------
    DataFrame
        A row a universe and method, scope batch, in the order of the second: universe, method;
        ``end``, mean final RMSE with the second model; mean, low, high of what the first gives
        more, with 95 % t intervals over the seeds of both.
    """
    ends: list[Any] = []
    for made in (first, second):
        missions = made.missions
        there = missions[(missions["rho"] == rho) & (missions["scope"] == "batch")]
        ends.append(there.set_index(["universe", "method", "seed"])["final"])
    both = ends[1].to_frame("end").join(ends[0].rename("first"), how="inner").dropna()
    rows = []
    for (universe, method), found in both.groupby(["universe", "method"], sort=False):
        more = mean_interval(found["first"] - found["end"])
        rows.append({"universe": universe, "method": method, "end": found["end"].mean(),
                     "mean": more.mean, "low": more.low, "high": more.high})  # fmt: skip
    return pd.DataFrame(rows, columns=["universe", "method", "end", "mean", "low", "high"])


PAIRS = (
    ("UCT-BEST", "UCT-NONE"), ("UCT-COPOD", "UCT-NONE"), ("PUCT-COPOD", "UCT-NONE"),
    ("PUCT-COPOD", "UCT-COPOD"),
)  # fmt: skip
"""Methods whose order `orders_by_collapse` tells."""

KINDS = ("collapsed", "sound, one choice", "sound, joint")
"""Kinds of universes that it tells apart: whether most missions of UCT-NONE end with a collapsed
model, and of the others whether all choices vary in them."""


def orders_by_collapse(multiverse: Multiverse, rho: float = 0.1) -> pd.DataFrame:
    """Tell how methods rank where UCT-NONE's model collapses, and where it does not.

    Returns
    -------
    DataFrame
        A row for each of `KINDS`: ``universes``, how many; a column a method, the median over them
        of its mean final RMSE, scope batch; and for each of `PAIRS`, as "A < B" and "A > B", in how
        many of them A ends below and above B by more than the margin.
    """
    missions = multiverse.missions
    none = missions[(missions["method"] == "UCT-NONE") & (missions["rho"] == rho)]
    ends = errors_by_universe(multiverse, rho).drop(columns="collapsed").dropna()
    collapses = none.groupby("universe")["collapsed"].mean() > 0.5
    joint = {one.name for one in multiverse.universes if one.is_joint}
    kinds = [KINDS[0 if collapses[name] else 1 + (name in joint)] for name in ends.index]
    margin = USUAL.margin * multiverse.deviation
    told = {
        f"{one} {sign} {other}": (ends[one] - ends[other]) * side > margin
        for one, other in PAIRS
        for sign, side in (("<", -1.0), (">", 1.0))
    }
    groups = pd.DataFrame(told).groupby(kinds)
    found = pd.concat([groups.size().rename("universes"), ends.groupby(kinds).median(),
                       groups.sum()], axis=1)  # fmt: skip
    return found.reindex(KINDS)


def errors_jointly(multiverse: Multiverse, rho: float = 0.1) -> pd.DataFrame:
    """How much every level moves each method's end, whatever the other choices are.

    Least squares, as in `effects_jointly`, of a method's mean final RMSE, scope batch, on the
    levels as it meets them, over the joint universes in which all four methods were flown.

    Returns
    -------
    DataFrame
        A row a level other than the default and method: choice, level, method; mean, low, high of
        the coefficient, with 95 % t intervals. Empty where there are too few universes.
    """
    flown = errors_by_universe(multiverse, rho)[list(METHODS)].replace(np.inf, np.nan).dropna()
    there = [one for one in multiverse.universes if one.is_joint and one.name in flown.index]
    missions = multiverse.missions
    batch = missions[(missions["rho"] == rho) & (missions["scope"] == "batch")]
    ends = batch.pivot(index=["method", "universe"], columns="seed", values="final")
    rows = []
    for method in METHODS:
        design, named = _design([one.levels_for(method) for one in there])
        if len(there) > design.shape[1]:
            values = ends.loc[method].loc[[one.name for one in there]].to_numpy(float)
            coefficients = _coefficients(fit(design, values))
            rows += [
                {"choice": choice, "level": level, "method": method, **coefficients[column]}
                for choice, level, column in named
            ]
    return pd.DataFrame(rows, columns=["choice", "level", "method", "mean", "low", "high"])


def joint_test(curve: ClaimCurve) -> JointTest:
    """Test a claim's effect over all universes at once, by all sign flips of the seeds.

    The seeds are those that most universes have; a universe that lacks one of them, as one that is
    being flown, is left out.
    """
    known = np.isfinite(curve.effects)
    patterns, counts = np.unique(known, axis=0, return_counts=True)
    seeds = patterns[np.lexsort((patterns.sum(axis=1), counts))[-1]]
    effects = curve.effects[known[:, seeds].all(axis=1)][:, seeds]
    n = effects.shape[1]
    if n < 2:
        median = float(np.median(effects)) if n else np.nan
        return JointTest(median, np.nan, np.nan, np.nan, np.nan, 0)
    signs = np.array(list(product((1.0, -1.0), repeat=n)))
    medians, mean_ts = (np.empty(len(signs)) for _ in range(2))
    for place, flipped in enumerate(signs):
        values = effects * flipped
        means = values.mean(axis=1)
        errors = np.maximum(values.std(axis=1, ddof=1), np.finfo(float).tiny) / np.sqrt(n)
        medians[place] = np.median(means)
        mean_ts[place] = np.mean(means / errors)

    def p(values: Floats) -> float:
        return float(np.mean(np.abs(values) >= abs(values[0]) * (1.0 - 1e-12)))

    means = effects.mean(axis=1)
    one_side = float(max(np.mean(means > 0), np.mean(means < 0)))
    return JointTest(
        float(medians[0]), p(medians), one_side, float(mean_ts[0]), p(mean_ts), len(signs)
    )


def nearness(multiverse: Multiverse) -> pd.DataFrame:
    """Rank universes by how near a mission of theirs comes to the authors' clip.

    Returns
    -------
    DataFrame
        A row a universe, the nearest first: universe; method and rho of the run that comes nearest
        (scope batch), as the clip tells neither; mean, low, high of its distance, the root mean
        square over the clip's points within the budget of the logarithm of the ratio of the two
        RMSE, over seeds, with 95 % t intervals. Empty on other maps than the clip's.
    """
    if (multiverse.terrain, multiverse.unit) != CLIP_OF:
        return pd.DataFrame(columns=["universe", "method", "rho", "mean", "low", "high"])
    points = [(at, value) for at, value in CLIP if at <= multiverse.budget]
    at, clip = np.array(points).T
    batch = multiverse.missions[multiverse.missions["scope"] == "batch"]
    curves = np.array([np.interp(at, multiverse.axis, rmse) for rmse in batch["rmse"]])
    far = np.sqrt(np.mean(np.log(curves / clip) ** 2, axis=1))
    rows = []
    by = batch.assign(far=far).groupby(["universe", "method", "rho"])["far"]
    for (universe, method, rho), distances in by:
        found = mean_interval(distances)
        rows.append({"universe": universe, "method": method, "rho": rho, "mean": found.mean,
                     "low": max(found.low, 0.0), "high": found.high})  # fmt: skip
    table = pd.DataFrame(rows).sort_values("mean", ignore_index=True)
    return table.drop_duplicates("universe", ignore_index=True)


def nearest_tenth(multiverse: Multiverse) -> list[str]:
    """Name the tenth of the universes that is nearest to the clip, at least one; on its map."""
    ranked = nearness(multiverse)["universe"]
    return ranked.head(max(1, round(NEAREST * len(ranked)))).tolist()


def _joint_effects(curve: ClaimCurve, multiverse: Multiverse) -> tuple[list[Universe], Floats]:
    """Give the joint universes in which a claim is judged, and its effects there, by seed."""
    finite = {name for name, mean in zip(curve.universes, curve.means, strict=True)
              if np.isfinite(mean)}  # fmt: skip
    there = [one for one in multiverse.universes if one.is_joint and one.name in finite]
    return there, curve.effects[[curve.universes.index(one.name) for one in there]]


def _coefficients(fitted: ClusteredFit) -> list[dict[str, float]]:
    """Give each coefficient with its 95 % t interval."""
    found = fitted.estimates(np.eye(len(fitted.weights)))
    low, high = found.intervals()
    return [
        {"mean": one[0], "low": one[1], "high": one[2]}
        for one in np.column_stack([found.mean, low, high]).tolist()
    ]


def _squares(effects: Floats) -> float:
    """Sum of squares of the universes' means about their own."""
    means = np.nanmean(effects, axis=1)
    return float(np.sum((means - means.mean()) ** 2))


def _design(levels: Sequence[Mapping[str, str]]) -> tuple[Floats, list[tuple[str, str, int]]]:
    """Make a column of ones and one for each level that is not the default and that occurs.

    Parameters
    ----------
    levels
        Of every choice, in each universe.
    """
    columns, named = [np.ones(len(levels))], []
    for choice in CHOICES:
        for level in list(choice.levels)[1:]:
            has = np.array([one[choice.name] == level for one in levels], dtype=float)
            if 0 < has.sum() < len(levels):
                named.append((choice.name, level, len(columns)))
                columns.append(has)
    return np.column_stack(columns), named


def _independent(design: Floats, sure: int) -> list[int]:
    """Columns that are no combination of those before them; the first `sure` are taken."""
    kept = list(range(sure))
    rank = np.linalg.matrix_rank(design[:, kept])
    for column in range(sure, design.shape[1]):
        if np.linalg.matrix_rank(design[:, [*kept, column]]) > rank:
            kept.append(column)
            rank += 1
    return kept
