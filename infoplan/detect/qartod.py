"""Quality tests of real-time ocean data, as field people know them (QARTOD, IOOS)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.detect.evidence import NORMAL, Evidence, Judgement, rounding_of

Floats = NDArray[np.float64]


def qartod(
    samples: Evidence,
    model: Any,
    rng: np.random.Generator,
    *,
    gross_range: float | None = 5.0,
    spike: float | None = 8.0,
    rate: float | None = 8.0,
    flat: int | None = 3,
    tolerance: float = 0.0,
) -> Judgement:
    """Flag samples that fail a test: gross range, spike, rate of change or flat line.

    The manuals ask for thresholds in the sensor's unit. Here they are multiples of what is usual
    among all samples so far, a median that outliers hardly move, so that they suit any terrain. A
    sample's score is the largest of its four shares of what is allowed; above 1 it fails.

    Parameters
    ----------
    samples
        All of them, in order of collection; the tests see flagged ones, too, as a stream has them.
    model, rng
        As for any detector; unused.
    gross_range
        Largest distance from the median of all, in 1.4826 times their median absolute deviation.
    spike
        Largest distance from the middle of the sample before and the one after, in medians of this
        distance; the last sample has none yet.
    rate
        Largest step from the sample before, in medians of the steps. A spike has two: the sample
        after it fails as well.
    flat
        How many samples before it a value may repeat; the next one that does fails.
    tolerance
        Values differ if they do by more than this, terrain's unit.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
        NaN where not judged.
    """
    y, smallest = samples.measured, rounding_of(samples.measured)
    steps, bends = np.zeros(len(y)), np.zeros(len(y))
    steps[1:] = np.abs(np.diff(y))
    bends[1:-1] = np.abs(y[1:-1] - (y[:-2] + y[2:]) / 2)
    shares = [np.zeros(len(y))]
    if gross_range is not None:
        away = np.abs(y - np.median(y))
        shares.append(away / max(gross_range * NORMAL * float(np.median(away)), smallest))
    if spike is not None and len(y) > 2:
        shares.append(bends / max(spike * float(np.median(bends[1:-1])), smallest))
    if rate is not None and len(y) > 1:
        shares.append(steps / max(rate * float(np.median(steps[1:])), smallest))
    if flat is not None:
        shares.append(repeats(y, flat, tolerance) / flat)
    score = np.where(samples.judged, np.max(shares, axis=0), np.nan)
    return score > 1.0, score


def repeats(y: Floats, most: int, tolerance: float) -> Floats:
    """Count how many samples before each are the same as it and each other, to a tolerance.

    Parameters
    ----------
    y
        Values, shape (n,).
    most
        Beyond one more than this is not counted.
    tolerance
        Largest range of values that are the same.

    Returns
    -------
    ndarray, shape (n,)
    """
    count, low, high = np.zeros(len(y)), y.copy(), y.copy()
    for back in range(1, min(most + 1, len(y) - 1) + 1):
        low[back:] = np.minimum(low[back:], y[:-back])
        high[back:] = np.maximum(high[back:], y[:-back])
        same = high[back:] - low[back:] <= tolerance
        count[back:] += same
    return count
