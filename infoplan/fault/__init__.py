"""Sensor faults.

A fault is a function ``(sensed, state, rho, rng, **options)`` that returns `Corrupted`: what the
sensor says in a batch instead of what it should, and which samples are outliers. `Sensed` says what
it is given; the state is what it has returned with the batch before (None at first), rho the
expected share of outliers, the generator the epoch's own.
"""

from collections.abc import Callable
from functools import partial

from infoplan.fault.bias import bias
from infoplan.fault.burst import burst
from infoplan.fault.drift import drift
from infoplan.fault.dropout import dropout
from infoplan.fault.heavy_tail import heavy_tail
from infoplan.fault.local import local
from infoplan.fault.max_range import max_range
from infoplan.fault.mixed import mixed
from infoplan.fault.sensed import Corrupted, Sensed
from infoplan.fault.spike import spike
from infoplan.fault.stuck import stuck
from infoplan.fault.uniform import uniform

FAULTS: dict[str, Callable[..., Corrupted]] = {
    "spike": spike,
    "max_range": max_range,
    "uniform": uniform,
    "burst": burst,
    "stuck": stuck,
    "bias": bias,
    "drift": drift,
    "heavy_tail": heavy_tail,
    "local": local,
    "dropout": dropout,
}
FAULTS["mixed"] = partial(mixed, known=FAULTS)

__all__ = ["FAULTS", "Corrupted", "Sensed", "spike"]
