"""The maps of stored runs, as far as they are to be had here."""

import math
from pathlib import Path

from infoplan.config import terrain_kind
from infoplan.errors import UsageError
from infoplan.study.identity import config_from_science
from infoplan.study.records import MisfitError, read_science
from infoplan.tables import MAX_ROWS
from infoplan.terrain import Terrain, find_helens, load_terrain


def stored_terrains(
    results_dir: Path, path: str | None = None, member: str | None = None
) -> list[Terrain]:
    """Load the maps of stored runs again, those that are to be had here; nothing is downloaded.

    Maps that a function of a user's own makes are left out: what a results folder names is never
    called.

    Parameters
    ----------
    results_dir
        The folder that holds ``runs``.
    path, member
        The file, and its name in a ``.zip`` archive, of the runs whose map came from a file; None:
        their maps are left out.

    Returns
    -------
    list of Terrain
        Each has the digest of the run's map: it is that map, in that unit and orientation.

    Raises
    ------
    UsageError
        If `path` leads to the map of no run.
    """
    found: dict[str, Terrain] = {}
    failure = ""
    for file in sorted(results_dir.glob("runs/*.yaml")):
        try:
            science = read_science(file)
        except MisfitError:
            continue  # whoever reads the run says what is wrong with it
        options = vars(config_from_science(science).terrain)
        digest = science["terrain"]["sha256"]
        kind = terrain_kind(options["name"])
        shape = options.get("shape")
        if kind == "own" or (isinstance(shape, list) and math.prod(shape) > MAX_ROWS):
            continue
        if kind == "helens":
            options["path"] = find_helens()
        elif kind == "file":
            options |= {"path": path, "member": member}
        if digest in found or options.get("path", "") is None:
            continue
        try:
            terrain = load_terrain(**options)
        except UsageError as error:
            failure = f": {error}"
            continue
        if terrain.sha256 == digest:
            found[digest] = terrain
    if path is not None and not any(terrain.name.startswith("file-") for terrain in found.values()):
        raise UsageError(
            f"terrain.path={path} leads to the map of no run in {results_dir}{failure}"
        )
    return list(found.values())
