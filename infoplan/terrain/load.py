"""From a map's name and options to its terrain."""

import hashlib
import json
import math
import os
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from infoplan.config import (
    TERRAIN_SCHEMAS,
    FileConfig,
    HelensConfig,
    OwnTerrainConfig,
    RandomFieldConfig,
    TerrainConfig,
    terrain_kind,
)
from infoplan.errors import RunError, UsageError
from infoplan.extent import Extent, checked_extent
from infoplan.files import user_path
from infoplan.obstacles import Obstacles, obstacles_of, rectangles
from infoplan.options import check_options, plain_number
from infoplan.terrain import files, grids, helens, jacksboro, own, rasters, volcano
from infoplan.terrain.grids import Ends, Floats, Grid
from infoplan.terrain.random_field import random_field
from infoplan.terrain.surface import Terrain, array_digest
from infoplan.units import in_unit
from infoplan.wording import figure, harmless, suggest

TERRAINS = {
    "helens": "Mount St. Helens after 1980, the paper's 100 x 100 grid, feet",
    "volcano": "built-in surface with that mountain's dimensions, 100 x 100, feet",
    "jacksboro": "the Jacksboro fault in Tennessee, 344 x 403, metres, from matplotlib",
    "random_field": "Gaussian random field: terrain.seed, terrain.lengthscale and more",
    "file": f"your own, in the file that terrain.path names: {', '.join(files.ENDINGS)} or .zip",
    "own": "your own, made by the function that terrain.function names",
}
"""Each map's name and what it is."""

BUILT_IN: dict[str, tuple[Callable[[], Floats], str]] = {
    "volcano": (volcano.volcano, volcano.UNIT),
    "jacksboro": (jacksboro.jacksboro, jacksboro.UNIT),
}


class TerrainFallbackWarning(UserWarning):
    """The paper's grid can be had nowhere, so the built-in volcano takes its place."""


class TerrainValueWarning(UserWarning):
    """A map's elevations look as if some were none, or as if none was marked as missing."""


@dataclass
class FoundMap:
    """A map as it was found: its name, its nodes, the digest of its bytes, what was done to it."""

    name: str
    grid: Grid
    sha256: str
    changes: dict[str, Any] = field(default_factory=dict)


def load_terrain(name: str, **options: Any) -> Terrain:
    """Load a map.

    Parameters
    ----------
    name
        One of `TERRAINS`, or the name of a terrain that was loaded, such as ``file-hills``.
    **options
        Those of the map's schema in `infoplan.config`: ``extent``, ``unit`` and ``orientation`` for
        all; for ``helens``, ``path`` and ``on_missing``; and so on. Where ``helens`` can be had
        nowhere, ``on_missing="fallback"`` gives ``volcano`` and warns with
        `TerrainFallbackWarning`. A lone elevation far from all others in a file warns with
        `TerrainValueWarning`.

    Returns
    -------
    Terrain
        Its name tells apart the maps of one kind that differ by the file, the seed, the unit they
        were converted to, or the orientation.

    Raises
    ------
    UsageError
        If the map cannot be had, is not a map, or the options do not fit it.
    """
    config = _configured(name, options)
    extent = checked_extent(config.extent)
    source = SOURCES[config.name](config)
    what = f"terrain={config.name}"
    own_elevation = source.grid.elevation
    elevation, unit = in_unit(own_elevation, source.grid.unit, config.unit, what)
    if elevation is not own_elevation:
        source.name += f"-{unit}"
        source.changes["unit"] = unit
    world = source.grid.node_bounds()
    if config.orientation:
        _check_turn(config.orientation, extent)
        elevation = grids.turned(elevation, config.orientation)
        source.name += f"-turned{config.orientation}"
        source.changes["orientation"] = config.orientation
        world = None
    digest = source.sha256
    if source.changes:
        digest += json.dumps(source.changes, sort_keys=True)
        digest = hashlib.sha256(digest.encode()).hexdigest()
    crs = source.grid.crs if world else ""
    obstacles = _obstacles(config, extent)
    return Terrain(source.name, elevation, extent, unit, digest, world, crs, obstacles)


def available() -> dict[str, str]:
    """Say of each map, by its name, whether it is to be had on this machine."""
    file = helens.find_helens()
    raster_formats = ", ".join(rasters.DRIVERS)
    return dict.fromkeys(TERRAINS, "here") | {
        "helens": f"here, {file}" if file else "not here: infoplan terrain fetch downloads it",
        "file": "here"
        if rasters.have_rasterio()
        else f"here, but {raster_formats} need rasterio: pip install 'infoplan[geo]'",
    }


def _configured(name: str, options: dict[str, Any]) -> TerrainConfig:
    """Put a terrain's options into its schema, checked."""
    kind = terrain_kind(name)
    if kind not in TERRAIN_SCHEMAS:
        raise UsageError(
            f"terrain={name} is not a map{suggest(name, TERRAIN_SCHEMAS)}: "
            f"use {', '.join(TERRAIN_SCHEMAS)}"
        )
    schema = TERRAIN_SCHEMAS[kind]
    known = [item.name for item in fields(schema)]
    for key in options:
        if key not in known:
            raise UsageError(
                f"terrain={kind} has no option terrain.{key}{suggest(key, known)}: "
                f"it takes {', '.join(known[1:])}"
            )
    given = {key: _plain(value) for key, value in options.items()}
    config = schema(**(given | {"name": kind}))
    config.extent = list(checked_extent(config.extent))
    check_options(config, "terrain.")
    return config


def _plain(value: Any) -> Any:
    """Give a value of Python's the type that it has in a configuration: a path is text."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _obstacles(config: TerrainConfig, extent: Extent) -> Obstacles:
    """No-go zones: the polygons, and what the mask marks."""
    polygons = list(config.obstacles)
    if config.obstacles_mask is not None:
        try:
            values = files.read_map(user_path(config.obstacles_mask), files.Wanted()).grid.elevation
        except UsageError as error:  # which speaks of the option of other maps
            said = str(error).replace("terrain.path=", "terrain.obstacles_mask=")
            raise UsageError(said) from error
        marked = np.isfinite(values) & (values != 0)
        polygons += rectangles(marked, extent)
    return obstacles_of(polygons)


def _built_in(config: TerrainConfig) -> FoundMap:
    surface, unit = BUILT_IN[config.name]
    elevation = surface()
    return FoundMap(config.name, Grid(elevation, unit), array_digest(elevation))


def _helens(config: HelensConfig) -> FoundMap:
    location = None if config.path is None else user_path(config.path)
    try:
        file = helens.find_helens(location) or helens.fetch_helens()
    except RunError as error:
        _refuse_or_warn(error, config.on_missing)
        return _built_in(TerrainConfig("volcano"))
    return FoundMap("helens", Grid(helens.read_helens(file), helens.UNIT), helens.SHA256)


def _file(config: FileConfig) -> FoundMap:
    if config.path is None:
        raise UsageError("terrain=file needs terrain.path: give the file with the map")
    path, what = user_path(config.path), harmless(config.path)
    mark = _mark(config.nodata)
    wanted = files.Wanted(config.member, config.array, config.shape, mark)
    found = files.read_map(path, wanted)
    grid, ends = found.grid, Ends()
    changes = found.changes | ({} if config.array is None else {"array": config.array})
    concerns = []
    if found.resampled is not None:
        ends = found.resampled.ends
        if config.nodata == "refuse":
            grids.check_missing(found.resampled.missing, found.resampled.nodes, what)
    else:
        if mark is not None:
            marked = grids.marked(grid.elevation, mark)
            if marked is grid.elevation:
                concerns.append(f"terrain.nodata={plain_number(mark)} marks no node of {what}")
            grid = replace(grid, elevation=marked)
        ends.see(grid.elevation)
    if lone := ends.lone():
        value, low, high = plain_number(lone[0]), figure(lone[1]), figure(lone[2])
        concerns.append(
            f"an elevation of {what}, {value}, is far from all others, {low} to {high}: if it "
            f"marks missing ones, terrain.nodata={value} fills them; if it is right, go on"
        )
    if config.nodata != "refuse":
        full = grids.filled(grid)
        if full is not grid or mark is not None or found.resampled is not None:
            changes["nodata"], grid = config.nodata, full
    if config.shape is not None:
        # A missing elevation would spread, so none may be left.
        grids.check_elevations(grid.elevation, what)
        changes["shape"], grid = config.shape, grids.resampled(grid, config.shape)
    if config.crop is not None:
        changes["crop"], grid = config.crop, grids.cropped(grid, config.crop)
    grids.check_elevations(grid.elevation, what)
    for concern in concerns:
        warnings.warn(concern, TerrainValueWarning, stacklevel=4)
    return FoundMap(files.terrain_name(path), grid, found.sha256, changes)


def _mark(nodata: Any) -> float | None:
    """Return the number that stands for missing elevations, None for a word."""
    if isinstance(nodata, str):
        return None
    if isinstance(nodata, bool) or not isinstance(nodata, int | float):
        raise UsageError(
            f"terrain.nodata={nodata} is not possible: use refuse, fill or the number that marks "
            "missing elevations"
        )
    return float(nodata)


def _random_field(config: RandomFieldConfig) -> FoundMap:
    xmin, xmax, ymin, ymax = config.extent
    elevation = random_field(
        config.seed,
        config.shape,
        (xmax - xmin, ymax - ymin),
        config.lengthscale,
        config.amplitude,
        config.mean,
    )
    grids.check_elevations(
        elevation,
        f"terrain=random_field with terrain.lengthscale={config.lengthscale}, "
        f"terrain.amplitude={config.amplitude:g} and terrain.mean={config.mean:g}",
    )
    # Its numbers are in whatever unit is named: nothing is converted.
    return FoundMap(f"random_field-seed{config.seed}", Grid(elevation), array_digest(elevation))


def _own(config: OwnTerrainConfig) -> FoundMap:
    if config.function is None:
        raise UsageError(
            "terrain=own needs terrain.function: give module.function, which returns the elevations"
        )
    grid = own.make(config.function, config.options)
    grids.check_elevations(grid.elevation, f"what {config.function} returns")
    name = re.sub(r"\W+", "-", config.function.rpartition(".")[2], flags=re.ASCII).strip("-")
    return FoundMap(f"own-{name or 'map'}", grid, array_digest(grid.elevation))


SOURCES: dict[str, Callable[[Any], FoundMap]] = {
    "helens": _helens,
    "volcano": _built_in,
    "jacksboro": _built_in,
    "file": _file,
    "random_field": _random_field,
    "own": _own,
}


def _check_turn(orientation: int, extent: tuple[float, float, float, float]) -> None:
    xmin, xmax, ymin, ymax = extent
    if orientation % 2 and not math.isclose(xmax - xmin, ymax - ymin):
        raise UsageError(
            f"terrain.orientation={orientation} turns by a right angle, which would stretch the "
            f"map over terrain.extent={list(extent)}: make its sides equal, or use an even one"
        )


def _refuse_or_warn(error: RunError, on_missing: str) -> None:
    data = os.environ.get("INFOPLAN_DATA")
    searched = f"INFOPLAN_DATA={data} holds no {helens.FILE} and " if data else ""
    remedy = (
        f"set INFOPLAN_DATA or terrain.path to a copy of {helens.FILE}, or run "
        "`infoplan terrain fetch` where there is a network"
    )
    if on_missing == "error":
        raise UsageError(f"terrain=helens is not to be had: {searched}{error}; {remedy}") from error
    warnings.warn(
        f"the built-in volcano takes the place of helens, because {searched}{error}; to have "
        f"helens, {remedy} (terrain.on_missing=error forbids the replacement)",
        TerrainFallbackWarning,
        stacklevel=4,
    )
