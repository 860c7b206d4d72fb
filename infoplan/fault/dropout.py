"""Dropout: the sensor says nothing, as over deep water, glass, or out of the radio's reach."""

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.stretches import stretches


def dropout(
    sensed: Sensed,
    state: bool | None,
    rho: float,
    rng: np.random.Generator,
    *,
    length: float = 3.0,
) -> Corrupted:
    """Say nothing, NaN, all along a stretch.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        Whether the last sample lay in a stretch.
    length
        Mean length of a stretch, samples.
    """
    silent = stretches(len(sensed), state, rho, length, rng)
    return corrupted(sensed, np.where(silent, np.nan, sensed.measured), bool(silent[-1]))
