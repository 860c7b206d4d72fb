"""Bootstrap over whole seeds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

RESAMPLES = 10_000


@dataclass(frozen=True)
class Interval:
    """A mean with its 95 % bootstrap interval; the interval is NaN for a single seed."""

    mean: float
    low: float
    high: float
    n: int


def bootstrap_mean(values: ArrayLike, *, resamples: int = RESAMPLES) -> Interval:
    """Mean over seeds with its 95 % percentile bootstrap interval.

    Parameters
    ----------
    values
        One number a seed; NaNs are left out.
    resamples
        Bootstrap resamples, drawn from a fixed seed.

    Returns
    -------
    Interval
        All NaN if no value is left.
    """
    sample = np.asarray(values, dtype=float)
    sample = sample[~np.isnan(sample)]
    if len(sample) == 0:
        return Interval(np.nan, np.nan, np.nan, 0)
    if len(sample) == 1:
        return Interval(float(sample[0]), np.nan, np.nan, 1)
    rng = np.random.default_rng(0)
    means = sample[rng.integers(len(sample), size=(resamples, len(sample)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Interval(float(sample.mean()), float(low), float(high), len(sample))
