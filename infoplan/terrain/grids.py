"""Grids of elevations, and what is done to them before they become a terrain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Floats = NDArray[np.float64]
Edges = tuple[float, float, float, float]

TRUNCATED = 4.0
"""Standard deviations after which a smoothing Gaussian ends."""

MAX_NODES = 2**25
"""Most nodes that a map is read, resampled or made with: a quarter of a gigabyte of doubles."""


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


def check_elevations(elevation: Floats, what: str) -> None:
    """Refuse a map with missing elevations, or with nothing to map.

    Raises
    ------
    UsageError
        If an elevation is not finite, or all are the same.
    """
    missing = int(np.sum(~np.isfinite(elevation)))
    if missing == elevation.size:
        raise UsageError(
            f"the map in {what} holds no elevation at all, every node is missing: give another"
        )
    if missing:
        raise UsageError(
            f"the map in {what} has {missing} nodes that are missing, NaN or infinite: fill them "
            "first, every elevation must be finite (terrain.nodata=fill does it for a file)"
        )
    if np.all(elevation == elevation[0, 0]):
        raise UsageError(
            f"the map in {what} is {elevation[0, 0]:g} everywhere: there is nothing to map, "
            "give one whose elevations vary"
        )


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
        If that is too many nodes.
    """
    rows, columns = shape
    if rows * columns > MAX_NODES:
        raise UsageError(
            f"terrain.shape={[rows, columns]} has more than {MAX_NODES} nodes: ask for fewer"
        )
    along_y, along_x = map(_resampling, grid.elevation.shape, shape)
    return replace(grid, elevation=(along_x @ (along_y @ grid.elevation).T).T)


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
