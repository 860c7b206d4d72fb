"""Copula-based outlier detection of the measured elevation (paper, Section IV-A)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.detect.evidence import Evidence, Judgement

Floats = NDArray[np.float64]


def copod(
    samples: Evidence,
    model: Any,
    rng: np.random.Generator,
    *,
    contamination: float = 0.1,
    score: str = "pyod",
) -> Judgement:
    """Fit COPOD on all measurements and flag the most extreme ones.

    Parameters
    ----------
    samples
        The paper's COPOD sees the measurements alone, of all samples collected so far.
    model, rng
        As for any detector; unused.
    contamination
        Share of the data above the threshold, in (0, 0.5].
    score
        ``pyod``: PyOD's, the larger of the skewness-corrected and of the mean of both tails;
        ``paper``: the maximum over left, right and skewness-corrected tail.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
    """
    scores = pyod_score(samples.measured) if score == "pyod" else paper_score(samples.measured)
    # PyOD's rule: the threshold is the percentile, and a score must lie above it.
    return scores > np.percentile(scores, 100 * (1 - contamination)), scores


def pyod_score(y: Floats) -> Floats:
    """Larger of the skewness-corrected tail and the mean of both tails, shape (n,).

    The numbers of PyOD's COPOD to the last bit, in each of its steps; its import would take longer
    than everything else that a worker loads.
    """
    n, ordered = len(y), np.sort(y)
    probabilities = np.linspace(np.ones(1) / n, np.ones(1), n)
    left = -1 * np.log(probabilities[np.searchsorted(ordered, y, side="right") - 1])
    right = -1 * np.log(probabilities[n - np.searchsorted(ordered, y, side="left") - 1])
    sign = _skewness_sign(y[:, None])
    corrected = left * -1 * np.sign(sign - 1) + right * np.sign(sign + 1)
    scores: Floats = np.maximum(corrected, np.add(left, right) / 2)[:, 0]
    return scores


def _skewness_sign(columns: Floats) -> Floats:
    """Sign of the skewness of each column, 0 where its values are equal to rounding."""
    mean = columns.mean(axis=0, keepdims=True)
    centred = columns - mean
    second, third = np.mean(centred**2, axis=0), np.mean(centred**2 * centred, axis=0)
    constant = second <= (np.finfo(np.float64).eps * mean[0]) ** 2
    return np.where(constant, 0.0, np.sign(third))


def paper_score(y: Floats) -> Floats:
    """Largest negative log probability among the tails of the empirical copula, shape (n,).

    The skewness-corrected tail is one of the two others in one dimension, so the maximum over the
    three is the maximum over both tails.
    """
    ordered = np.sort(y)
    left = np.searchsorted(ordered, y, side="right") / len(y)
    # Counted before dividing: 1 - left would round ties between the tails apart.
    right = (len(y) - np.searchsorted(ordered, y, side="left")) / len(y)
    return -np.log(np.minimum(left, right))
