"""Gaussian random fields: as many different maps as wanted, of known statistics."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.terrain.grids import MAX_NODES

Floats = NDArray[np.float64]

REACH = 8.6
"""Standard deviations after which a Gaussian is below double precision, exp(-37) = 1e-16."""

DIGITS = 6

MAX_WAVES = 2**14
"""Most waves along an axis: a lengthscale of a thousandth of a side has 2800, in 0.1 s."""


def random_field(
    seed: int,
    shape: Sequence[int],
    sides: Sequence[float],
    lengthscale: Sequence[float],
    amplitude: float,
    mean: float,
) -> Floats:
    """Draw a field with covariance amplitude^2 exp(-dx^2 / (2 lx^2) - dy^2 / (2 ly^2)).

    A sum of waves with normal coefficients, exact to double precision. The coefficients depend on
    neither shape nor amplitude: a seed is one landscape, however finely it is looked at. Elevations
    are rounded to about a millionth of the amplitude, so that every machine has the same bytes.

    Parameters
    ----------
    seed
        Which field.
    shape
        Numbers of rows and columns.
    sides
        Lengths of the workspace along x and y.
    lengthscale
        lx and ly, in the unit of `sides`.
    amplitude, mean
        Standard deviation and mean of the elevation at a node, over all seeds.

    Returns
    -------
    ndarray, shape (rows, columns)

    Raises
    ------
    UsageError
        If there are too many nodes, or the lengthscales are too short for the workspace.
    """
    rows, columns = shape
    if rows * columns > MAX_NODES:
        raise UsageError(
            f"terrain.shape={[rows, columns]} has more than {MAX_NODES} nodes: ask for fewer"
        )
    numbers = [_wave_number(side, length) for side, length in zip(sides, lengthscale, strict=True)]
    counts = [2 * number + 1 for number in numbers]
    if math.prod(counts) > MAX_NODES or max(counts) > MAX_WAVES:
        raise UsageError(
            f"terrain.lengthscale={list(lengthscale)} is too short for a workspace of "
            f"{sides[0]:g} by {sides[1]:g}: give lengthscales of at least a thousandth of it"
        )
    if counts[0] * columns + counts[1] * rows > MAX_NODES:
        raise UsageError(
            f"terrain.shape={[rows, columns]} has too many nodes along an axis for "
            f"terrain.lengthscale={list(lengthscale)}: ask for fewer, or give longer lengthscales"
        )
    along_x = _waves(columns, sides[0], lengthscale[0], numbers[0])
    along_y = _waves(rows, sides[1], lengthscale[1], numbers[1])
    coefficients = np.random.default_rng(seed).standard_normal((counts[1], counts[0]))
    # Elevations that a double cannot hold become infinite or NaN.
    with np.errstate(over="ignore", invalid="ignore"):
        field = mean + amplitude * (along_y @ coefficients @ along_x.T)
        return np.round(field, DIGITS - math.floor(math.log10(amplitude)))


def _period(side: float, lengthscale: float) -> float:
    """Length after which the field repeats itself: so long that no two nodes feel it."""
    return side + REACH * lengthscale


def _wave_number(side: float, lengthscale: float) -> int:
    """Count the waves, in a period, of the shortest wave with a power above double precision."""
    number = REACH * _period(side, lengthscale) / (2 * math.pi * lengthscale)
    return math.ceil(min(number, MAX_NODES))  # more are refused; it may be infinite


def _waves(nodes: int, side: float, lengthscale: float, number: int) -> Floats:
    """Cosines and sines at the nodes of an axis, scaled by the roots of their powers.

    The matrix times its transpose is the covariance of the nodes along this axis.
    """
    period = _period(side, lengthscale)
    frequency = 2 * np.pi / period * np.arange(number + 1)
    # The Gaussian's spectral density, sampled at the frequencies of a periodic field.
    power = (
        np.sqrt(2 * np.pi) * lengthscale / period * np.exp(-((frequency * lengthscale) ** 2) / 2)
    )
    scale = np.sqrt(np.where(frequency > 0, 2, 1) * power)
    phase = np.linspace(0.0, side, nodes)[:, None] * frequency
    return np.hstack([scale * np.cos(phase), (scale * np.sin(phase))[:, 1:]])
