"""Maps from the user's own files."""

import hashlib
import re
from pathlib import Path

from infoplan.errors import UsageError
from infoplan.terrain import archives, arrays, rasters
from infoplan.terrain.grids import Grid
from infoplan.wording import suggest

TEXTS = (".csv", ".tsv", ".txt")
ENDINGS = (".npy", ".npz", *TEXTS, *rasters.DRIVERS)
"""How the names of the files end that hold a map; besides, ``.zip`` archives of them."""


def terrain_name(path: Path) -> str:
    """Name of a file's terrain, fit for the name of a folder: ``file-`` and the file's stem."""
    return "file-" + (re.sub(r"[^A-Za-z0-9_-]+", "-", path.stem).strip("-") or "map")


def read_map(
    path: Path, member: str | None = None, array: str | None = None, coarsen: bool = False
) -> tuple[Grid, str]:
    """Read a map from a file, or from a file in a ``.zip`` archive.

    A georeferenced map comes north up, the south as its first row; a picture without a place in the
    world comes with its lowest row first; an array or a text as it is, its first row the y minimum.

    Parameters
    ----------
    path
        The file; its ending, one of `ENDINGS` or ``.zip``, says what it is.
    member
        The map's name in an archive.
    array
        The array's name in a ``.npz`` file.
    coarsen
        Whether a file too large to be read as it is may be read coarser.

    Returns
    -------
    grid : Grid
        NaN or infinite where an elevation is missing.
    sha256 : str
        Digest of the map's file, of the unpacked one if it was in an archive.

    Raises
    ------
    UsageError
        If there is no such file, or it holds no map.
    """
    if not path.is_file():
        what = "a folder" if path.is_dir() else "no file that exists"
        raise UsageError(f"terrain.path={path} names {what}: give the file that holds the map")
    try:
        if path.suffix.lower() != ".zip":
            if member is not None:
                raise UsageError(
                    f"terrain.member={member} has no use with terrain.path={path}, which is no "
                    ".zip archive: leave it out"
                )
            return _read_file(path, str(path), array, coarsen)
        with archives.unpacked(path, member, ENDINGS) as file:
            return _read_file(file, f"{path} ({file.name})", array, coarsen)
    except OSError as error:
        raise UsageError(
            f"terrain.path={path} cannot be read ({error.strerror}): give a file that you may read"
        ) from error


def _read_file(file: Path, what: str, array: str | None, coarsen: bool) -> tuple[Grid, str]:
    ending = file.suffix.lower()
    if ending not in ENDINGS:
        raise UsageError(
            f"{what} has an ending that no map has{suggest(ending, ENDINGS)}: "
            f"a map's name ends in {', '.join(ENDINGS)} or .zip"
        )
    if array is not None and ending != ".npz":
        raise UsageError(
            f"terrain.array={array} has no use with {what}, which is no .npz file: leave it out"
        )
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    if ending == ".npy":
        return Grid(arrays.read_npy(file, what)), digest
    if ending == ".npz":
        return Grid(arrays.read_npz(file, what, array)), digest
    if ending in TEXTS:
        return Grid(arrays.read_text(file, what)), digest
    return rasters.read_raster(file, what, coarsen), digest
