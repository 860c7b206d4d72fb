"""Bootstrap over whole seeds, differences paired by seed, and means over strata."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import pandas as pd

RESAMPLES = 10_000

Statistic = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""A statistic over the last axis of an array."""


@dataclass(frozen=True)
class Interval:
    """A mean, plain or interquartile, with its 95 % interval over seeds.

    Attributes
    ----------
    mean
        The mean; NaN without a value.
    low, high
        Ends of the interval; NaN with fewer than two seeds.
    n
        Number of seeds.
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
    mean, interquartile_mean
        Of the differences, with their intervals.
    differences
        One a seed, indexed by seed.
    """

    mean: Interval
    interquartile_mean: Interval
    differences: "pd.Series[float]"


def interquartile_mean(values: ArrayLike) -> NDArray[np.float64]:
    """Mean of the middle half, along the last axis.

    A quarter of the values, rounded down, is cut from each end, as `scipy.stats.trim_mean` does;
    with fewer than four values it is the plain mean.
    """
    ordered = np.sort(np.asarray(values, dtype=float), axis=-1)
    cut = ordered.shape[-1] // 4
    return np.asarray(ordered[..., cut : ordered.shape[-1] - cut].mean(axis=-1))


def bootstrap(
    values: ArrayLike, statistic: Statistic, *, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Statistic of one number a seed, with its 95 % percentile bootstrap interval.

    Parameters
    ----------
    values
        One number a seed; NaNs are left out.
    statistic
        Works along the last axis.
    resamples
        Number of bootstrap resamples.
    seed
        Of the resampling: the same values give the same interval.

    Returns
    -------
    Interval
        All NaN if no value is left; without an interval for a single value.
    """
    sample = np.asarray(values, dtype=float)
    sample = sample[~np.isnan(sample)]
    n = len(sample)
    if n == 0:
        return Interval(np.nan, np.nan, np.nan, 0)
    if n == 1:
        return Interval(float(sample[0]), np.nan, np.nan, 1)
    drawn = np.random.default_rng(seed).integers(n, size=(resamples, n))
    low, high = np.quantile(statistic(sample[drawn]), [0.025, 0.975])
    return Interval(float(statistic(sample)), float(low), float(high), n)


def bootstrap_mean(values: ArrayLike, *, resamples: int = RESAMPLES) -> Interval:
    """Mean over seeds with its 95 % percentile bootstrap interval; arguments as in `bootstrap`."""
    return bootstrap(values, _mean, resamples=resamples)


def bootstrap_band(curves: ArrayLike, *, resamples: int = RESAMPLES) -> NDArray[np.float64]:
    """Mean of several curves with a pointwise 95 % bootstrap band; whole seeds are resampled.

    Parameters
    ----------
    curves
        Shape (seeds, points).
    resamples
        Number of bootstrap resamples, drawn from a fixed seed.

    Returns
    -------
    ndarray, shape (3, points)
        Mean, lower and upper end; the ends are NaN for a single seed.
    """
    values = np.asarray(curves, dtype=float)
    n, points = values.shape
    mean = values.mean(axis=0)
    if n < 2:
        return np.stack([mean, np.full(points, np.nan), np.full(points, np.nan)])
    drawn = np.random.default_rng(0).integers(n, size=(resamples, n))
    # How often each seed was drawn, times the curves: the means of all resamples at once.
    weights = np.stack([np.sum(drawn == seed, axis=1) for seed in range(n)], axis=1) / n
    low, high = np.quantile(weights @ values, [0.025, 0.975], axis=0)
    return np.stack([mean, low, high])


def paired_difference(
    a: "pd.Series[float]", b: "pd.Series[float]", *, resamples: int = RESAMPLES
) -> PairedDifference:
    """Differences a - b, paired by seed.

    Parameters
    ----------
    a, b
        One number a seed, indexed by seed; seeds that only one has, and NaNs, are left out.
    resamples
        Number of bootstrap resamples.
    """
    differences = (a - b).dropna().astype(float).sort_index()
    return PairedDifference(
        bootstrap(differences, _mean, resamples=resamples),
        bootstrap(differences, interquartile_mean, resamples=resamples),
        differences,
    )


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values.mean(axis=-1))


@dataclass(frozen=True)
class StratifiedMean:
    """Mean over strata, each of which counts alike, with its standard error.

    Attributes
    ----------
    mean
        Of the strata's means.
    error
        Its standard error; NaN if a stratum has a single value.
    dof
        Degrees of freedom of the error, after Welch and Satterthwaite.
    n
        Number of values.
    """

    mean: float
    error: float
    dof: float
    n: int

    def bound(self, probability: float) -> float:
        """Bound that the true mean lies below with a probability; NaN if the error is unknown."""
        from scipy.special import stdtrit

        return self.mean + float(stdtrit(self.dof, probability)) * self.error

    @property
    def interval(self) -> Interval:
        """The mean with its 95 % t interval."""
        return Interval(self.mean, self.bound(0.025), self.bound(0.975), self.n)


def stratified_mean(strata: Sequence[ArrayLike]) -> StratifiedMean:
    """Mean over strata that are all there are, such as maps; values are drawn within each alone.

    Parameters
    ----------
    strata
        Independent values of each stratum, at least one; their number and variance may differ.

    Returns
    -------
    StratifiedMean
        Its t interval holds the truth as often as it says also with few strata, over which a
        bootstrap has next to nothing to resample (Welch, 1947; Satterthwaite, 1946).
    """
    values = [np.asarray(stratum, dtype=float) for stratum in strata]
    sizes = np.array([len(stratum) for stratum in values])
    mean = float(np.mean([stratum.mean() for stratum in values]))
    n = int(sizes.sum())
    if sizes.min() < 2:
        return StratifiedMean(mean, np.nan, np.nan, n)
    squares = np.array([stratum.var(ddof=1) for stratum in values]) / sizes / len(values) ** 2
    total = float(squares.sum())
    shares = squares / total if total > 0 else (sizes - 1) / (sizes - 1).sum()
    return StratifiedMean(mean, total**0.5, float(1 / np.sum(shares**2 / (sizes - 1))), n)
