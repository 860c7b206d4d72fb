"""The record of a terrain, and its elevation between the nodes."""

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.extent import Extent, checked_extent
from infoplan.html_table import html_facts
from infoplan.obstacles import NOWHERE, Obstacles
from infoplan.wording import counted, figure, harmless

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Terrain:
    """Elevations over a rectangular workspace.

    Node (i, j) of the R x C array lies at y = ymin + i (ymax - ymin) / (R - 1),
    x = xmin + j (xmax - xmin) / (C - 1): the first row is the lower border, the first column the
    left one.

    Attributes
    ----------
    name
        Which map, as in ``helens``, ``file-hills``, ``random_field-seed3``, ``volcano-turned5``.
    elevation
        Shape (R, C), a read-only copy of what was given.
    extent
        xmin, xmax, ymin, ymax, workspace units.
    unit
        Unit of the elevations.
    sha256
        Digest of the map: of its file's bytes or of its array's, and of what was done to them.
    world
        West, east, south and north of the outermost nodes, in `crs`; None without a place there.
    crs
        The coordinate system of `world`, in words; empty where it is not known.
    obstacles
        Where the robot must not go.

    Raises
    ------
    UsageError
        If the extent is not four finite numbers with xmin < xmax and ymin < ymax.
    """

    name: str
    elevation: Floats
    extent: Extent
    unit: str
    sha256: str
    world: Extent | None = None
    crs: str = ""
    obstacles: Obstacles = NOWHERE

    def __post_init__(self) -> None:
        elevation = np.array(self.elevation, dtype=np.float64, order="C")
        elevation.setflags(write=False)
        object.__setattr__(self, "elevation", elevation)
        object.__setattr__(self, "extent", checked_extent(self.extent))

    def __repr__(self) -> str:
        """Sum up in a line."""
        rows, columns = self.elevation.shape
        return harmless(
            f"Terrain({self.name}: {rows} x {columns} nodes, elevation {self._heights()})"
        )

    def _repr_html_(self) -> str:
        """Show its facts in a notebook; `infoplan.plot_terrain` draws it."""
        rows, columns = self.elevation.shape
        xmin, xmax, ymin, ymax = self.extent
        facts = {
            "nodes": f"{rows} x {columns}, rows along y",
            "workspace": f"x {xmin:.10g} to {xmax:.10g}, y {ymin:.10g} to {ymax:.10g}",
            "elevation": self._heights(),
        }
        if self.obstacles.polygons:
            facts["no-go"] = counted(len(self.obstacles.polygons), "polygon")
        if self.world is not None:
            west, east, south, north = (f"{bound:.10g}" for bound in self.world)
            facts["world"] = f"{west} to {east}, {south} to {north} {self.crs}".rstrip()
        return html_facts(f"Terrain {self.name}", facts | {"sha256": self.sha256})

    def _heights(self) -> str:
        """Lowest and highest elevation with their unit."""
        if np.isnan(self.elevation).all():
            return f"unknown, in {self.unit}"
        low, high = np.nanmin(self.elevation), np.nanmax(self.elevation)
        return f"{figure(float(low))} to {figure(float(high))} {self.unit}"

    def elevation_at(self, x1: ArrayLike, x2: ArrayLike) -> Floats:
        """Elevation by bilinear interpolation between the nodes.

        Parameters
        ----------
        x1, x2
            x and y of the locations, workspace units, of shapes that broadcast; the border belongs
            to the terrain.

        Returns
        -------
        ndarray
            Elevations in the terrain's unit, of the broadcast shape.

        Raises
        ------
        ValueError
            If a location lies outside the extent by more than rounding.
        """
        xmin, xmax, ymin, ymax = self.extent
        j, along_x = _cell(x1, xmin, xmax, self.elevation.shape[1])
        i, along_y = _cell(x2, ymin, ymax, self.elevation.shape[0])
        z = self.elevation
        lower = z[i, j] * (1 - along_x) + z[i, j + 1] * along_x
        upper = z[i + 1, j] * (1 - along_x) + z[i + 1, j + 1] * along_x
        return np.asarray(lower * (1 - along_y) + upper * along_y)


def array_digest(elevation: Floats) -> str:
    """SHA-256 of an array's elevations as little-endian doubles in C order."""
    return hashlib.sha256(np.ascontiguousarray(elevation, dtype="<f8").tobytes()).hexdigest()


def _cell(
    position: ArrayLike, low: float, high: float, nodes: int
) -> tuple[NDArray[np.intp], Floats]:
    """Find along one axis the node before each position, and how far it is to the next, 0 to 1."""
    position = np.asarray(position, dtype=np.float64)
    tolerance = 1e-9 * (high - low)
    # Written so that NaN counts as outside.
    if not np.all((position >= low - tolerance) & (position <= high + tolerance)):
        raise ValueError(f"a location lies outside the terrain, which ends at {low:g} and {high:g}")
    steps = np.clip((position - low) / (high - low), 0.0, 1.0) * (nodes - 1)
    before = np.minimum(steps.astype(np.intp), nodes - 2)
    return before, steps - before
