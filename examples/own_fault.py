"""A sensor fault of one's own: an echo of what was measured before.

In the folder of this file:

    infoplan run fault=own fault.function=own_fault.echo fault.options.delay=30

The function's keyword-only parameters, annotated, are its options; `infoplan.fault.Sensed` says
what it is given.
"""

import numpy as np

from infoplan.fault import Corrupted


def echo(sensed, state, rho, rng, *, delay: int = 20):
    """Say now and then what was said some time ago.

    Parameters
    ----------
    sensed, state, rho, rng
        Given to every fault: what a sound sensor says of the batch, the state that this function
        has returned with the batch before, the expected share of outliers, a generator.
    delay
        Age of the echo, samples.
    """
    before = np.full(delay, np.nan) if state is None else state
    past = np.concatenate([before, sensed.measured])
    echoes = past[: len(sensed)]
    is_outlier = (rng.random(len(sensed)) < rho) & ~np.isnan(echoes)
    return Corrupted(np.where(is_outlier, echoes, sensed.measured), is_outlier, past[-delay:])
