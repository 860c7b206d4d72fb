"""A terrain in words and as a hill-shaded map."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.config import PilotConfig
from infoplan.draw import style
from infoplan.extent import query_grid
from infoplan.robot import bezier_path
from infoplan.terrain import Terrain
from infoplan.terrain.relief import RADIUS, local_relief
from infoplan.wording import figure, harmless

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLAT = 0.05
"""Land is flat where its local relief is below this share of the whole map's."""

SIDE = 400
"""Local relief and shading are taken from at most so many rows and columns of a larger map."""

DENSITY = 10
"""Local relief is taken from at most so many rows and columns a workspace unit."""


def terrain_summary(terrain: Terrain) -> str:
    """Describe a terrain: size, unit, elevations, relief, share of flat land.

    Relief is highest less lowest elevation, over the whole map and within 2 workspace units of a
    node; flat land has a local relief below 5 % of the whole map's. Of a map with more than
    `SIDE` x `SIDE` nodes, or than `DENSITY` a workspace unit, the local relief is that of so many,
    evenly spaced. Text of the map's own, such as its unit, is made harmless.
    """
    z = terrain.elevation
    rows, columns = z.shape
    xmin, xmax, ymin, ymax = terrain.extent
    relief = float(np.ptp(z))
    local = _local_relief(terrain)
    unit = harmless(terrain.unit)
    low, high = (_to_tell(value, relief) for value in (float(z.min()), float(z.max())))
    flat = np.mean(local < FLAT * relief) if relief else 1.0
    facts = {
        "terrain": terrain.name,
        "nodes": f"{rows} x {columns}, rows along y",
        "workspace": f"x {xmin:.10g} to {xmax:.10g}, y {ymin:.10g} to {ymax:.10g}",
        "elevation": f"{low} to {high} {unit}",
        "mean, std": f"{_to_tell(float(z.mean()), relief)}, {figure(float(z.std()))} {unit}",
        "relief": (
            f"{figure(relief)} {unit}; "
            f"within 2 units {figure(float(np.median(local)))} {unit} (median)"
        ),
        "flat land": f"{100 * flat:.0f} % (local relief below {FLAT:.0%} of the whole)",
    }
    if terrain.obstacles.polygons:
        nodes = query_grid(terrain.extent, (SIDE, SIDE))
        share = float(np.mean(terrain.obstacles.contain(nodes)))
        facts["no-go"] = f"{100 * share:.3g} % of the workspace (terrain.obstacles)"
    if terrain.world is not None:
        west, east, south, north = (f"{bound:.10g}" for bound in terrain.world)
        facts["world"] = f"{west} to {east}, {south} to {north} {harmless(terrain.crs)}".rstrip()
    facts["sha256"] = terrain.sha256
    return "\n".join(f"{name:10} {fact}" for name, fact in facts.items())


def draw_terrain(terrain: Terrain, folder: Path) -> Path:
    """Draw a terrain, hill-shaded, with the default pilot path.

    Returns
    -------
    Path
        The PNG; a PDF and the pilot path's CSV lie beside it.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    with style.journal():
        drawing, numbers = terrain_figure(terrain)
        return style.save(drawing, folder, f"terrain-{terrain.name}", numbers)[0]


def terrain_figure(terrain: Terrain) -> "tuple[Figure, pd.DataFrame]":
    """Make the picture of `draw_terrain`, within `infoplan.draw.style.journal`.

    Returns
    -------
    figure : Figure
    numbers : DataFrame
        The pilot path: x1, x2, heading, elevation.
    """
    pilot = PilotConfig()
    path = bezier_path(np.array(pilot.control_points), terrain.extent, pilot.samples)
    drawing = style.new_figure(style.COLUMN, 2.9)
    axes = drawing.add_subplot()
    image = style.show_relief(axes, coarsened(terrain), terrain.extent)
    style.show_obstacles(axes, [polygon.tolist() for polygon in terrain.obstacles.polygons])
    axes.plot(path[:, 0], path[:, 1], ".-", color="white", markersize=2.5, linewidth=0.6)
    axes.plot(*path[0, :2], "o", color="white", markeredgecolor=style.INK, clip_on=False)
    narrow = len(terrain.name) > 12 or terrain.world is not None
    space = "\n" if narrow else " "
    title = f"{terrain.name},{space}pilot path from the ringed sample"
    style.panel(axes, "", title)
    style.colour_bar(image, axes, f"elevation ({_label(terrain.unit)})")
    _world_axes(axes, terrain)
    numbers = pd.DataFrame(path, columns=["x1", "x2", "heading"])
    numbers["elevation"] = terrain.elevation_at(path[:, 0], path[:, 1])
    return drawing, numbers


def coarsened(terrain: Terrain) -> NDArray[np.float64]:
    """Elevations at no more than `SIDE` x `SIDE` even nodes, shape (rows, columns).

    A map that has no more gives its own, whatever its shape.
    """
    if terrain.elevation.size <= SIDE**2:
        return terrain.elevation
    rows, columns = (min(nodes, SIDE) for nodes in terrain.elevation.shape)
    x, y = query_grid(terrain.extent, (rows, columns)).T
    return terrain.elevation_at(x, y).reshape(rows, columns)


def _local_relief(terrain: Terrain) -> NDArray[np.float64]:
    """Local relief of a terrain at no more nodes than tell it."""
    xmin, xmax, ymin, ymax = terrain.extent
    most = [max(2, int(min(DENSITY * side, 1e6)) + 1) for side in (ymax - ymin, xmax - xmin)]
    elevation = coarsened(terrain)
    if np.hypot(xmax - xmin, ymax - ymin) <= RADIUS:
        return np.full(elevation.shape, np.ptp(terrain.elevation))
    rows, columns = elevation.shape
    if rows > most[0] or columns > most[1]:
        rows, columns = min(rows, most[0]), min(columns, most[1])
        x, y = query_grid(terrain.extent, (rows, columns)).T
        elevation = terrain.elevation_at(x, y).reshape(rows, columns)
    return local_relief(elevation, terrain.extent)


def _to_tell(value: float, spread: float) -> str:
    """Write a number so that it can be told from others that differ by a spread or less."""
    if 0 < spread < 0.01 * abs(value) < 1e7:
        return f"{value:.{max(0, 2 - int(np.floor(np.log10(spread))))}f}"
    return figure(value)


def _label(text: str) -> str:
    """Write text of unknown origin so that matplotlib takes none of it for mathematics."""
    return harmless(text).replace("$", r"\$")


def _world_axes(axes: "Axes", terrain: Terrain) -> None:
    """Put the coordinates of a map with a place in the world outside those of the workspace."""
    from matplotlib.ticker import MaxNLocator

    if terrain.world is None:
        return
    for axis in "xy":
        start = 2 * "xy".index(axis)
        world, extent = terrain.world[start : start + 2], terrain.extent[start : start + 2]
        slope = (world[1] - world[0]) / (extent[1] - extent[0])
        there = partial(_straight, at=extent[0], value=world[0], slope=slope)
        back = partial(_straight, at=world[0], value=extent[0], slope=1 / slope)
        outside = getattr(axes, f"secondary_{axis}axis")(-0.22, functions=(there, back))
        getattr(outside, f"set_{axis}label")(
            _label(terrain.crs) if len(terrain.crs) < 20 else "world"
        )
        outside.ticklabel_format(useOffset=False, style="plain")
        getattr(outside, f"{axis}axis").set_major_locator(MaxNLocator(3))
        outside.tick_params(axis="y", labelrotation=90)


def _straight(
    position: NDArray[np.float64], at: float, value: float, slope: float
) -> NDArray[np.float64]:
    return value + slope * (np.asarray(position) - at)
