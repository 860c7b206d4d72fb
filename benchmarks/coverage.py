"""How often intervals cover and verdicts are wrong, by simulation.

``python -m benchmarks.coverage [TRIALS]`` prints the tables of ``docs/statistics.md``.
"""

import argparse
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from infoplan.analyse.claims import COMPARISONS, NONE, SHARES, UCT
from infoplan.analyse.judging import USUAL, Comparison, Rules, Stated, corrected, overall
from infoplan.analyse.multiverse import ClaimCurve, effects_jointly, pairs_of_choices
from infoplan.analyse.statistics import mean_band, probability_below_zero, stratified_mean
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.study.universes import joint_universes

Floats = NDArray[np.float64]

SEEDS = (2, 5, 6, 10, 20)
SKEWS = (0, 2, 6)
RESAMPLES = 1000
CHUNK = 200
"""Trials whose resamples are held at once."""

SPREAD_EQUAL, SPREAD_AT_BOUND = 3.0, 0.5
"""Deviation of a method's seeds, in margins: large, so that the margin protects little; and small,
so that two one-sided tests can succeed at all."""

FAR = 1e6
"""So many margins inside of the stated side, a comparison is always supported."""

SEEDS_OF_UNIVERSES = 6
"""Of the multiverse."""

UNEQUAL = ("contamination", "0.2")
"""Level whose universes may vary more than others."""

MAPS = (1.0, 2.0, 4.0)
"""Deviations of the seeds on each map."""


def differences(skew: float, trials: int, n: int, rng: np.random.Generator) -> Floats:
    """Differences of mean 0 and deviation 1, normal or, with a skewness, gamma: (trials, n)."""
    if not skew:
        return rng.standard_normal((trials, n))
    shape = 4 / skew**2
    return (rng.gamma(shape, size=(trials, n)) - shape) / np.sqrt(shape)


def t_ends(values: Floats) -> Floats:
    """Give the ends of the t interval of each trial, shape (2, trials)."""
    return mean_band(values.T)[1:]


def bootstrap_ends(values: Floats, method: str) -> Floats:
    """Give the ends of SciPy's bootstrap interval of each trial, shape (2, trials)."""
    ends = []
    for start in range(0, len(values), CHUNK):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of BCa, which of two values may have no interval
            found = stats.bootstrap(
                (values[start : start + CHUNK],), np.mean, axis=-1, method=method,
                n_resamples=RESAMPLES, rng=np.random.default_rng(start),
            ).confidence_interval  # fmt: skip
        ends.append(np.stack([found.low, found.high]))
    return np.concatenate(ends, axis=1)


INTERVALS: dict[str, Callable[[Floats], Floats]] = {
    "t": t_ends,
    "percentile": lambda values: bootstrap_ends(values, "percentile"),
    "BCa": lambda values: bootstrap_ends(values, "BCa"),
}


@dataclass(frozen=True)
class Missed:
    """Shares of the trials in which an interval lies wholly below and wholly above the truth.

    An interval that is none, NaN, has missed on the side on which its mean lies.
    """

    below: float
    above: float

    @property
    def covered(self) -> float:
        """Share of the trials in which the interval holds the truth."""
        return 1.0 - self.below - self.above


def missed(kind: str, skew: float, n: int, trials: int, seed: int = 0) -> Missed:
    """Miss the truth, which is 0, with intervals of one kind."""
    values = differences(skew, trials, n, np.random.default_rng([seed, int(skew), n]))
    low, high = INTERVALS[kind](values)
    mean, none = values.mean(axis=1), np.isnan(low + high)
    return Missed(
        float(np.mean((high < 0) | (none & (mean < 0)))),
        float(np.mean((low > 0) | (none & (mean >= 0)))),
    )


@dataclass
class MadeUp:
    """Numbers of methods that are all alike: one number a seed and trial, one trial after another.

    Attributes
    ----------
    size
        Seeds times trials.
    skew
        Of the numbers of UCT-NONE and UCT-COPOD, and of what one method does alone.
    spread
        Deviation, in margins.
    rng
        Where numbers come from.
    """

    size: int
    rng: np.random.Generator
    skew: float = 0.0
    spread: float = 1.0
    unit: str = "ft"
    margin: float = 60.0
    rules: Rules = USUAL
    known: "dict[tuple[object, ...], pd.Series[float]]" = field(default_factory=dict)

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float]":
        """Draw numbers, once."""
        key = (name, method, rho, scope)
        if key not in self.known:
            skew = self.skew if method in (NONE, UCT) else 0.0
            unit = self.rules.margin if name in SHARES else self.margin
            drawn = differences(skew, 1, self.size, self.rng)[0]
            self.known[key] = pd.Series(unit * self.spread * drawn)
        return self.known[key]


Shift = Callable[[int, Stated], float]
"""Where the effect of a claim's i-th comparison lies, by the side stated."""


def equal(_: int, __: Stated) -> float:
    """All methods are alike."""
    return 0.0


def at_bound(_: int, stated: Stated) -> float:
    """Every effect lies at the bound of the side stated: no verdict is right."""
    return stated.low if isfinite(stated.low) else stated.high


def first_at_bound(number: int, stated: Stated) -> float:
    """Put the first effect at its bound, the others where the claim says."""
    if number == 0:
        return at_bound(number, stated)
    if isfinite(stated.low) and isfinite(stated.high):
        return 0.0
    return FAR if isfinite(stated.low) else -FAR


def verdicts(
    name: str, shift: Shift, n: int, trials: int, *, skew: float = 0.0, seed: int = 0
) -> Counter[str]:
    """Judge a claim by made-up numbers, many times."""
    spread = SPREAD_EQUAL if shift is equal else SPREAD_AT_BOUND
    rng = np.random.default_rng([seed, n, int(name[1:])])
    made = COMPARISONS[name](MadeUp(n * trials, rng, skew, spread))
    effects = [
        (shift(i, one.stated) + np.array(list(one.values.values()))).reshape(trials, n)
        for i, one in enumerate(made)
    ]
    return Counter(_verdict(made, [rows[trial] for rows in effects]) for trial in range(trials))


def _verdict(made: Sequence[Comparison], rows: Iterable[Floats]) -> str:
    filled = [
        replace(one, values=dict(enumerate(row.tolist())))
        for one, row in zip(made, rows, strict=True)
    ]
    return overall([one.verdict for one in corrected(filled)])


def false_when_equal(name: str) -> str:
    """Which verdict is false if all methods are alike and nothing is lost or gained."""
    made = COMPARISONS[name](MadeUp(1, np.random.default_rng(0)))
    holds = all(one.stated.low < 0 < one.stated.high for one in made)
    return "contradicted" if holds else "supported"


def on_maps(n: int, trials: int, seed: int = 0) -> tuple[float, float]:
    """Coverage on three maps: of the mean of a difference, of the probability of improvement."""
    rng = np.random.default_rng([seed, n])
    mean = 0.5
    hits = probable = 0
    ahead = [float(stats.norm.cdf(mean / deviation)) for deviation in MAPS]
    for _ in range(trials):
        strata = [deviation * rng.standard_normal(n) - mean for deviation in MAPS]
        interval, chance = stratified_mean(strata), probability_below_zero(strata)
        hits += interval.low <= -mean <= interval.high
        probable += chance.low <= np.mean(ahead) <= chance.high
    return hits / trials, probable / trials


@dataclass(frozen=True)
class Scene:
    """What made-up multiverses without any effect are drawn from.

    Attributes
    ----------
    noise
        Deviation of a universe's seeds, where that of universes is 1.
    reaction
        Of a seed's reaction to a level, the same in all universes.
    unequal
        Of the universes with the level `UNEQUAL`.
    """

    noise: float = 0.9
    reaction: float = 0.0
    unequal: float = 1.0


SCENES = (
    *(Scene(reaction=reaction) for reaction in (0.0, 0.3, 0.6, 1.5)),
    Scene(noise=2.5, reaction=0.3),
    Scene(unequal=3.0, reaction=0.3),
)


def on_universes(scene: Scene, trials: int, seed: int = 0) -> tuple[float, float, float, float]:
    """Coverage of a level's coefficient over joint universes, and how often p finds what is not.

    Nothing matters, but each universe has an effect of its own, a universe's seeds vary about it,
    and each seed has reactions of its own to every level. All are normal.

    Parameters
    ----------
    scene
        Their deviations.
    trials
        Multiverses.
    seed
        Of the random numbers.

    Returns
    -------
    tuple
        Shares of the intervals that hold zero, of all levels and of `UNEQUAL`; shares of the trials
        in which some choice, and some pair, has an adjusted p of at most 0.05.
    """
    there = joint_universes()
    names = tuple(one.name for one in there)
    levels = pd.get_dummies(pd.DataFrame([dict(one.levels) for one in there])).to_numpy(float)
    multiverse = Multiverse(pd.DataFrame({"universe": names}), (), "helens", "ft", 2000, "gp", 1.0)
    choice, level = UNEQUAL
    deviation = np.array([scene.unequal if one.levels[choice] == level else 1.0 for one in there])
    rng, held, found, paired = np.random.default_rng(seed), [], 0, 0
    for _ in range(trials):
        reactions = scene.reaction * rng.standard_normal((levels.shape[1], SEEDS_OF_UNIVERSES))
        own = deviation[:, None] * rng.standard_normal((len(there), 1))
        noise = scene.noise * rng.standard_normal((len(there), SEEDS_OF_UNIVERSES))
        curve = ClaimCurve(
            "C7", 0, "", "ft", Stated(), names, own + noise + levels @ reactions,
            tuple(range(SEEDS_OF_UNIVERSES)), ("undecided",) * len(there),
        )  # fmt: skip
        jointly = effects_jointly(curve, multiverse)
        holds = (jointly["low"] <= 0) & (jointly["high"] >= 0)
        one = (jointly["choice"] == choice) & (jointly["level"] == level)
        held.append([holds.mean(), holds[one].mean()])
        found += bool((jointly["p"] <= 0.05).any())
        paired += bool((pairs_of_choices(curve, multiverse)["p"] <= 0.05).any())
    covered, of_one = np.mean(held, axis=0).tolist()
    return covered, of_one, found / trials, paired / trials


def percent(share: float) -> str:
    """Write a share in per cent."""
    return f"{100 * share:.1f}"


def coverage_table(trials: int) -> list[str]:
    """Coverage of nominal 95 % by interval, skewness and number of seeds."""
    lines = [
        "| skewness | seeds | t | percentile | BCa | t wholly below | t wholly above |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for skew in SKEWS:
        for n in SEEDS:
            found = {kind: missed(kind, skew, n, trials) for kind in INTERVALS}
            cells = [percent(one.covered) for one in found.values()]
            cells += [percent(found["t"].below), percent(found["t"].above)]
            lines.append(f"| {skew} | {n} | {' | '.join(cells)} |")
    return lines


def verdict_table(trials: int, seeds: Sequence[int] = (6, 10)) -> list[str]:
    """Rates of false verdicts by claim."""
    lines = [
        "| claim | seeds | false, all methods equal | contradicted, all at their bounds | "
        "supported, one at its bound |",
        "|---|---:|---:|---:|---:|",
    ]
    for name in COMPARISONS:
        for n in seeds:
            rates = [
                verdicts(name, equal, n, trials)[false_when_equal(name)],
                verdicts(name, at_bound, n, trials)["contradicted"],
                verdicts(name, first_at_bound, n, trials)["supported"],
            ]
            cells = " | ".join(percent(rate / trials) for rate in rates)
            lines.append(f"| {name} | {n} | {cells} |")
    return lines


def skewed_table(trials: int, seeds: Sequence[int] = (6, 10)) -> list[str]:
    """Largest rate of false verdicts over the claims, by skewness."""
    lines = [
        "| skewness | seeds | contradicted, all at their bounds | supported, one at its bound |",
        "|---:|---:|---:|---:|",
    ]
    for skew in SKEWS[1:]:
        for n in seeds:
            cells = []
            for shift, false in ((at_bound, "contradicted"), (first_at_bound, "supported")):
                rates = {
                    name: verdicts(name, shift, n, trials, skew=skew)[false] / trials
                    for name in COMPARISONS
                }
                worst = max(rates, key=lambda name: rates[name])
                cells.append(f"{percent(rates[worst])} ({worst})")
            lines.append(f"| {skew} | {n} | {' | '.join(cells)} |")
    return lines


def maps_table(trials: int) -> list[str]:
    """Coverage of the leaderboard's intervals by the number of seeds a map."""
    lines = ["| seeds a map | area | probability of improvement |", "|---:|---:|---:|"]
    for n in (2, 3, 5, 10):
        cells = " | ".join(percent(share) for share in on_maps(n, trials))
        lines.append(f"| {n} | {cells} |")
    return lines


def universes_table(trials: int) -> list[str]:
    """Coverage and false findings over joint universes, by what varies how much."""
    lines = [
        "| noise | reaction | unequal | covered | the unequal level's | some choice found | "
        "some pair found |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for scene in SCENES:
        cells = " | ".join(percent(share) for share in on_universes(scene, trials // 10))
        lines.append(f"| {scene.noise:g} | {scene.reaction:g} | {scene.unequal:g} | {cells} |")
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.coverage")
    parser.add_argument(
        "trials", type=int, nargs="?", default=2000, help="of each line (%(default)s)"
    )
    trials = parser.parse_args().trials
    for table in (coverage_table, verdict_table, skewed_table, maps_table, universes_table):
        print("\n".join(table(trials)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
