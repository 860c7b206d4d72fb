"""Sensor faults.

A fault is a function ``(sensed, state, rho, rng, **options)`` that returns `Corrupted`: what the
sensor says in a batch instead of what it should, and which samples are outliers. `Sensed` says what
it is given; the state is what it has returned with the batch before (None at first), rho the
expected share of outliers, the generator the epoch's own.
"""

from collections.abc import Callable

from infoplan.fault.sensed import Corrupted, Sensed
from infoplan.fault.spike import spike

FAULTS: dict[str, Callable[..., Corrupted]] = {"spike": spike}

__all__ = ["FAULTS", "Corrupted", "Sensed", "spike"]
