"""Drift: an error that grows, as of a worn or warming probe, until somebody resets the sensor."""

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.stretches import stretches


def drift(
    sensed: Sensed,
    state: tuple[int, float] | None,
    rho: float,
    rng: np.random.Generator,
    *,
    length: float = 20.0,
    rate: float = 0.02,
) -> Corrupted:
    """Add an error that grows by the same amount from sample to sample of a stretch.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        How many samples of the stretch are over, 0 outside of one, and its sign.
    length
        Mean length of a stretch, samples; what follows it is right again.
    rate
        By how much the error grows a sample, in ranges of the terrain; up or down, at random.
    """
    age, sign = state or (0, 1.0)
    drifting = stretches(len(sensed), None if state is None else age > 0, rho, length, rng)
    signs = rng.choice([-1.0, 1.0], size=len(sensed))
    error = np.zeros(len(sensed))
    for i in np.arange(len(sensed)):
        sign = sign if age else float(signs[i])
        age = age + 1 if drifting[i] else 0
        error[i] = sign * age * rate * sensed.range
    return corrupted(sensed, sensed.measured + error, (age, sign))
