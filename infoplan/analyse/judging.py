"""The rules by which a claim is judged: from one number a seed to a verdict.

Why these: docs/statistics.md.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.curves import EARLY
from infoplan.analyse.statistics import (
    TAIL,
    Alternative,
    Interval,
    holm,
    interquartile_mean,
    mean_interval,
    sign_flip_test,
    t_test,
)
from infoplan.html_table import html_table
from infoplan.wording import counted, harmless, interval

SUPPORTED, CONTRADICTED, UNDECIDED, MISSING = "supported", "contradicted", "undecided", "missing"

SEEDS_NEEDED = 6
"""With fewer seeds no exact one-sided p can be as small as 0.025: 2^-5 is 0.031."""

FEW_SEEDS = "with fewer than six seeds nothing is decided, and intervals are rough"

MARGIN = 0.05
"""What is negligible: of shares five points in a hundred, of elevations and errors this share of
the terrain's standard deviation."""

Test = Callable[[NDArray[np.float64], Alternative], float]
"""A test that the mean of some numbers is zero."""


@dataclass(frozen=True)
class Stated:
    """The side on which a claim says that an effect lies: between two numbers."""

    low: float = -math.inf
    high: float = math.inf

    def times(self, margin: float) -> "Stated":
        """Give the same in another unit: bounds of 1 become the margin."""
        return Stated(self.low * margin, self.high * margin)


@dataclass(frozen=True)
class Rules:
    """What is decided about claims after all missions are flown.

    Attributes
    ----------
    margin
        What is negligible: of shares so much, of elevations and errors this share of the terrain's
        standard deviation.
    early
        Which collected samples are early: from, to.
    """

    margin: float = MARGIN
    early: tuple[int, int] = EARLY


USUAL = Rules()
"""The rules where no others are given."""


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
    values
        The effect of each seed.
    among
        How many comparisons the claim names.
    lacks
        What is missing, in words; empty if nothing.
    above
        A mission's budget has to be above so many samples for it to have a value.
    """

    what: str
    unit: str
    stated: Stated
    values: Mapping[int, float]
    among: int = 1
    lacks: str = ""
    above: int = 0

    @cached_property
    def effect(self) -> Interval:
        """Mean over seeds with its 95 % t interval; no seeds if something is missing."""
        return mean_interval(self._numbers)

    @property
    def interquartile_mean(self) -> float:
        """Of the same numbers: a mean that single seeds cannot pull away."""
        return float(interquartile_mean(self._numbers)) if self.values else math.nan

    @cached_property
    def p_supported(self) -> float:
        """One-sided p that the effect does not lie where the claim says; 1 with too few seeds."""
        return p_inside(self._numbers, self.stated, t_test) if self._enough else 1.0

    @cached_property
    def p_contradicted(self) -> float:
        """One-sided p that it does lie there, times the number of comparisons of the claim."""
        if not self._enough:
            return 1.0
        return min(1.0, self.among * p_outside(self._numbers, self.stated, t_test))

    @cached_property
    def p_exact(self) -> float:
        """Exact p by sign flips, for the side on which the mean lies; uncorrected.

        That the effect does not lie where the claim says, if its mean does; else that it does.
        """
        inside = self.stated.low < self.effect.mean < self.stated.high
        return (p_inside if inside else p_outside)(self._numbers, self.stated, sign_flip_test)

    @property
    def verdict(self) -> str:
        """Supported, contradicted, undecided or missing."""
        if self.lacks:
            return MISSING
        if self.p_supported <= TAIL:
            return SUPPORTED
        return CONTRADICTED if self.p_contradicted <= TAIL else UNDECIDED

    @property
    def _enough(self) -> bool:
        return not self.lacks and len(self.values) >= SEEDS_NEEDED

    @property
    def _numbers(self) -> NDArray[np.float64]:
        return np.array(list(self.values.values()), dtype=float)


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
    collapsed
        How many missions of each method compared end with a collapsed model, and of how many that
        is known.
    p_holm
        `p`, adjusted by Holm for all claims that were judged together; NaN for a claim alone.
    """

    name: str
    text: str
    comparisons: tuple[Comparison, ...]
    commands: tuple[str, ...] = ()
    where: str = ""
    collapsed: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    p_holm: float = math.nan

    def __repr__(self) -> str:
        """Say in a line what is claimed, and the verdict."""
        return harmless(f"Claim({self.name} {self.verdict}: {self.text})")

    def _repr_html_(self) -> str:
        """Show it with its comparisons in a notebook."""
        return claims_page([self], repr(self))

    @property
    def verdict(self) -> str:
        """Supported, contradicted, undecided or missing."""
        return overall([comparison.verdict for comparison in self.comparisons])

    @property
    def p(self) -> float:
        """Two-sided p of the verdict: supported and contradicted have half the level each.

        Supported needs all comparisons, so their largest p counts, of contradicted the smallest.
        """
        supported = max(one.p_supported for one in self.comparisons)
        contradicted = min(one.p_contradicted for one in self.comparisons)
        return min(1.0, 2 * min(supported, contradicted))

    @property
    def survives(self) -> bool:
        """Whether it is decided, and still is after Holm's correction over all claims."""
        return self.verdict in (SUPPORTED, CONTRADICTED) and self.p_holm <= 2 * TAIL

    @property
    def seeds(self) -> int:
        """Fewest seeds of its comparisons."""
        return min(len(one.values) for one in self.comparisons)


class Claims(list[Claim]):
    """Claims that were judged together; a notebook shows them as a table."""

    def _repr_html_(self) -> str:
        """Show the claims with their comparisons in a notebook."""
        return claims_page(self, counted(len(self), "claim"))


def claims_page(claims: Sequence[Claim], caption: str) -> str:
    """Write claims as an HTML table: a row a claim, below it one a comparison.

    Parameters
    ----------
    claims
        Judged.
    caption
        Above them.
    """
    head = ["claim", "compared", "effect [95 %]", "seeds", "verdict"]
    rows: list[list[object]] = []
    for claim in claims:
        said = f"{claim.text} ({claim.where})" if claim.where else claim.text
        rows.append([claim.name, said, "", "", claim.verdict.upper()])
        for one in claim.comparisons:
            numbers = interval(one.effect.mean, one.effect.low, one.effect.high)
            shown = one.lacks or f"{numbers} {one.unit}".rstrip()
            rows.append(["", one.what, shown, one.effect.n, one.verdict])
    few = any(not one.lacks and len(one.values) < SEEDS_NEEDED for claim in claims
              for one in claim.comparisons)  # fmt: skip
    told = [FEW_SEEDS] if few else []
    commands = dict.fromkeys(command for claim in claims for command in claim.commands)
    told += [f"what is missing is to be had with {command}" for command in commands]
    return html_table(caption, rows, head, told)


def p_inside(values: NDArray[np.float64], stated: Stated, test: Test) -> float:
    """One-sided p that an effect does not lie between two bounds.

    Both bounds are tested and the larger p counts: two one-sided tests, where both are finite
    (Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15, 1987).
    """
    ps = []
    if math.isfinite(stated.low):
        ps.append(test(values - stated.low, "greater"))
    if math.isfinite(stated.high):
        ps.append(test(values - stated.high, "less"))
    return _or_one(max(ps))


def p_outside(values: NDArray[np.float64], stated: Stated, test: Test) -> float:
    """One-sided p that an effect lies between two bounds, corrected where both are finite."""
    ps = []
    if math.isfinite(stated.low):
        ps.append(test(values - stated.low, "less"))
    if math.isfinite(stated.high):
        ps.append(test(values - stated.high, "greater"))
    return _or_one(min(1.0, len(ps) * min(ps)))


def corrected(comparisons: Sequence[Comparison]) -> tuple[Comparison, ...]:
    """Tell each comparison of a claim among how many it is."""
    return tuple(replace(one, among=len(comparisons)) for one in comparisons)


def with_holm(claims: Sequence[Claim]) -> list[Claim]:
    """Adjust the p of claims that are judged together."""
    adjusted = holm([claim.p for claim in claims]).tolist()
    return [replace(claim, p_holm=p) for claim, p in zip(claims, adjusted, strict=True)]


def overall(verdicts: Sequence[str]) -> str:
    """Verdict of a claim from those of its comparisons.

    Contradicted if one is; else missing if one is; supported if all are; else undecided.
    """
    for decisive in (CONTRADICTED, MISSING):
        if decisive in verdicts:
            return decisive
    return SUPPORTED if all(verdict == SUPPORTED for verdict in verdicts) else UNDECIDED


def _or_one(p: float) -> float:
    """Decide nothing by numbers of which there is no p: infinite ones."""
    return 1.0 if math.isnan(p) else p
