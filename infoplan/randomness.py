"""Named random streams: one seed, one child of its seed sequence for each component."""

import numpy as np

STREAMS = ("pilot", "sensor", "fault", "planner", "detector")


def generator(seed: int, stream: str, epoch: int | None = None) -> np.random.Generator:
    """Random generator of a component, the same for every method with this seed.

    Parameters
    ----------
    seed
        The mission's seed.
    stream
        One of `STREAMS`.
    epoch
        For the streams with a child an epoch: which one (0 is the pilot).

    Returns
    -------
    numpy.random.Generator
    """
    key = (STREAMS.index(stream),) if epoch is None else (STREAMS.index(stream), epoch)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
