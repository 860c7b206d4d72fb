"""Tables of points x, y, z, which are no grids of elevations."""

import re

import numpy as np

from infoplan.errors import UsageError
from infoplan.terrain.grids import Floats

ADVICE = (
    "grid points first: with their columns x, y, z, "
    "gx, gy = numpy.meshgrid(numpy.linspace(x.min(), x.max(), 100), "
    "numpy.linspace(y.min(), y.max(), 100)); "
    "numpy.save('map.npy', scipy.interpolate.griddata((x, y), z, (gx, gy), 'nearest')); "
    "or do it in a function of yours, terrain=own"
)

NAMES = re.compile(
    r"x|y|z|x1|x2|lat|latitude|lon|lng|long|longitude|east|easting|north|northing|depth|elev\w*"
    r"|height|alt\w*"
)

FEWEST = 6
"""Rows below which nothing is said of a table."""
FEWEST_SURVEY, FEWEST_SCATTER, FEWEST_TRACE = 8, 60, 300

MOST = 4000
"""Rows of a longer table that are looked at."""

APART = 20.0
"""Ranges between two columns that are coordinates of a survey, not neighbours in a map."""
OTHER = 3.0
"""Ratio of the ranges of two columns of different quantities."""
LARGE = 1e5
"""No elevation is as large, most coordinates north of the equator in metres are."""
FILLED, EXPLAINED = 0.7, 0.35
"""Share of an area that scattered points reach; how far a neighbour's z is off, of the usual."""
NEIGHBOURS = 24
ALONG = 20
"""Neighbours along this part of a track tell nothing."""


def is_heading(line: str) -> bool:
    """Say whether a line names the columns of a table of points."""
    words = re.findall(r"[a-z][a-z0-9]*", line.lower())
    return sum(NAMES.fullmatch(word) is not None for word in words) >= 2


def check_no_points(table: Floats, what: str) -> None:
    """Refuse a table of points: three columns (or rows), of which two look like coordinates.

    Raises
    ------
    UsageError
        Says how points become a grid.
    """
    for points in (table, table.T):
        if points.shape[1] == 3 and len(points) >= FEWEST and _are_points(points):
            raise UsageError(
                f"{what} looks like points x, y, z and not like a grid of elevations: {ADVICE}; "
                "a map that is three nodes wide indeed is read from .asc or .tif"
            )


def _are_points(table: Floats) -> bool:
    table = table[np.isfinite(table[:, :2]).all(axis=1)]
    if len(table) < FEWEST or np.any(np.ptp(table[:, :2], axis=0) == 0):
        return False
    return _is_lattice(table) or _is_survey(table) or _is_scatter(table)


def _is_lattice(table: Floats) -> bool:
    """Say whether the first two columns are the nodes of a grid, each once, most of them there."""
    x, y = (np.unique(column, return_inverse=True) for column in table[:, :2].T)
    sizes = len(x[0]), len(y[0])
    nodes = np.unique(x[1].astype(np.int64) * sizes[1] + y[1])
    if len(nodes) < len(table) or min(sizes) < 2 or len(table) < 2 * max(sizes):
        return False
    return len(table) == sizes[0] * sizes[1] or (
        2 * len(table) >= sizes[0] * sizes[1] and len(table) >= FEWEST_SCATTER
    )


def _is_survey(table: Floats) -> bool:
    """Say whether the columns are as far apart as those of a survey, and unlike each other.

    Latitude and longitude, or metres east and north, differ by many times what they vary by; the
    columns of a map do so only where it rises evenly, or where all vary alike.
    """
    if len(table) < FEWEST_SURVEY:
        return False
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) < FEWEST_SURVEY:
        return False
    ranges = np.ptp(table, axis=0)
    ratio = ranges[2] / ranges[:2]
    unlike = bool(np.all(ratio > OTHER) or np.all(ratio < 1 / OTHER))
    first, second, third = np.median(table, axis=0)
    step, bend = abs(second - first), abs(third - 2 * second + first)
    if step > APART * ranges[:2].max() and bend > step / 2:
        return unlike or float(np.abs(table[:, :2]).max()) > LARGE
    # Or the first two share a small area, far below or above the third.
    low, high = table[:, :2].min(), table[:, :2].max()
    gap = max(table[:, 2].min() - high, low - table[:, 2].max())
    return unlike and bool(gap > 2 * (high - low) and gap > ranges[2] / 2)


def _is_scatter(table: Floats) -> bool:
    """Say whether the first two columns fill an area over which the third is a smooth function.

    Neither holds for a map: the columns of a smooth one run together, and those of a rough one do
    not explain each other.
    """
    from scipy.spatial import cKDTree

    table = table[np.isfinite(table).all(axis=1)]
    table = table[:: 1 + len(table) // MOST]
    if len(table) < FEWEST_SCATTER or np.ptp(table[:, 2]) == 0:
        return False
    # Along the rows of a map the neighbours are alike, too, so those do not count.
    steps = np.diff(table[:, :2], axis=0).std(axis=0) / table[:, :2].std(axis=0)
    apart = len(table) // ALONG if steps.min() < 1.0 else 0
    if apart and len(table) < FEWEST_TRACE:
        return False
    place = (table[:, :2] - table[:, :2].min(axis=0)) / np.ptp(table[:, :2], axis=0)
    side = int(np.sqrt(len(table)) / 2)
    cells = np.minimum((place * side).astype(int), side - 1)
    if len(np.unique(cells[:, 0] * side + cells[:, 1])) < FILLED * side**2:
        return False
    _, neighbours = cKDTree(place).query(place, NEIGHBOURS + 1)
    index = np.arange(len(table))[:, None]
    allowed = (np.abs(neighbours - index) > apart) & (neighbours != index)
    there = allowed.any(axis=1)
    if there.sum() < len(table) / 2:
        return False
    nearest = neighbours[np.arange(len(table)), allowed.argmax(axis=1)][there]
    z = table[:, 2]
    off = np.median(np.abs(z[there] - z[nearest]))
    typical = np.median(np.abs(z - np.random.default_rng(0).permutation(z)))
    return bool(off < EXPLAINED * typical)
