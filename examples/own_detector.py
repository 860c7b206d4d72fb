"""A detector of your own: a function that judges samples.

In the folder of this file:

    infoplan run detector=own detector.function=own_detector.jumps detector.options.threshold=6

The function's keyword-only parameters, annotated, are its options; `infoplan.detect.Evidence` says
what `samples` holds. It returns a flag and a score (NaN for none) for each sample collected so far.
"""

import numpy as np


def jumps(samples, model, rng, *, threshold: float = 5.0, reach: int = 2):
    """Flag what jumps out of the track.

    Parameters
    ----------
    samples, model, rng
        Given to every detector: the samples, the model before it sees the new ones, a generator.
    threshold
        Largest deviation from the neighbours along the track kept, in medians of all deviations.
    reach
        Neighbours before and after each sample that it is compared with.
    """
    padded = np.pad(samples.measured, reach, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    deviation = np.abs(samples.measured - np.median(windows, axis=1))
    score = deviation / np.median(deviation[deviation > 0])
    return score > threshold, score
