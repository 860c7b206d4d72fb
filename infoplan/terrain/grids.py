"""Grids of elevations, and what is done to them before they become a terrain."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.options import plain_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Floats = NDArray[np.float64]
Edges = tuple[float, float, float, float]
Block = tuple[int, int, Floats]
"""First row and first column of a part of a grid, and its elevations."""

TRUNCATED = 4.0
"""Standard deviations after which a smoothing Gaussian ends."""

MAX_NODES = 2**25
"""Most nodes that a map is read, resampled or made with: a quarter of a gigabyte of doubles."""

MAX_STORED_NODES = 2**30
"""Most nodes of a file that is resampled while it is read."""

MAX_SIDE = 2**20
"""Most rows or columns that are resampled."""

MAX_ELEVATION = 1e100
"""Largest elevation, up or down: its square is still a double."""

MIN_RELIEF = 1e-100
"""Least difference of the highest and the lowest elevation."""

SAME = 1e-7
"""Relative difference of two spellings of a number in single precision."""

MARKS = {-999.0, -9999.0, -99999.0, -32767.0, -32768.0, 999.0, 9999.0, 99999.0, 32767.0, 65535.0}
"""Values by which files often mark missing elevations."""

FAR, FAR_MARK = 2.0, 0.05
"""A lone value is far from the others from this share of their range on; one of `MARKS`, sooner."""

SEEN = 0.01
"""A resampled node counts as missing where fewer of the elevations that it is a mean of exist."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Elevations of even nodes, and what is known of them.

    Attributes
    ----------
    elevation
        Shape (R, C); the first row is the lower border (the south), the first column the left one
        (the west). NaN where there is no elevation.
    unit
        Unit of the elevations; None where the source says none.
    edges
        West, east, south and north of the area that the nodes are the middles of, in `crs`; None
        without a place in the world.
    crs
        The coordinate system of `edges`, in words.
    """

    elevation: Floats
    unit: str | None = None
    edges: Edges | None = None
    crs: str = ""

    def node_bounds(self) -> Edges | None:
        """West, east, south and north of the outermost nodes, half a node inside the edges."""
        if self.edges is None:
            return None
        west, east, south, north = self.edges
        rows, columns = self.elevation.shape
        dx, dy = (east - west) / columns / 2, (north - south) / rows / 2
        return west + dx, east - dx, south + dy, north - dy


def check_shape(shape: Sequence[int], what: str) -> None:
    """Refuse what cannot be a map by its shape alone.

    Raises
    ------
    UsageError
        If it has not two dimensions, too few or too many nodes.
    """
    if len(shape) != 2:
        raise UsageError(
            f"the map in {what} has the shape {tuple(shape)}: it must have two dimensions, "
            "rows along y and columns along x"
        )
    rows, columns = shape
    if min(rows, columns) < 2:
        raise UsageError(
            f"the map in {what} has the shape {(rows, columns)}: it must have at least 2 rows "
            "and 2 columns"
        )
    if rows * columns > MAX_NODES:
        raise UsageError(
            f"the map in {what} has {rows} x {columns} nodes, more than the {MAX_NODES} that are "
            "read: cut or coarsen it first"
        )


def must_coarsen(stored: Sequence[int], wanted: Sequence[int] | None, what: str) -> bool:
    """Say whether a grid is so large that it is resampled while it is read.

    Raises
    ------
    UsageError
        If it is no map by its shape, too large for that, or no new shape is wanted.
    """
    rows, columns = stored
    if rows * columns > MAX_STORED_NODES:
        raise UsageError(
            f"the map in {what} has {rows} x {columns} nodes, too many to be read: cut or coarsen "
            "it first"
        )
    if rows * columns <= MAX_NODES or min(rows, columns) < 2:
        check_shape(stored, what)
        return False
    if wanted is None:
        raise UsageError(
            f"the map in {what} has {rows} x {columns} nodes, more than the {MAX_NODES} that are "
            "read as they are: give terrain.shape=[rows,columns] to have it coarsened"
        )
    return True


def check_elevations(elevation: Floats, what: str) -> None:
    """Refuse a map with missing elevations, or with nothing to map.

    Raises
    ------
    UsageError
        If an elevation is not finite or beyond `MAX_ELEVATION`, or all are the same.
    """
    check_missing(int(np.sum(~np.isfinite(elevation))), elevation.size, what)
    low, high = float(elevation.min()), float(elevation.max())
    if high - low < MIN_RELIEF:
        raise UsageError(
            f"the map in {what} is {low:g} everywhere: there is nothing to map, "
            "give one whose elevations vary"
        )
    if max(-low, high) > MAX_ELEVATION:
        extreme = low if -low > high else high
        raise UsageError(
            f"the map in {what} has an elevation of {plain_number(extreme)}, beyond "
            f"{MAX_ELEVATION:g}: correct it, or mark it as missing (terrain.nodata=<number> does "
            "it for a file)"
        )


def check_missing(missing: int, nodes: int, what: str) -> None:
    """Refuse a map some of whose elevations are missing, by their number."""
    if missing == nodes:
        raise UsageError(
            f"the map in {what} holds no elevation at all, every node is missing: give another"
        )
    if missing:
        raise UsageError(
            f"the map in {what} has {missing} nodes that are missing, NaN or infinite: fill them "
            "first, every elevation must be finite (terrain.nodata=fill does it for a file)"
        )


def marked(elevation: Floats, number: float) -> Floats:
    """Make NaN of every elevation that is a number, to single precision; the rest is not copied."""
    missing = np.isclose(elevation, number, rtol=SAME, atol=0.0)
    return np.where(missing, np.nan, elevation) if missing.any() else elevation


class Ends:
    """The two lowest and the two highest elevations of a map that is seen part by part."""

    def __init__(self) -> None:
        self.low, self.high = [math.inf, math.inf], [math.inf, math.inf]  # the highest negated

    def see(self, elevation: Floats) -> None:
        """Take in a part of any shape; what is not finite is passed over."""
        for ends, values in ((self.low, elevation), (self.high, -elevation)):
            finite = np.isfinite(values)
            least = np.min(values, where=finite, initial=math.inf)
            second = np.min(values, where=finite & (values > least), initial=math.inf)
            ends[:] = [*sorted({*ends, float(least), float(second)}), math.inf][:2]

    def lone(self) -> tuple[float, float, float] | None:
        """Find a value at an end that is far from all others.

        Returns
        -------
        tuple or None
            The value, and the lowest and highest of all others; None if there is none.
        """
        (low, low_rest), (high, high_rest) = self.low, (-end for end in self.high)
        for value, start, end in ((low, low_rest, high), (high, low, high_rest)):
            gap, rest = min(abs(value - start), abs(value - end)), end - start
            far = FAR_MARK if value in MARKS else FAR
            if 0 < rest < math.inf and far * rest < gap:
                return value, start, end
        return None


def filled(grid: Grid) -> Grid:
    """Give every node without a finite elevation that of the nearest node that has one.

    Nodes count as equally far apart along both axes. Without any elevation nothing changes.
    """
    from scipy.ndimage import distance_transform_edt

    missing = ~np.isfinite(grid.elevation)
    if missing.all() or not missing.any():
        return grid
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return replace(grid, elevation=grid.elevation[tuple(nearest)])


def resampled(grid: Grid, shape: Sequence[int]) -> Grid:
    """Resample a grid over the same area, anti-aliased.

    Along an axis that loses nodes by a factor f a Gaussian of standard deviation (f - 1) / 2 old
    nodes smooths first, truncated at four of them; then follows linear interpolation at the middles
    of the new nodes. The border is mirrored about the outermost nodes. These are the steps of
    scikit-image's ``resize`` with ``order=1, anti_aliasing=True``.

    Parameters
    ----------
    grid
        Every elevation finite.
    shape
        New numbers of rows and columns.

    Returns
    -------
    Grid

    Raises
    ------
    UsageError
        If that is too many nodes, or the grid is too long.
    """
    check_resampling(grid.elevation.shape, shape)
    along_y, along_x = map(_resampling, grid.elevation.shape, shape)
    return replace(grid, elevation=(along_x @ (along_y @ grid.elevation).T).T)


def check_resampling(old: Sequence[int], new: Sequence[int]) -> None:
    """Refuse to resample to too many nodes, or what is too long to be resampled."""
    if math.prod(new) > MAX_NODES:
        raise UsageError(
            f"terrain.shape={list(new)} has more than {MAX_NODES} nodes: ask for fewer"
        )
    if max(old) > MAX_SIDE:
        raise UsageError(
            f"terrain.shape={list(new)} cannot be had of {old[0]} x {old[1]} nodes: a map is "
            f"resampled that has up to {MAX_SIDE} rows and columns, so cut it first"
        )


class Resampled:
    """A grid that is resampled part by part, in the memory of the result.

    The steps are those of `resampled`. Missing elevations are left out of the means.

    Parameters
    ----------
    old, new
        Numbers of rows and columns before and after.
    mark
        A number that stands for a missing elevation; None: NaN and infinite ones alone are missing.

    Attributes
    ----------
    nodes, missing
        How many elevations there are before, and how many of those that came were missing.
    ends
        The extreme ones of the others.
    """

    def __init__(self, old: Sequence[int], new: Sequence[int], mark: float | None) -> None:
        check_resampling(old, new)
        self.along = [_resampling(*sizes).tocsc() for sizes in zip(old, new, strict=True)]
        self.mark, self.nodes = mark, math.prod(old)
        self.missing, self.ends = 0, Ends()
        self._sum, self._lost = np.zeros(tuple(new)), np.zeros(tuple(new))

    def add(self, row: int, column: int, block: Floats) -> None:
        """Take in a part by its first row and column; no part may come twice."""
        if self.mark is not None:
            block = marked(block, self.mark)
        self.ends.see(block)
        rows, along_y = self._touched(0, row, block.shape[0])
        columns, along_x = self._touched(1, column, block.shape[1])
        missing = ~np.isfinite(block)
        if lost := int(missing.sum()):
            self.missing += lost
            block = np.where(missing, 0.0, block)
            self._lost[rows, columns] += (along_x @ (along_y @ missing.astype(float)).T).T
        self._sum[rows, columns] += (along_x @ (along_y @ block).T).T

    def elevation(self) -> Floats:
        """Elevations of all that came; NaN where hardly any was there."""
        there = 1.0 - self._lost
        return np.where(there > SEEN, self._sum / np.maximum(there, SEEN), np.nan)

    def _touched(self, axis: int, start: int, size: int) -> "tuple[slice, csr_array]":
        """Find the new nodes that a span of old ones counts in, and its weights there."""
        part = self.along[axis][:, start : start + size]
        first, last = int(part.indices.min()), int(part.indices.max()) + 1
        return slice(first, last), part.tocsr()[first:last]


def assembled(shape: Sequence[int], blocks: Iterable[Block]) -> Floats:
    """Put the parts of a grid together."""
    elevation = np.empty(tuple(shape))
    for row, column, block in blocks:
        elevation[row : row + block.shape[0], column : column + block.shape[1]] = block
    return elevation


def read_in(
    stored: Sequence[int],
    wanted: Sequence[int] | None,
    mark: float | None,
    what: str,
    blocks: Iterable[Block],
) -> tuple[Floats, Resampled | None]:
    """Read a grid part by part: whole, or resampled on the way if it is too large.

    Parameters
    ----------
    stored, wanted
        Rows and columns that there are, and that a grid of more than `MAX_NODES` nodes is resampled
        to; None: it is refused.
    mark
        A number that stands for a missing elevation, in such a grid.
    what
        What it is called in a message.
    blocks
        Its parts; none is asked for before the shape is found possible.

    Returns
    -------
    elevation : ndarray
    resampled : Resampled or None
        What was seen of a grid that was resampled.

    Raises
    ------
    UsageError
        As of `must_coarsen`.
    """
    if not must_coarsen(stored, wanted, what):
        return assembled(stored, blocks), None
    assert wanted is not None
    resampled = Resampled(stored, wanted, mark)
    for block in blocks:
        resampled.add(*block)
    return resampled.elevation(), resampled


def cropped(grid: Grid, crop: Sequence[int]) -> Grid:
    """Keep a block of rows and columns.

    Parameters
    ----------
    grid
        The whole.
    crop
        First row, end row, first column, end column, the ends not included; row 0 is the lowest,
        column 0 the leftmost; negative numbers count from the end.

    Returns
    -------
    Grid

    Raises
    ------
    UsageError
        If the block is not inside, or has fewer than 2 rows or columns.
    """
    rows, columns = grid.elevation.shape
    bottom, top = _span(crop[0], crop[1], rows)
    left, right = _span(crop[2], crop[3], columns)
    if not (0 <= bottom <= top - 2 < rows - 1 and 0 <= left <= right - 2 < columns - 1):
        raise UsageError(
            f"terrain.crop={list(crop)} does not fit {rows} rows and {columns} columns: give "
            "[first row,end row,first column,end column] with at least 2 of each inside the map"
        )
    edges = grid.edges
    if edges is not None:
        west, east, south, north = edges
        dx, dy = (east - west) / columns, (north - south) / rows
        edges = west + left * dx, west + right * dx, south + bottom * dy, south + top * dy
    return replace(grid, elevation=grid.elevation[bottom:top, left:right], edges=edges)


def turned(elevation: Floats, orientation: int) -> Floats:
    """Turn and mirror a map, one of the eight symmetries of a square.

    Parameters
    ----------
    elevation
        Shape (R, C), the first row the lower border.
    orientation
        ``4 m + q``: mirrored left to right if m is 1, then turned by q quarter turns
        counter-clockwise, as seen with y upwards.

    Returns
    -------
    ndarray
        Shape (R, C), or (C, R) after an odd number of quarter turns.
    """
    mirrored = elevation[:, ::-1] if orientation >= 4 else elevation
    # With the first row at the bottom, numpy's turns go the other way round.
    return np.rot90(mirrored, -(orientation % 4))


def _span(start: int, end: int, size: int) -> tuple[int, int]:
    return (start + size if start < 0 else start), (end + size if end < 0 else end)


def _resampling(old: int, new: int) -> "csr_array":
    """Matrix, shape (new, old), that smooths and interpolates along one axis.

    Only the smoothed elevations that the interpolation needs are computed.
    """
    from scipy.sparse import csr_array

    spread = max(0.0, (old / new - 1) / 2)
    reach = int(TRUNCATED * spread + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (spread or 1.0)) ** 2)
    weights /= weights.sum()
    # A node stands for an area: the outer edges of old and new nodes are the same.
    place = (np.arange(new) + 0.5) * (old / new) - 0.5
    before = np.floor(place)
    share = (place - before)[:, None]
    taps = (1 - share) * np.append(weights, 0.0) + share * np.append(0.0, weights)
    index = np.abs(before[:, None].astype(int) + np.arange(-reach, reach + 2)) % (2 * (old - 1))
    index = np.minimum(index, 2 * (old - 1) - index)
    rows = np.repeat(np.arange(new), taps.shape[1])
    return csr_array((taps.ravel(), (rows, index.ravel())), shape=(new, old))
