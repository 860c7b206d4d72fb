"""Bursts: spikes in runs, as from a loose contact or a disturbed link."""

from collections.abc import Sequence

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.spread import signed
from infoplan.fault.stretches import stretches


def burst(
    sensed: Sensed,
    state: bool | None,
    rho: float,
    rng: np.random.Generator,
    *,
    length: float = 5.0,
    amplitude: Sequence[float] = (0.25, 1.0),
) -> Corrupted:
    """Add a spike of its own to each sample of a stretch.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        Whether the last sample lay in a burst.
    length
        Mean length of a burst, samples.
    amplitude
        Bounds of a spike's size, uniform and either way, in ranges of the terrain.
    """
    inside = stretches(len(sensed), state, rho, length, rng)
    spiky = sensed.measured + signed(amplitude, len(sensed), rng) * sensed.range
    said = np.where(inside, spiky, sensed.measured)
    return corrupted(sensed, said, bool(inside[-1]))
