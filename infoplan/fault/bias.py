"""Steps: an error that comes at once, stays the same and goes, as of a knocked mounting."""

from collections.abc import Sequence

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.spread import signed
from infoplan.fault.stretches import stretches


def bias(
    sensed: Sensed,
    state: float | None,
    rho: float,
    rng: np.random.Generator,
    *,
    length: float = 20.0,
    amplitude: Sequence[float] = (0.1, 0.5),
) -> Corrupted:
    """Add one and the same error to all samples of a stretch.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        The error of the last sample, in ranges of the terrain, 0 outside of a stretch.
    length
        Mean length of a stretch, samples.
    amplitude
        Bounds of its error, uniform and either way, in ranges of the terrain.
    """
    before = state or 0.0
    biased = stretches(len(sensed), None if state is None else before != 0.0, rho, length, rng)
    steps, errors = signed(amplitude, len(sensed), rng), np.zeros(len(sensed))
    for i in np.flatnonzero(biased):
        last = errors[i - 1] if i else before
        errors[i] = last if last else steps[i]
    return corrupted(sensed, sensed.measured + errors * sensed.range, float(errors[-1]))
