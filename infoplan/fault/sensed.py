"""What a fault is given, and what it makes of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sensed:
    """What a sound sensor said along a batch; every array has one entry a sample, in order.

    Attributes
    ----------
    x
        Location, shape (n, 2), workspace units.
    heading
        After the turn, radians in [0, 2 pi).
    truth
        Elevation, terrain's unit.
    measured
        The same with the sensor's noise.
    time
        When, in samples since the mission's start; the pilot's count.
    epoch
        Decision epoch of the batch, 0 for the pilot.
    lowest, highest
        Of the true elevations at the nodes of the query grid, terrain's unit.
    """

    x: Floats
    heading: Floats
    truth: Floats
    measured: Floats
    time: Floats
    epoch: int
    lowest: float
    highest: float

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def range(self) -> float:
        """Range of the terrain's elevations, terrain's unit: sizes of faults are told in it."""
        return self.highest - self.lowest


@dataclass(frozen=True)
class Corrupted:
    """What a faulty sensor said instead.

    Attributes
    ----------
    measured
        Measurements, terrain's unit, shape (n,).
    is_outlier
        Which of them the fault has touched, shape (n,).
    state
        What the fault is to be given with the next batch; None if it remembers nothing.
    """

    measured: Floats
    is_outlier: NDArray[np.bool_]
    state: Any = None


def corrupted(sensed: Sensed, said: Floats, state: Any = None) -> Corrupted:
    """Call an outlier whatever is not what the sound sensor said, NaN included."""
    return Corrupted(said, said != sensed.measured, state)
