"""The two ends of the scale: no detector, and a perfect one."""

import numpy as np
from numpy.typing import NDArray

from infoplan.detect.judgement import Judgement


def none(
    x: NDArray[np.float64], y: NDArray[np.float64], is_outlier: NDArray[np.bool_]
) -> Judgement:
    """Flag nothing (the paper's worst case, NONE); arguments as in `infoplan.detect`."""
    return np.zeros(len(y), dtype=bool), np.full(len(y), np.nan)


def best(
    x: NDArray[np.float64], y: NDArray[np.float64], is_outlier: NDArray[np.bool_]
) -> Judgement:
    """Flag exactly the true outliers (the paper's best case, BEST)."""
    return is_outlier.copy(), np.full(len(y), np.nan)
