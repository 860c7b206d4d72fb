"""How pictures of a place are laid out: height, units, and the ends of the colours of its maps."""

import numpy as np
from numpy.typing import NDArray

from infoplan.draw.style import LONGEST_UNIT, inert
from infoplan.extent import Extent

Floats = NDArray[np.float64]

TALLEST, FLATTEST = 8.0, 2.6
"""Of a picture, inches."""


def picture_height(extent: Extent, panel: float, around: float) -> float:
    """Give the height of a picture whose panels show a place, to its scale.

    Parameters
    ----------
    extent
        Of the place: xmin, xmax, ymin, ymax.
    panel
        Width of a panel, inches.
    around
        What titles, labels and a legend take above and below, inches.
    """
    xmin, xmax, ymin, ymax = extent
    return min(max((ymax - ymin) / (xmax - xmin) * panel + around, FLATTEST), TALLEST)


def with_unit(what: str, unit: str) -> str:
    """Label an axis by what it shows, and its unit if that is known."""
    return f"{what} ({inert(unit, LONGEST_UNIT)})" if unit else what


def ends_of_mean(mean: Floats, kept: Floats) -> tuple[float, float]:
    """Give the ends of the colours of a mean and of the values it was made from.

    They are those of the values: off the track a mean may run far beyond, and would leave what was
    measured one colour.

    Parameters
    ----------
    mean
        Of the map, any shape.
    kept
        Values in the model, shape (n,).
    """
    scale = kept[np.isfinite(kept)]
    if not len(scale) or np.ptp(scale) == 0:
        scale = mean[np.isfinite(mean)]
    return float(scale.min()), float(scale.max())


def end_of_deviation(std: Floats, kept: Floats) -> float:
    """Give the upper end of the colours of a deviation.

    That is where the model knows no more than the standard deviation of all values tells, or the
    largest, if that is less.

    Parameters
    ----------
    std
        Of the map, any shape.
    kept
        Values in the model, shape (n,).
    """
    told = kept[np.isfinite(kept)]
    most, spread = float(np.nanmax(std)), float(np.std(told)) if len(told) else 0.0
    return min(most, spread) if spread > 0 else most


def beyond(values: Floats, low: float, high: float) -> str:
    """Name the ends of a colour bar that values go beyond, as Matplotlib does."""
    below, above = bool(np.nanmin(values) < low), bool(np.nanmax(values) > high)
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]
