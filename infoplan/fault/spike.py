"""Spikes: single measurements far off, either way (paper, Section V)."""

from collections.abc import Sequence

import numpy as np

from infoplan.fault.sensed import Corrupted, Sensed
from infoplan.fault.spread import signed


def spike(
    sensed: Sensed,
    state: None,
    rho: float,
    rng: np.random.Generator,
    *,
    count: str = "round",
    amplitude: Sequence[float] = (1.0, 2.0),
    quantiles: Sequence[float] = (0.05, 0.95),
    draw: str = "spike",
) -> Corrupted:
    """Turn a share of a batch into spikes.

    A spike's amplitude is uniform, its sign random, its scale the range between two quantiles of
    the noisy batch.

    Parameters
    ----------
    sensed
        The batch.
    state
        None: batches have nothing to do with each other.
    rho
        Share of the batch that becomes spikes, in [0, 1].
    rng
        The epoch's stream.
    count
        ``round``: rho n rounded half to even, which keeps the share unbiased; ``floor``: its floor;
        ``bernoulli``: each sample with probability rho.
    amplitude
        Bounds of the uniform amplitude.
    quantiles
        Quantiles that bound the data range of the batch.
    draw
        ``spike``: each has an amplitude and a sign of its own; ``batch``: all have the same.

    Returns
    -------
    Corrupted
    """
    n, measured = len(sensed), sensed.measured
    if count == "bernoulli":
        is_outlier = rng.random(n) < rho
    else:
        # A product such as 0.29 * 100 falls just short of the integer that is meant.
        number = round(rho * n) if count == "round" else int(rho * n + 1e-9)
        is_outlier = np.zeros(n, dtype=bool)
        is_outlier[rng.choice(n, size=number, replace=False)] = True
    low, high = np.quantile(measured, quantiles)
    spiky = measured + signed(amplitude, n if draw == "spike" else 1, rng) * (high - low)
    return Corrupted(np.where(is_outlier, spiky, measured), is_outlier)
