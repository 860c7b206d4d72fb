"""The robot: a Dubins car at constant speed, its steering angles, and the Bezier pilot path.

A pose is ``x1, x2, heading``; the heading is in radians, in ``[0, 2 pi)``. A workspace is its
``extent``: ``xmin, xmax, ymin, ymax``.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.compiled import kernel
from infoplan.errors import UsageError

TWO_PI = 2.0 * math.pi
TURN_ON_THE_SPOT = math.pi / 8.0


@kernel()
def wrap(angle: float) -> float:
    """Return an angle modulo 2 pi.

    Parameters
    ----------
    angle : float
        Radians.

    Returns
    -------
    float
        The same direction in ``[0, 2 pi)``; the upper end is never reached.
    """
    if 0.0 <= angle < TWO_PI:
        return angle
    angle %= TWO_PI
    # A tiny negative angle has a modulo that rounds to 2 pi itself.
    return angle if angle < TWO_PI else 0.0


@kernel()
def step(x: float, y: float, theta: float, u: float, speed: float) -> tuple[float, float, float]:
    """Drive one sample: move along the heading, then turn (paper's motion model, Euler).

    Parameters
    ----------
    x, y : float
        Position, workspace units.
    theta : float
        Heading, radians.
    u : float
        Turn of this sample, radians.
    speed : float
        Distance of this sample, workspace units.

    Returns
    -------
    tuple of float
        Position and heading after the turn; the heading is in ``[0, 2 pi)``.
    """
    return x + speed * math.cos(theta), y + speed * math.sin(theta), wrap(theta + u)


@kernel()
def inside(x: float, y: float, extent: tuple[float, float, float, float]) -> bool:
    """Tell whether a position lies in the workspace or on its border.

    Parameters
    ----------
    x, y : float
        Position, workspace units.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax``.

    Returns
    -------
    bool
        True inside and on the border.
    """
    return extent[0] <= x <= extent[1] and extent[2] <= y <= extent[3]


def drive(
    pose: ArrayLike,
    actions: Sequence[int] | NDArray[np.integer],
    steering: ArrayLike,
    speed: float,
    samples_per_action: int,
) -> NDArray[np.float64]:
    """Drive a sequence of actions, one pose a sample.

    Parameters
    ----------
    pose : array_like, shape (3,)
        Start ``x1, x2, heading``; it is not part of the result.
    actions : sequence of int, shape (k,)
        Indices into `steering`.
    steering : array_like, shape (A,)
        Turn a sample of each action, radians.
    speed : float
        Distance a sample, workspace units.
    samples_per_action : int
        Samples along one action.

    Returns
    -------
    ndarray, shape (k * samples_per_action, 3)
        ``x1, x2, heading`` after each sample: the poses that the search itself saw, bit by bit.
    """
    x, y, theta = (float(value) for value in np.asarray(pose, dtype=np.float64))
    turns = np.asarray(steering, dtype=np.float64)[np.asarray(actions, dtype=np.int64)]
    poses = np.empty((len(turns) * samples_per_action, 3))
    for sample, u in enumerate(np.repeat(turns, samples_per_action)):
        x, y, theta = step(x, y, theta, float(u), float(speed))
        poses[sample] = x, y, theta
    return poses


def turn_on_the_spot(pose: ArrayLike) -> NDArray[np.float64]:
    """Turn by pi/8 without moving: what the robot does when no action is left.

    Parameters
    ----------
    pose : array_like, shape (3,)
        ``x1, x2, heading``.

    Returns
    -------
    ndarray, shape (3,)
        The same position with the new heading.
    """
    x, y, theta = (float(value) for value in np.asarray(pose, dtype=np.float64))
    return np.array([x, y, wrap(theta + TURN_ON_THE_SPOT)])


def steering_angles(maximum: float, count: int) -> NDArray[np.float64]:
    """Return the turns a sample of the actions, evenly in ``[-maximum, maximum]``.

    Parameters
    ----------
    maximum : float
        Largest turn a sample, radians.
    count : int
        Number of actions, at least 1; one action alone drives straight ahead.

    Returns
    -------
    ndarray, shape (count,)
        Ascending and exactly symmetric: an odd count holds exactly 0.

    Raises
    ------
    UsageError
        If `count` is below 1.
    """
    if count < 1:
        raise UsageError(f"The number of steering angles is {count}: set it to 1 or more.")
    odds = np.arange(1 - count, count, 2)
    # The fraction first: it is exactly -1 and 1 at the ends.
    return maximum * (odds / max(count - 1, 1))


def tightest_turn(radius: float, speed: float) -> float:
    """Return the largest turn a sample that keeps a car off circles smaller than a radius.

    The samples of a steady turn u lie on a circle of radius speed / (2 sin(u / 2)). Where a sample
    is longer than the radius, the turn is a sixth of a circle at most.

    Parameters
    ----------
    radius : float
        Smallest turning radius, workspace units.
    speed : float
        Distance of a sample, workspace units.

    Returns
    -------
    float
        Radians; a whole share of a full turn, so that such a circle closes.
    """
    limit = 2.0 * math.asin(min(speed / (2.0 * radius), 0.5))
    return TWO_PI / math.ceil(TWO_PI / limit - 1e-9)


def bezier_path(
    control_points: ArrayLike,
    extent: tuple[float, float, float, float],
    samples: int,
) -> NDArray[np.float64]:
    """Sample a Bezier curve evenly in its parameter from 0 to 1 (de Casteljau).

    Parameters
    ----------
    control_points : array_like, shape (k, 2)
        At least two points, as fractions of the extent; the curve's degree is ``k - 1``.
    extent : tuple of 4 floats
        ``xmin, xmax, ymin, ymax``, workspace units.
    samples : int
        Number of samples, both ends included.

    Returns
    -------
    ndarray, shape (samples, 3)
        ``x1, x2`` on the curve and the heading along its tangent, in ``[0, 2 pi)``. Where the
        tangent vanishes (repeated control points), the heading points to the next distinct
        sample, or at the end comes from the last distinct one.

    Raises
    ------
    UsageError
        If there are fewer than two points, or one is no pair of fractions in ``[0, 1]``.
    """
    fractions = np.asarray(control_points, dtype=np.float64)
    if fractions.ndim != 2 or fractions.shape[0] < 2 or fractions.shape[1] != 2:
        raise UsageError(
            "The Bezier control points must be two or more pairs (x, y), but make an array of "
            f"shape {fractions.shape}: give a list of pairs."
        )
    if not np.all((fractions >= 0.0) & (fractions <= 1.0)):
        raise UsageError(
            "The Bezier control points are fractions of the extent, from 0 to 1, but reach from "
            f"{fractions.min():g} to {fractions.max():g}: bring them into this range."
        )
    low, high = np.array(extent[0::2], dtype=np.float64), np.array(extent[1::2], dtype=np.float64)
    points = low + fractions * (high - low)
    parameter = np.linspace(0.0, 1.0, samples)[:, None]

    # Repeated interpolation leaves two points: the curve lies between them, the tangent along.
    ladder = np.repeat(points[:, None, :], samples, axis=1)
    while len(ladder) > 2:
        ladder = (1.0 - parameter) * ladder[:-1] + parameter * ladder[1:]
    start, end = ladder
    # The curve stays in the hull of its control points; rounding must not carry it out.
    curve = np.clip((1.0 - parameter) * start + parameter * end, low, high)
    tangent = end - start
    for i in np.flatnonzero(~tangent.any(axis=1)):
        tangent[i] = _chord(curve, int(i))
    heading = [wrap(math.atan2(dy, dx)) for dx, dy in tangent.tolist()]
    return np.column_stack([curve, heading])


def _chord(curve: NDArray[np.float64], i: int) -> NDArray[np.float64]:
    """Return the chord from sample i to the next distinct one, else from the last distinct one."""
    chords = curve - curve[i]
    distinct = chords.any(axis=1)
    after = np.flatnonzero(distinct[i:])
    if len(after):
        return chords[i + after[0]]
    before = np.flatnonzero(distinct[:i])
    return -chords[before[-1]] if len(before) else np.zeros(2)
