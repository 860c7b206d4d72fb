"""A sensor that is stuck: it says its last value again and again."""

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.stretches import stretches


def stuck(
    sensed: Sensed,
    state: tuple[bool, float] | None,
    rho: float,
    rng: np.random.Generator,
    *,
    length: float = 10.0,
) -> Corrupted:
    """Hold the value from before a stretch all along it.

    Should the first sample of all lie in a stretch, it is its value that is held.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        Whether the last sample was held, and what it said.
    length
        Mean length of a stretch, samples.
    """
    was, last = state or (None, sensed.measured[0])
    held = stretches(len(sensed), was, rho, length, rng)
    said = sensed.measured.copy()
    for i in range(len(said)):
        last = said[i] = last if held[i] else said[i]
    return corrupted(sensed, said, (bool(held[-1]), float(last)))
