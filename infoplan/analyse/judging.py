"""The rules by which a claim is judged: from intervals to a verdict."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from infoplan.analyse.statistics import Interval
from infoplan.wording import harmless

SUPPORTED, CONTRADICTED, UNDECIDED, MISSING = "supported", "contradicted", "undecided", "missing"

HOPELESS = 100
"""So many times the present seeds, and more, are none that would help."""


@dataclass(frozen=True)
class Stated:
    """The side on which a claim says that an effect lies: between two numbers."""

    low: float = -math.inf
    high: float = math.inf


BELOW_ZERO, ABOVE_ZERO = Stated(high=0.0), Stated(low=0.0)


@dataclass(frozen=True)
class Comparison:
    """One of the comparisons that a claim names.

    Attributes
    ----------
    what
        The effect, in words.
    unit
        Its unit; empty for a share.
    stated
        Where the claim says it lies.
    effect
        Mean over seeds with its 95 % interval; no seeds if something is missing.
    interquartile_mean
        Of the same numbers: a mean that single seeds cannot pull away.
    lacks
        What is missing, in words; empty if nothing.
    """

    what: str
    unit: str
    stated: Stated
    effect: Interval
    interquartile_mean: float = math.nan
    lacks: str = ""

    @property
    def verdict(self) -> str:
        """Supported, contradicted, undecided or missing."""
        return MISSING if self.lacks else judge(self.effect, self.stated)


@dataclass(frozen=True, repr=False)
class Claim:
    """One of the paper's claims, judged.

    Attributes
    ----------
    name, text
        As C1, and what it says.
    comparisons
        All that it names.
    commands
        Commands that make what is missing.
    where
        Share of outliers and scope of the runs compared, in words.
    """

    name: str
    text: str
    comparisons: tuple[Comparison, ...]
    commands: tuple[str, ...] = ()
    where: str = ""

    def __repr__(self) -> str:
        """Say in a line what is claimed, and the verdict."""
        return harmless(f"Claim({self.name} {self.verdict}: {self.text})")

    @property
    def verdict(self) -> str:
        """Supported, contradicted, undecided or missing."""
        return overall([comparison.verdict for comparison in self.comparisons])

    @property
    def more_seeds(self) -> float | None:
        """How many more seeds an undecided claim would roughly need; see `more_seeds`."""
        return more_seeds(self.comparisons) if self.verdict == UNDECIDED else None


def judge(effect: Interval, stated: Stated) -> str:
    """Judge one comparison.

    Supported if the whole interval lies on the stated side, contradicted if it lies wholly on the
    other, else undecided; so is a single seed, which has no interval.
    """
    if math.isnan(effect.low):
        return UNDECIDED
    if stated.low < effect.low and effect.high < stated.high:
        return SUPPORTED
    if effect.high < stated.low or stated.high < effect.low:
        return CONTRADICTED
    return UNDECIDED


def overall(verdicts: Sequence[str]) -> str:
    """Verdict of a claim from those of its comparisons.

    Contradicted if one is; else missing if one is; supported if all are; else undecided.
    """
    for decisive in (CONTRADICTED, MISSING):
        if decisive in verdicts:
            return decisive
    return SUPPORTED if all(verdict == SUPPORTED for verdict in verdicts) else UNDECIDED


def seeds_needed(effect: Interval, stated: Stated) -> float:
    """Roughly how many seeds would decide a comparison, if the effect stayed as it is.

    The interval's width shrinks with the root of the number of seeds; it must no longer reach the
    next bound of the stated side.

    Returns
    -------
    float
        Infinity if no sensible number would do, NaN if a single seed gives no width.
    """
    if math.isnan(effect.low):
        return math.nan
    inside = stated.low < effect.mean < stated.high
    distances = [abs(effect.mean - bound) for bound in (stated.low, stated.high)]
    distance = min(distances)
    half_width = (effect.high - effect.low) / 2
    if distance == 0 or (not inside and math.isinf(distance)):
        return math.inf
    needed = effect.n * (half_width / distance) ** 2
    return math.inf if needed > HOPELESS * effect.n else max(effect.n + 1, math.ceil(needed))


def more_seeds(comparisons: Sequence[Comparison]) -> float:
    """Roughly how many more seeds would decide an undecided claim.

    Where an estimate lies on the other side the claim heads for contradicted, which the first such
    comparison decides; otherwise for supported, which the last one decides.

    Returns
    -------
    float
        Infinity if none would help, NaN if a single seed does not tell.
    """
    undecided = [comparison for comparison in comparisons if comparison.verdict == UNDECIDED]
    needs = [
        (
            seeds_needed(item.effect, item.stated) - item.effect.n,
            item.stated.low < item.effect.mean < item.stated.high,
        )
        for item in undecided
    ]
    if any(math.isnan(need) for need, _ in needs):
        return math.nan
    against = [need for need, inside in needs if not inside and not math.isinf(need)]
    return min(against) if against else max(need for need, _ in needs)
