"""Maps from the user's own files."""

import hashlib
import io
import re
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, BinaryIO

from infoplan.errors import UsageError
from infoplan.files import open_regular, read_up_to
from infoplan.terrain import archives, arrays, esri, points, rasters, texts
from infoplan.terrain.grids import Grid, Resampled
from infoplan.wording import harmless, suggest

TEXTS = (".csv", ".tsv", ".txt")
ENDINGS = (".npy", ".npz", *TEXTS, *rasters.DRIVERS, ".asc")
"""How the names of the files end that hold a map; besides, ``.zip`` archives of them."""

IN_MEMORY = 2**28
"""Largest GeoTIFF or ``.asc`` that is taken into memory before it is read, bytes."""
MAX_BYTES = 2**30
"""Largest file of another format, bytes."""


@dataclass(frozen=True, eq=False)
class MapFile:
    """A map as its file holds it.

    Attributes
    ----------
    grid
        NaN or infinite where an elevation is missing.
    sha256
        Digest of the map's file, of the unpacked one if it was in an archive.
    resampled
        What was seen of a map so large that it was resampled while it was read; else None.
    changes
        What earlier versions read otherwise, for the map's digest.
    """

    grid: Grid
    sha256: str
    resampled: Resampled | None = None
    changes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a file: the member of an archive, the array of a ``.npz`` file, a shape.

    ``mark`` is a number that stands for a missing elevation.
    """

    member: str | None = None
    array: str | None = None
    shape: list[int] | None = None
    mark: float | None = None


def terrain_name(path: Path) -> str:
    """Name of a file's terrain, fit for the name of a folder: ``file-`` and the file's stem."""
    return "file-" + (re.sub(r"[^A-Za-z0-9_-]+", "-", path.stem).strip("-") or "map")


def read_map(path: Path, wanted: Wanted) -> MapFile:
    """Read a map from a file, or from a file in a ``.zip`` archive.

    A georeferenced map comes north up, the south as its first row; a picture without a place in the
    world comes with its lowest row first; an array or a text as it is, its first row the y minimum.

    The digest is that of the bytes that were read: a file is taken into memory first; a large
    GeoTIFF or ``.asc`` stays open, and its digest before and after must be the same.

    Parameters
    ----------
    path
        The file; its ending, one of `ENDINGS` or ``.zip``, says what it is.
    wanted
        What of it. `Wanted.shape` and `Wanted.mark` count for a map that is too large to be read
        as it is; of others the whole is returned.

    Raises
    ------
    UsageError
        If there is no such file, or it holds no map.
    """
    shown = harmless(path)
    try:
        with _opened(path, shown) as stream:
            if path.suffix.lower() != ".zip":
                if wanted.member is not None:
                    raise UsageError(
                        f"terrain.member={harmless(wanted.member)} has no use with "
                        f"terrain.path={shown}, which is no .zip archive: leave it out"
                    )
                return _read(stream, path.name, shown, wanted)
            with archives.unpacked(stream, shown, wanted.member, ENDINGS) as (name, file):
                return _read(file, name, f"{shown} ({harmless(name)})", wanted)
    except OSError as error:
        raise UsageError(
            f"terrain.path={shown} cannot be read ({error.strerror or error}): give a file that "
            "you may read"
        ) from error


def _opened(path: Path, shown: str) -> BinaryIO:
    try:
        return open_regular(path)
    except UsageError as error:
        what = "a folder" if path.is_dir() else "a pipe, a socket or a device"
        raise UsageError(
            f"terrain.path={shown} names {what}: give the file that holds the map"
        ) from error
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:
        raise UsageError(
            f"terrain.path={shown} names no file that exists: give the file that holds the map"
        ) from error


def _read(stream: BinaryIO, name: str, what: str, wanted: Wanted) -> MapFile:
    ending = PurePath(name).suffix.lower()
    if ending not in ENDINGS:
        raise UsageError(
            f"{what} has an ending that no map has{suggest(ending, ENDINGS)}: "
            f"a map's name ends in {', '.join(ENDINGS)} or .zip"
        )
    if wanted.array is not None and ending != ".npz":
        raise UsageError(
            f"terrain.array={harmless(wanted.array)} has no use with {what}, which is no .npz "
            "file: leave it out"
        )
    large = ending in (".tif", ".tiff", ".asc")
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    if large and size > IN_MEMORY:
        return _read_large(stream, name, what, wanted)
    content = read_up_to(stream, size, MAX_BYTES) if size <= MAX_BYTES else b""
    if size > MAX_BYTES or len(content) > MAX_BYTES:
        raise UsageError(f"{what} has more than {MAX_BYTES} bytes: cut or coarsen the map first")
    digest = hashlib.sha256(content).hexdigest()
    if ending in rasters.DRIVERS or ending == ".asc":
        return _raster(content, name, what, wanted, digest)
    if ending == ".npy":
        elevation = arrays.read_npy(content, what)
    elif ending == ".npz":
        elevation = arrays.read_npz(content, what, wanted.array)
    else:
        elevation = texts.read_text(content, what)
    points.check_no_points(elevation, what)
    return MapFile(Grid(elevation), digest)


def _read_large(stream: BinaryIO, name: str, what: str, wanted: Wanted) -> MapFile:
    digest = _digest(stream)
    read = _raster(stream, name, what, wanted, digest)
    if _digest(stream) != digest:
        raise UsageError(f"{what} changed while it was read: try again when it is complete")
    return read


def _digest(stream: BinaryIO) -> str:
    digest = hashlib.sha256()
    stream.seek(0)
    while chunk := stream.read(2**20):
        digest.update(chunk)
    return digest.hexdigest()


def _raster(source: bytes | BinaryIO, name: str, what: str, wanted: Wanted, digest: str) -> MapFile:
    changes = {}
    if PurePath(name).suffix.lower() == ".asc":
        stream = io.BytesIO(source) if isinstance(source, bytes) else source
        stream.seek(0)
        grid, resampled, single = esri.read_asc(stream, what, wanted.shape, wanted.mark)
        if not single:
            # Read in single precision by earlier versions.
            changes["precision"] = "float64"
    else:
        grid, resampled = rasters.read_raster(source, name, what, wanted.shape, wanted.mark)
    if resampled is not None:
        # Means over blocks of nodes were taken first by earlier versions.
        changes["resampled"] = "all nodes"
    return MapFile(grid, digest, resampled, changes)
