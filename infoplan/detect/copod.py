"""Copula-based outlier detection of the measured elevation (paper, Section IV-A)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.detect.evidence import Evidence, Judgement


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
    if score == "pyod":
        detector = _pyod_copod(contamination)
        detector.fit(samples.measured[:, None])
        return detector.labels_.astype(bool), detector.decision_scores_.astype(np.float64)
    scores = paper_score(samples.measured)
    # PyOD's rule: the threshold is the percentile, and a score must lie above it.
    return scores > np.percentile(scores, 100 * (1 - contamination)), scores


def paper_score(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest negative log probability among the tails of the empirical copula, shape (n,).

    The skewness-corrected tail is one of the two others in one dimension, so the maximum over the
    three is the maximum over both tails.
    """
    ordered = np.sort(y)
    left = np.searchsorted(ordered, y, side="right") / len(y)
    # Counted before dividing: 1 - left would round ties between the tails apart.
    right = (len(y) - np.searchsorted(ordered, y, side="left")) / len(y)
    return -np.log(np.minimum(left, right))


def _pyod_copod(contamination: float):  # type: ignore[no-untyped-def]
    # PyOD imports pyplot and numba: only a mission that uses it should wait for them.
    from pyod.models.copod import COPOD

    return COPOD(contamination=contamination)
