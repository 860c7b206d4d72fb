"""Faults that last: a two-state Markov chain tells which samples they hold."""

import numpy as np
from numpy.typing import NDArray


def stretches(
    n: int, before: bool | None, rho: float, length: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Draw which samples of a batch lie in a stretch of the fault.

    A stretch ends after each of its samples with probability 1 / length, and begins after each
    other one with rho / (length (1 - rho)): in the long run rho of the samples lie in one (Gilbert,
    1960). The first sample of all does so with probability rho, and so does every other.

    Parameters
    ----------
    n
        Samples in the batch.
    before
        Whether the sample before it did; None if there is none.
    rho
        Share of the samples, at most length / (length + 1).
    length
        Mean length of a stretch, samples, at least 1.
    rng
        Draws one number a sample.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    begin = rho / (length * (1.0 - rho))
    inside = np.zeros(n, dtype=bool)
    for i, draw in enumerate(rng.random(n)):
        chance = rho if before is None else 1.0 - 1.0 / length if before else begin
        inside[i] = before = bool(draw < chance)
    return inside
