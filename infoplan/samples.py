"""Samples: as a source gives them, as a belief sees them, and as the tables keep them."""

from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Record = TypeVar("Record")


@dataclass(frozen=True)
class Readings:
    """What is known of samples without knowing the terrain, in order of collection.

    Attributes
    ----------
    x
        Location, shape (n, 2), workspace units.
    heading
        After the turn, radians in [0, 2 pi), shape (n,).
    measured
        What the sensor said, terrain's unit, shape (n,).
    is_outlier
        True labels, shape (n,), for the perfect detector alone; None where nobody knows them.
    """

    x: Floats
    heading: Floats
    measured: Floats
    is_outlier: Booleans | None

    def __len__(self) -> int:
        return len(self.measured)


@dataclass(frozen=True)
class Batch(Readings):
    """The samples of an epoch as their source gives them.

    Attributes
    ----------
    truth
        Elevation, terrain's unit, shape (n,); NaN where nobody knows it.
    """

    truth: Floats

    def readings(self) -> Readings:
        """Return the samples without the truth."""
        return Readings(self.x, self.heading, self.measured, self.is_outlier)


@dataclass(frozen=True)
class Samples:
    """Samples in order of collection, and the verdict on them; every array has one entry a sample.

    Attributes
    ----------
    epoch
        Decision epoch that collected it, 0 for the pilot.
    x
        Location, shape (n, 2), workspace units.
    heading
        After the turn, radians in [0, 2 pi).
    truth, measured
        Elevation, and what the sensor said, terrain's unit.
    is_outlier
        True label; False where nobody knows it.
    flagged, score
        The detector's last judgement; never judged: False and NaN.
    """

    epoch: NDArray[np.int64]
    x: Floats
    heading: Floats
    truth: Floats
    measured: Floats
    is_outlier: Booleans
    flagged: Booleans
    score: Floats

    def __len__(self) -> int:
        return len(self.epoch)

    def __getitem__(self, chosen: slice | Booleans) -> "Samples":
        return Samples(*(getattr(self, item.name)[chosen] for item in fields(self)))


def joined(first: Record, second: Record) -> Record:
    """Return samples followed by others of their kind; what either lacks is None."""
    parts: dict[str, Any] = {}
    for name in (item.name for item in fields(first)):  # type: ignore[arg-type]
        pair = [getattr(first, name), getattr(second, name)]
        parts[name] = None if any(part is None for part in pair) else np.concatenate(pair)
    return type(first)(**parts)
