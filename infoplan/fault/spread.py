"""Sizes of errors that go either way."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def signed(bounds: Sequence[float], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw sizes that are uniform between two bounds, with random signs, shape (n,)."""
    return rng.uniform(bounds[0], bounds[1], size=n) * rng.choice([-1.0, 1.0], size=n)
