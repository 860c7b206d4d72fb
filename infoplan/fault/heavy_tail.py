"""Noise of heavy tails: mostly small errors, now and then a huge one."""

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed, corrupted


def heavy_tail(
    sensed: Sensed,
    state: None,
    rho: float,
    rng: np.random.Generator,
    *,
    dof: float = 2.0,
    scale: float = 0.05,
) -> Corrupted:
    """Add Student-t noise to each measurement, with probability rho.

    Those that it is added to are the outliers, however small it is: under a Student-t distribution
    most are, and no threshold would part them from the others.

    Parameters
    ----------
    sensed, state, rho, rng
        As of any fault; it remembers nothing.
    dof
        Degrees of freedom; the fewer, the heavier the tails.
    scale
        Of the distribution, in ranges of the terrain.
    """
    hit = rng.random(len(sensed)) < rho
    noise = scale * sensed.range * rng.standard_t(dof, size=len(sensed))
    return corrupted(sensed, np.where(hit, sensed.measured + noise, sensed.measured))
