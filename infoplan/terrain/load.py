"""From a map's name to its terrain."""

import os
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import RunError, UsageError
from infoplan.terrain import files, helens, jacksboro, volcano
from infoplan.terrain.surface import Terrain, array_digest, checked_extent

TERRAINS = {
    "helens": "Mount St. Helens after 1980, the paper's 100 x 100 grid, feet",
    "volcano": "built-in surface with that mountain's dimensions, 100 x 100, feet",
    "jacksboro": "the Jacksboro fault in Tennessee, 344 x 403, metres, from matplotlib",
    "file": "your own: a 2-D array in the .npy file that terrain.path names",
}
"""Each map's name and what it is."""

BUILT_IN: dict[str, tuple[Callable[[], NDArray[np.float64]], str]] = {
    "volcano": (volcano.volcano, volcano.UNIT),
    "jacksboro": (jacksboro.jacksboro, jacksboro.UNIT),
}


class TerrainFallbackWarning(UserWarning):
    """The paper's grid can be had nowhere, so the built-in volcano takes its place."""


def load_terrain(
    name: str,
    *,
    path: str | os.PathLike[str] | None = None,
    extent: Sequence[float] = (0.0, 50.0, 0.0, 50.0),
    unit: str | None = None,
    on_missing: str = "fallback",
) -> Terrain:
    """Load a map.

    Parameters
    ----------
    name
        One of `TERRAINS`.
    path
        For ``helens``, the grid's file or a folder that holds ``helens.npy``; None: looked for in
        ``$INFOPLAN_DATA`` (a file or a folder) and in the user's cache, else downloaded once. For
        ``file``, the ``.npy`` file. The other maps have none.
    extent
        xmin, xmax, ymin, ymax of the workspace it is laid over, workspace units.
    unit
        Unit of a file's elevations, metres if None. The other maps have their own, which is all
        that may be given: nothing is converted.
    on_missing
        Where ``helens`` can be had nowhere: ``fallback`` gives ``volcano`` and warns with
        `TerrainFallbackWarning`; ``error`` raises.

    Returns
    -------
    Terrain

    Raises
    ------
    UsageError
        If the map cannot be had, is not a map, or the arguments do not fit it.
    """
    if name not in TERRAINS:
        raise UsageError(f"terrain={name} is not a map: use {', '.join(TERRAINS)}")
    if on_missing not in ("fallback", "error"):
        raise UsageError(f"terrain.on_missing={on_missing} is not a choice: use fallback or error")
    bounds = checked_extent(extent)
    location = None if path is None else Path(path).expanduser()
    if name == "file":
        if location is None:
            raise UsageError("terrain=file needs terrain.path: give the .npy file with the map")
        elevation, digest = files.read_npy(location)
        return Terrain(files.terrain_name(location), elevation, bounds, unit or "m", digest)
    if name == "helens":
        try:
            file = helens.find_helens(location) or helens.fetch_helens()
        except RunError as error:
            _refuse_or_warn(error, on_missing)
            name = "volcano"
        else:
            _check_unit(name, unit, helens.UNIT)
            elevation = helens.read_helens(file)
            return Terrain(name, elevation, bounds, helens.UNIT, helens.SHA256)
    elif location is not None:
        raise UsageError(
            f"terrain.path={path} has no use with terrain={name}, which is built in: leave it "
            "out, or use terrain=file for a map of your own"
        )
    surface, own_unit = BUILT_IN[name]
    _check_unit(name, unit, own_unit)
    elevation = surface()
    return Terrain(name, elevation, bounds, own_unit, array_digest(elevation))


def _check_unit(name: str, unit: str | None, own: str) -> None:
    if unit not in (None, own):
        raise UsageError(
            f"terrain.unit={unit} does not fit terrain={name}, which is in {own} and is not "
            "converted: leave terrain.unit out"
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
        stacklevel=3,
    )
