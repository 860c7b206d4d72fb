"""Outliers as measurements unlike those of their nearest neighbours."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from infoplan.detect.evidence import NORMAL, Evidence, Judgement, rounding_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MARGIN = 1e-9
"""Share of a distance that rounding may hide."""


def local(
    samples: Evidence,
    model: Any,
    rng: np.random.Generator,
    *,
    neighbours: int = 10,
    threshold: float = 3.5,
) -> Judgement:
    """Flag samples far from the median of their nearest neighbours, by the neighbours' spread.

    The score of a sample is ``|y - m| / s`` with m the median of the measurements of its nearest
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
    count = min(neighbours, len(among) - 1)
    nearest = _nearest(samples.x, among, judged, count)
    around = samples.measured[nearest]
    middle = np.median(around, axis=1)
    spread = NORMAL * np.median(np.abs(around - middle[:, None]), axis=1)
    flagged, score = np.zeros(len(samples), dtype=bool), np.full(len(samples), np.nan)
    score[judged] = np.abs(samples.measured[judged] - middle) / np.maximum(
        spread, rounding_of(samples.measured)
    )
    flagged[judged] = score[judged] > threshold
    return flagged, score


def _nearest(x: Floats, among: Integers, asked: Integers, count: int) -> Integers:
    """Find the nearest of some samples to others, each not to itself.

    Parameters
    ----------
    x
        Positions of all, shape (n, 2).
    among, asked
        Numbers of those that are looked for, ascending, and of those that are asked about.
    count
        How many of them.

    Returns
    -------
    ndarray, shape (len(asked), count)
        Numbers, the nearest first, of equally near ones the earlier.
    """
    # Of a place where many were taken no more can be among the nearest, and one of them be asked.
    _, place = np.unique(x[among], axis=0, return_inverse=True)
    order = np.argsort(place.ravel(), kind="stable")
    ranked = place.ravel()[order]
    rank = np.empty(len(among), dtype=np.int64)
    rank[order] = np.arange(len(among)) - np.searchsorted(ranked, ranked)
    among = among[rank <= count]
    tree = cKDTree(x[among])
    distance, _ = tree.query(x[asked], k=[count + 1])
    # One more is asked for, as the nearest is mostly itself; the margin is for rounding.
    found = tree.query_ball_point(x[asked], distance[:, 0] * (1.0 + MARGIN), return_sorted=True)
    sizes = np.array([len(near) for near in found])
    near = among[np.concatenate(found).astype(np.int64)]
    number = np.repeat(np.arange(len(asked)), sizes)
    offset = x[asked[number]] - x[near]
    squares = offset[:, 0] ** 2 + offset[:, 1] ** 2
    squares[near == asked[number]] = np.inf
    order = np.lexsort((squares, number))  # stable: of equally near ones the earlier
    starts = np.cumsum(sizes) - sizes
    return near[order][starts[:, None] + np.arange(count)]
