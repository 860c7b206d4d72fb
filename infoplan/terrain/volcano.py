"""A built-in surface shaped like Mount St. Helens after 1980: formulas only, no data.

The published dimensions it is built from: a cone of about 2950 m before the eruption and a rim of
2549 m after it, a horseshoe crater 2 km wide with its floor near 1900 m, a breach to the north, a
lava dome in the middle, steep upper flanks, and land around it that falls from about 1200 m in the
north to about 900 m in the south. Lengths are kilometres east and north of the crater's middle,
heights metres, until the end.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

UNIT = "ft"
METRES_PER_FOOT = 0.3048

# The map: a 7.5 minute quadrangle less its margins, 7.6 km by 10.8 km.
NODES = 100
EAST = (-3.78, 3.78)
NORTH = (-6.8, 4.0)

CONE_AXIS = -0.28  # the old summit stood south of the crater's middle
CONE_HEIGHT = 1864.0
CONE_RADIUS = 2.42
CRATER_FLOOR = 1890.0
FLOOR_FALL = 135.0  # a kilometre northwards
FLOOR_RADIUS = 0.5
WALL_RUN = 0.46
WALL_RISE = 560.0
DOME_HEIGHT = 185.0
DOME_RADIUS = 0.3

# Ridges and gullies down the flanks: number around the cone, height, phase, twist with the radius.
GULLIES = ((9, 62.0, 0.5, 0.5), (16, 42.0, 1.3, -0.8), (27, 18.0, 2.2, 0.9))
# Valleys: greatest depth, and where they start and end.
VALLEYS = (
    (170.0, (-1.6, 1.0), (-4.0, 1.5)),
    (80.0, (2.0, -2.6), (3.6, -7.2)),
    (110.0, (0.7, -3.4), (1.3, -7.0)),
    (90.0, (-1.2, -3.6), (-2.2, -7.2)),
    (150.0, (1.9, 2.2), (3.9, 3.6)),
    (100.0, (-1.5, 2.6), (-3.2, 4.3)),
    (120.0, (2.4, -0.7), (4.0, -1.2)),
    (120.0, (-2.4, -1.8), (-4.0, -2.6)),
)


def volcano() -> Floats:
    """Elevations of the built-in volcano.

    Returns
    -------
    ndarray, shape (100, 100)
        Feet, rounded to a hundredth so that every machine has the same bytes; row 0 is the south,
        column 0 the west.
    """
    x, y = np.meshgrid(np.linspace(*EAST, NODES), np.linspace(*NORTH, NODES))
    wandering_x, wandering_y = _wander(x, y)
    height = _flanks(wandering_x, wandering_y, y)
    height = _smooth_minimum(height, _crater(wandering_x, wandering_y), 60.0)
    height += DOME_HEIGHT * np.exp(-((np.hypot(x, y - 0.05) / DOME_RADIUS) ** 3))
    for phase, (depth, start, end) in enumerate(VALLEYS):
        height -= depth * _valley(x, y, start, end, float(phase))
    # Ash and rock slides left the cone smoother than the land around it.
    distance = np.hypot(x, y - CONE_AXIS)
    height += (1.6 - np.exp(-((distance / 3.3) ** 4))) * _roughness(x, y)
    return np.round(height / METRES_PER_FOOT, 2)


def _wander(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Bend the coordinates a little, so that no circle of the cone is quite round."""
    bend_x = 0.09 * np.sin(2 * np.pi * y / 2.3 + 0.7)
    bend_y = 0.09 * np.sin(2 * np.pi * x / 2.1 + 2.1)
    twist_x = 0.03 * np.sin(2 * np.pi * (x + 0.6 * y) / 1.1 + 2.0)
    twist_y = 0.03 * np.sin(2 * np.pi * (y - 0.7 * x) / 1.2 + 0.4)
    return x + bend_x + twist_x, y + bend_y + twist_y


def _flanks(x: Floats, y: Floats, north: Floats) -> Floats:
    """Return tilted land with the old cone on it, gullies down its sides."""
    y = y - CONE_AXIS
    y = np.where(y > 0, 1.1 * y, y)  # the landslide took more from the north side
    radius, azimuth = np.hypot(x, y), np.arctan2(y, x)
    cone = CONE_HEIGHT * np.exp(-((radius / CONE_RADIUS) ** 1.32))
    gullies = sum(
        height * np.abs(np.sin((number * azimuth + phase + twist * radius) / 2))
        for number, height, phase, twist in GULLIES
    )
    half_way_down = (radius / 2.3) ** 2 * np.exp(1 - (radius / 2.3) ** 2)
    return 1055.0 + 24.0 * north + cone + half_way_down * (gullies - 62.0)


def _crater(x: Floats, y: Floats) -> Floats:
    """Return the horseshoe: a floor that falls to the north, and walls, wider at the breach."""
    to_north, to_south = np.maximum(y, 0.0), np.minimum(y, 0.0)
    from_middle_line = np.hypot(x / (1 + 0.2 * to_north), to_south)
    wall = np.maximum(0.0, (from_middle_line - FLOOR_RADIUS) / WALL_RUN) ** 1.25
    return CRATER_FLOOR - FLOOR_FALL * to_north + WALL_RISE * wall


def _valley(
    x: Floats, y: Floats, start: tuple[float, float], end: tuple[float, float], phase: float
) -> Floats:
    """Return how deep a winding valley is: 0 at its start, 1 on its line at the end and beyond."""
    run_x, run_y = end[0] - start[0], end[1] - start[1]
    length = np.hypot(run_x, run_y)
    along = ((x - start[0]) * run_x + (y - start[1]) * run_y) / length
    aside = ((y - start[1]) * run_x - (x - start[0]) * run_y) / length
    aside = aside - 0.16 * np.sin(2 * np.pi * along / 1.7 + phase)
    share = np.clip(along / length, 0.0, 1.0)
    return share**2 * (3 - 2 * share) * np.exp(-np.abs(aside) / 0.24)


def _roughness(x: Floats, y: Floats) -> Floats:
    """Add up 60 waves from 5 km down to 320 m long, their directions and phases spread evenly."""
    total = np.zeros_like(x)
    for k in range(60):
        wavelength = 5.0 * (0.32 / 5.0) ** (k / 59)
        direction = k * np.pi * (3 - np.sqrt(5))
        phase = 2 * np.pi * k * np.sqrt(2)
        position = np.cos(direction) * x + np.sin(direction) * y
        height = 10.0 * (wavelength / 5.0) ** 1.17
        total += height * np.sin(2 * np.pi * position / wavelength + phase)
    return total


def _smooth_minimum(a: Floats, b: Floats, width: float) -> Floats:
    """Take the lower of two surfaces, their edge rounded over a height of about `width`."""
    return (a + b - np.hypot(a - b, width)) / 2
