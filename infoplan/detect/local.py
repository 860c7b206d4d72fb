"""Outliers as measurements unlike those of their nearest neighbours."""

from typing import Any

import numpy as np

from infoplan.detect.evidence import NORMAL, Evidence, Judgement, rounding_of


def local(
    samples: Evidence,
    model: Any,
    rng: np.random.Generator,
    *,
    neighbours: int = 10,
    threshold: float = 3.5,
) -> Judgement:
    """Flag samples far from the median of their nearest neighbours, by the neighbours' spread.

    The score of a sample is |y - m| / s with m the median of the measurements of its nearest
    neighbours in the plane, itself not among them, and s = 1.4826 times their median absolute
    deviation from m: the modified z-score of Iglewicz and Hoaglin (1993), who suggest 3.5.

    Parameters
    ----------
    samples
        Neighbours are looked for among `Evidence.candidates`.
    model, rng
        As for any detector; unused.
    neighbours
        How many; of equally near ones the earlier collected.
    threshold
        Largest score kept.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
        NaN where not judged. Where all neighbours agree to rounding, s is that rounding.
    """
    among, judged = np.flatnonzero(samples.candidates), np.flatnonzero(samples.judged)
    offset = samples.x[judged, None, :] - samples.x[among]
    distance = offset[..., 0] ** 2 + offset[..., 1] ** 2
    distance[judged[:, None] == among] = np.inf
    count = min(neighbours, len(among) - 1)
    nearest = among[np.argsort(distance, axis=1, kind="stable")[:, :count]]
    around = samples.measured[nearest]
    middle = np.median(around, axis=1)
    spread = NORMAL * np.median(np.abs(around - middle[:, None]), axis=1)
    flagged, score = np.zeros(len(samples), dtype=bool), np.full(len(samples), np.nan)
    score[judged] = np.abs(samples.measured[judged] - middle) / np.maximum(
        spread, rounding_of(samples.measured)
    )
    flagged[judged] = score[judged] > threshold
    return flagged, score
