"""Cross-talk: the echo of another sensor, from anywhere."""

from collections.abc import Sequence

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted


def uniform(
    sensed: Sensed,
    state: None,
    rho: float,
    rng: np.random.Generator,
    *,
    bounds: Sequence[float] = (-0.5, 1.5),
) -> Corrupted:
    """Replace each measurement by any value of a range, with probability rho.

    Parameters
    ----------
    sensed, state, rho, rng
        As of any fault; it remembers nothing.
    bounds
        In ranges of the terrain above its lowest point: 0 is the lowest, 1 the highest.
    """
    hit = rng.random(len(sensed)) < rho
    anywhere = sensed.lowest + rng.uniform(bounds[0], bounds[1], size=len(sensed)) * sensed.range
    return corrupted(sensed, np.where(hit, anywhere, sensed.measured))
