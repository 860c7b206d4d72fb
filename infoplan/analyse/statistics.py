"""Means over seeds with t intervals, exact sign-flip tests, means over strata.

What each means, and how often it covers: docs/statistics.md.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import pandas as pd

TAIL = 0.025
"""Share that an interval of 95 % leaves out at each end."""

EXACT = 20
"""Of so many numbers all sign flips are tried, 2^20 of them; of more, a sample."""

SAMPLED = 100_000
"""How many sign flips are drawn where there are too many to try all."""

ROUNDING = 1e-12
"""Share by which two equal sums may differ."""

Floats = NDArray[np.float64]
Alternative = Literal["less", "greater", "two-sided"]


@dataclass(frozen=True)
class Interval:
    """A mean, or a probability, with its 95 % interval.

    Attributes
    ----------
    mean
        The estimate; NaN without a value.
    low, high
        Ends of the interval; NaN with fewer than two values.
    n
        Number of values: of seeds, most often.
    """

    mean: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class PairedDifference:
    """One minus the other, over the seeds that both have.

    Attributes
    ----------
    mean
        Of the differences, with its interval.
    interquartile_mean
        Of the differences: a mean that single seeds cannot pull away.
    p
        Two-sided, of all flips of their signs.
    differences
        One a seed, indexed by seed.
    """

    mean: Interval
    interquartile_mean: float
    p: float
    differences: "pd.Series[float]"


def interquartile_mean(values: ArrayLike) -> Floats:
    """Mean of the middle half, along the last axis.

    A quarter of the values, rounded down, is cut from each end, as `scipy.stats.trim_mean` does;
    with fewer than four values it is the plain mean.
    """
    ordered = np.sort(np.asarray(values, dtype=float), axis=-1)
    cut = ordered.shape[-1] // 4
    return np.asarray(ordered[..., cut : ordered.shape[-1] - cut].mean(axis=-1))


def mean_interval(values: ArrayLike) -> Interval:
    """Mean of one number a seed, with its 95 % t interval.

    Parameters
    ----------
    values
        One number a seed; NaNs are left out.

    Returns
    -------
    Interval
        All NaN if no value is left; without an interval for a single value.
    """
    sample = _known(values)
    if not len(sample):
        return Interval(np.nan, np.nan, np.nan, 0)
    mean, low, high = mean_band(sample[:, None])[:, 0].tolist()
    return Interval(mean, low, high, len(sample))


def mean_band(curves: ArrayLike) -> Floats:
    """Mean of several curves with a 95 % t interval at each point.

    Parameters
    ----------
    curves
        Shape (seeds, points).

    Returns
    -------
    ndarray, shape (3, points)
        Mean, lower and upper end; the ends are NaN for a single seed, and where a value is
        infinite.
    """
    values = np.asarray(curves, dtype=float)
    n = len(values)
    with np.errstate(invalid="ignore", over="ignore"):
        mean = values.mean(axis=0)
        if n < 2:
            return np.stack([mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)])
        from scipy import special

        half = special.stdtrit(n - 1, 1 - TAIL) * values.std(axis=0, ddof=1) / np.sqrt(n)
        return np.stack([mean, mean - half, mean + half])


def ratio_band(parts: ArrayLike, wholes: ArrayLike) -> Floats:
    """Ratio of sums over seeds, a share, with a 95 % t interval at each point.

    The error of the ratio is that of the mean of part - ratio * whole (Cochran, Sampling
    Techniques, 1977, section 6.3).

    Parameters
    ----------
    parts, wholes
        Numerators and denominators of each seed, shape (seeds, points).

    Returns
    -------
    ndarray, shape (3, points)
        Ratio, lower and upper end, within 0 and 1; NaN where the denominators add up to 0, and at
        the ends for a single seed.
    """
    part, whole = np.asarray(parts, dtype=float), np.asarray(wholes, dtype=float)
    n, total = len(whole), whole.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = part.sum(axis=0) / total
        if n < 2:
            return np.stack([ratio, np.full_like(ratio, np.nan), np.full_like(ratio, np.nan)])
        residuals = mean_band(part - ratio * whole)
        half = (residuals[2] - residuals[0]) * n / total
    return np.stack([ratio, np.maximum(ratio - half, 0.0), np.minimum(ratio + half, 1.0)])


def stratified_mean(strata: Iterable[ArrayLike], level: float = 0.95) -> Interval:
    """Mean over strata, each counting alike, with its t interval on these strata.

    Only the values within a stratum are taken as drawn at random, so it says nothing of other
    strata. Degrees of freedom after Welch and Satterthwaite (Biometrics Bulletin 2, 1946).

    Parameters
    ----------
    strata
        The values of each stratum, say one number a seed for each map; NaNs are left out.
    level
        Probability with which the interval holds the mean over seeds.

    Returns
    -------
    Interval
        Without an interval if a stratum has a single value; all NaN if one has none. `n` counts
        the values of all strata.
    """
    samples = [_known(values) for values in strata]
    n = sum(map(len, samples))
    if not samples or not all(map(len, samples)):
        return Interval(np.nan, np.nan, np.nan, n)
    with np.errstate(invalid="ignore", over="ignore"):
        mean = float(np.mean([sample.mean() for sample in samples]))
        if min(map(len, samples)) < 2:
            return Interval(mean, np.nan, np.nan, n)
        variances = np.array([sample.var(ddof=1) / len(sample) for sample in samples])
        total = variances.sum()
        if total == 0:
            return Interval(mean, mean, mean, n)
        freedom = total**2 / np.sum(variances**2 / [len(sample) - 1 for sample in samples])
        from scipy import special

        half = float(special.stdtrit(freedom, (1 + level) / 2) * np.sqrt(total)) / len(samples)
    return Interval(mean, mean - half, mean + half, n)


def probability_below_zero(strata: Iterable[ArrayLike]) -> Interval:
    """Probability that a paired difference is below zero, each stratum counting alike.

    Of the areas of one method less those of another it is the probability that the one improves
    on the other (Agarwal et al., NeurIPS 2021, here paired by seed). The interval is Clopper and
    Pearson's (Biometrika 26, 1934), which never covers less than it says, of as many numbers as
    have the same variance.

    Parameters
    ----------
    strata
        The differences of each stratum; a tie counts half, NaNs are left out.

    Returns
    -------
    Interval
        All NaN if a stratum has no value. `n` counts the values of all strata.
    """
    samples = [_known(values) for values in strata]
    n = sum(map(len, samples))
    if not samples or not all(map(len, samples)):
        return Interval(np.nan, np.nan, np.nan, n)
    below = [float(np.mean((sample < 0) + 0.5 * (sample == 0))) for sample in samples]
    mean = float(np.mean(below))
    worth = len(samples) ** 2 / sum(1 / len(sample) for sample in samples)
    hits = mean * worth
    from scipy import special

    low = float(special.betaincinv(hits, worth - hits + 1, TAIL)) if hits > 0 else 0.0
    high = float(special.betaincinv(hits + 1, worth - hits, 1 - TAIL)) if hits < worth else 1.0
    return Interval(mean, low, high, n)


def t_test(values: ArrayLike, alternative: Alternative = "two-sided") -> float:
    """Give p of Student's t test that the mean of some numbers is zero.

    Parameters
    ----------
    values
        At least two; NaNs are left out.
    alternative
        Where the mean lies otherwise: ``less`` or ``greater`` than zero, or on either side.

    Returns
    -------
    float
        NaN if a value is infinite or there are too few; of numbers without spread, 0 on the side
        of the alternative and 1 elsewhere.
    """
    sample = _known(values)
    n = len(sample)
    if n < 2 or not np.isfinite(sample).all():
        return np.nan
    mean, error = sample.mean(), sample.std(ddof=1) / np.sqrt(n)
    rounding = ROUNDING * np.abs(sample).max()
    if error <= rounding and abs(mean) <= rounding:
        return 1.0
    ratio = mean / error if error > rounding else np.copysign(np.inf, mean)
    from scipy import special

    below = float(special.stdtr(n - 1, ratio))
    above = float(special.stdtr(n - 1, -ratio))
    return {"less": below, "greater": above, "two-sided": min(1.0, 2 * min(below, above))}[
        alternative
    ]


def sign_flip_test(values: ArrayLike, alternative: Alternative = "two-sided") -> float:
    """Give the exact p of numbers being symmetric about zero, by flipping their signs.

    The share of sign flips whose sum is as far out as the sum found: of all 2^n up to 20 numbers,
    else of 100 000 drawn from a fixed seed, the one found counted among them.

    Parameters
    ----------
    values
        NaNs are left out.
    alternative
        Which sums are far out: the ``less``, the ``greater``, or both.

    Returns
    -------
    float
        NaN without a value, or if one is infinite.
    """
    sample = _known(values)
    if not len(sample) or not np.isfinite(sample).all():
        return np.nan
    if len(sample) <= EXACT:
        sums = np.zeros(1)
        for value in sample:
            sums = np.concatenate([sums + value, sums - value])
    else:
        drawn = np.random.default_rng(0).integers(2, size=(SAMPLED, len(sample)), dtype=np.int8)
        sums = np.append((2 * drawn - 1) @ sample, sample.sum())
    found, slack = sample.sum(), ROUNDING * np.abs(sample).sum()
    if alternative == "two-sided":
        far = np.abs(sums) >= abs(found) - slack
    elif alternative == "less":
        far = sums <= found + slack
    else:
        far = sums >= found - slack
    return float(far.mean())


def holm(p: ArrayLike) -> Floats:
    """Adjust several p values so that the chance of one false rejection among them stays small.

    Parameters
    ----------
    p
        One a hypothesis.

    Returns
    -------
    ndarray
        In their order: a hypothesis is rejected at a level if its adjusted p is at most that level
        (Holm, Scandinavian Journal of Statistics 6, 1979).
    """
    values = np.asarray(p, dtype=float)
    order = np.argsort(values, kind="stable")
    stepped = np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1))
    adjusted = np.empty_like(values)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def paired_difference(a: "pd.Series[float]", b: "pd.Series[float]") -> PairedDifference:
    """Differences a - b, paired by seed.

    Parameters
    ----------
    a, b
        One number a seed, indexed by seed; seeds that only one has, and NaNs, are left out.
    """
    differences = (a - b).dropna().astype(float).sort_index()
    middle = float(interquartile_mean(differences)) if len(differences) else np.nan
    return PairedDifference(
        mean_interval(differences), middle, sign_flip_test(differences), differences
    )


def _known(values: ArrayLike) -> Floats:
    sample = np.asarray(values, dtype=float)
    return sample[~np.isnan(sample)]
