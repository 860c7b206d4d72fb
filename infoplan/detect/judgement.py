"""What every detector returns."""

import numpy as np
from numpy.typing import NDArray

Judgement = tuple[NDArray[np.bool_], NDArray[np.float64]]
"""Flags and scores, each of shape (n,)."""
