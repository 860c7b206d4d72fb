"""Outliers as measurements unlike those before and after them on the track."""

from typing import Any

import numpy as np

from infoplan.detect.evidence import NORMAL, Evidence, Judgement, rounding_of


def hampel(
    samples: Evidence,
    model: Any,
    rng: np.random.Generator,
    *,
    reach: int = 5,
    threshold: float = 3.0,
) -> Judgement:
    """Flag samples far from the running median, by the spread around it (Hampel, 1974).

    The score of a sample is ``|y - m| / s`` with m the median of the measurements from `reach`
    before to `reach` after it, itself among them, and s = 1.4826 times their median absolute
    deviation from m. At the ends of the track the window is cut.

    Parameters
    ----------
    samples
        All of them are in the windows, in order of collection, flagged ones too. A batch that is
        judged alone ends the track: its last samples are compared with those before them.
    model, rng
        As for any detector; unused.
    reach
        Samples on either side.
    threshold
        Largest score kept.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
        NaN where not judged. Where more than half agree to rounding, s is that rounding.
    """
    judged = np.flatnonzero(samples.judged)
    first = max(int(judged[0]) - reach, 0)
    # What lies beyond the ends is NaN, and counts for nothing.
    padded = np.pad(
        samples.measured[first:],
        (reach - min(reach, int(judged[0])), reach),
        constant_values=np.nan,
    )
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    windows = windows[judged - judged[0]]
    middle = np.nanmedian(windows, axis=1)
    spread = NORMAL * np.nanmedian(np.abs(windows - middle[:, None]), axis=1)
    score = np.full(len(samples), np.nan)
    score[judged] = np.abs(samples.measured[judged] - middle) / np.maximum(
        spread, rounding_of(samples.measured)
    )
    return score > threshold, score
