"""Outliers that have places: some ground, or steep ground, gives more of them than other."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoplan.fault.sensed import Corrupted, Sensed, corrupted
from infoplan.fault.spread import signed

Floats = NDArray[np.float64]


class Ground(NamedTuple):
    """What the fault has seen so far.

    Attributes
    ----------
    badness
        Of the ground under each sample, shape (n,): 1 or 0 in and outside of the regions, or the
        slope along the track.
    x, truth
        Of the last sample.
    """

    badness: Floats
    x: Floats
    truth: float


def local(
    sensed: Sensed,
    state: Ground | None,
    rho: float,
    rng: np.random.Generator,
    *,
    regions: Sequence[float] = (),
    factor: float = 10.0,
    amplitude: Sequence[float] = (0.25, 1.0),
) -> Corrupted:
    """Add a spike to each sample with a probability that depends on the ground.

    It is min(1, c w), where the weight w goes from 1 on the best ground that the sensor has seen so
    far to `factor` on the worst, and c makes the mean over all samples so far rho: whatever
    the order in which ground is met, as long as that is random, rho are outliers.

    Parameters
    ----------
    sensed, rho, rng
        As of any fault.
    state
        The ground so far.
    regions
        Bad ground: xmin, xmax, ymin, ymax of one rectangle, then of the next, workspace units. If
        there are none, ground is
        the worse the steeper it is between one sample and the next.
    factor
        How many times as often outliers are on the worst ground as on the best.
    amplitude
        Bounds of a spike's size, uniform and either way, in ranges of the terrain.
    """
    here = _inside(sensed.x, regions) if len(regions) else _slope(sensed, state)
    badness = here if state is None else np.concatenate([state.badness, here])
    weight = 1.0 + (factor - 1.0) * badness / max(float(badness.max()), np.finfo(float).tiny)
    chance = _scaled(weight, rho)[-len(sensed) :]
    hit = rng.random(len(sensed)) < chance
    spiky = sensed.measured + signed(amplitude, len(sensed), rng) * sensed.range
    ground = Ground(badness, sensed.x[-1], float(sensed.truth[-1]))
    return corrupted(sensed, np.where(hit, spiky, sensed.measured), ground)


def _inside(x: Floats, regions: Sequence[float]) -> Floats:
    """Tell which positions lie in one of some rectangles, 1 or 0, shape (n,)."""
    # Each row a rectangle, of two pairs along x and y.
    low, high = np.moveaxis(np.reshape(regions, (-1, 2, 2)), 2, 0)
    within = np.all((x[:, None] >= low) & (x[:, None] <= high), axis=2)
    return np.any(within, axis=1).astype(np.float64)


def _slope(sensed: Sensed, state: Ground | None) -> Floats:
    """Steepness from the sample before to each, shape (n,); of the very first: to the second."""
    x, truth = (sensed.x[0], sensed.truth[0]) if state is None else (state.x, state.truth)
    distance = np.hypot(*np.diff(sensed.x, axis=0, prepend=x[None]).T)
    rise = np.abs(np.diff(sensed.truth, prepend=truth))
    slope: Floats = np.divide(rise, distance, out=np.zeros(len(rise)), where=distance > 0)
    if state is None and len(slope) > 1:
        slope[0] = slope[1]
    return slope


def _scaled(weight: Floats, mean: float) -> Floats:
    """Scale weights, cut at 1, so that they have a mean, shape (n,)."""
    chance = np.ones(len(weight))
    below = np.ones(len(weight), dtype=bool)
    while below.any():
        left = mean * len(weight) - np.sum(~below)
        chance[below] = weight[below] * left / weight[below].sum()
        if not (over := below & (chance > 1.0)).any():
            break
        chance[over], below[over] = 1.0, False
    return chance
