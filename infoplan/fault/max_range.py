"""Returns at the sensor's limit: no echo came back, and the sensor says its largest range."""

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted


def max_range(
    sensed: Sensed, state: None, rho: float, rng: np.random.Generator, *, level: float = 1.5
) -> Corrupted:
    """Replace each measurement by one and the same value, with probability rho.

    Parameters
    ----------
    sensed, state, rho, rng
        As of any fault; it remembers nothing.
    level
        The value, in ranges of the terrain above its lowest point: 0 is the lowest, 1 the highest.
    """
    limit = sensed.lowest + level * sensed.range
    return corrupted(sensed, np.where(rng.random(len(sensed)) < rho, limit, sensed.measured))
