"""A detector that remembers what it was asked, for tests of the check."""

import numpy as np

ASKED = []


def far(samples, model, rng, *, reach: float = 4.0):
    """Flag what is far from the median of all."""
    ASKED.append(samples.measured.copy())
    score = np.abs(samples.measured - np.median(samples.measured))
    return score > reach, score
