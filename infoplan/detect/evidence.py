"""What a detector is given, and what it returns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Judgement = tuple[NDArray[np.bool_], NDArray[np.float64]]
"""Flags and scores of all samples, each of shape (n,); a score is NaN where there is none."""

NORMAL = 1.4826
"""A median absolute deviation times this is the standard deviation of normal data."""


def rounding_of(y: NDArray[np.float64]) -> float:
    """Size of the rounding of some numbers: no spread of theirs is smaller."""
    return float(np.finfo(float).eps * np.abs(y).max())


@dataclass(frozen=True)
class Evidence:
    """The samples collected so far, in order; every array has one entry a sample.

    Where the sensor has said nothing, there is none.

    Attributes
    ----------
    x
        Location, shape (n, 2), workspace units.
    measured
        What the sensor said, terrain's unit.
    epoch
        Decision epoch that collected it, 0 for the pilot.
    flagged
        The verdict so far; False for what was never judged.
    judged
        Whose verdict is asked for: the new batch (scope batch), or all (historical). Verdicts on
        the others are ignored.
    is_outlier
        The true labels, for the perfect detector alone; None where nobody knows them.
    """

    x: NDArray[np.float64]
    measured: NDArray[np.float64]
    epoch: NDArray[np.int64]
    flagged: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    is_outlier: NDArray[np.bool_] | None

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def candidates(self) -> NDArray[np.bool_]:
        """What the model will hold unless it is flagged now: the judged, and what was accepted."""
        return self.judged | ~self.flagged
