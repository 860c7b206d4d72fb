"""Maps from the user's own files."""

import hashlib
import io
import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError

NUMERIC_KINDS = "iuf"
# Version 3 differs from 2 in the names of fields alone, which a map has not.
HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def terrain_name(path: Path) -> str:
    """Name of a file's terrain, fit for the name of a folder: ``file-`` and the file's stem."""
    return "file-" + (re.sub(r"[^A-Za-z0-9_-]+", "-", path.stem).strip("-") or "map")


def read_npy(path: Path) -> tuple[NDArray[np.float64], str]:
    """Read a map from a NumPy file.

    Parameters
    ----------
    path
        A ``.npy`` file with a two-dimensional array of real numbers; row 0 is the y minimum.

    Returns
    -------
    elevation : ndarray, shape (R, C)
    sha256 : str
        Digest of the file's bytes.

    Raises
    ------
    UsageError
        If there is no such file, or it holds something else than finite elevations that vary.
    """
    if not path.is_file():
        what = "a folder" if path.is_dir() else "no file that exists"
        raise UsageError(f"terrain.path={path} names {what}: give a .npy file that holds the map")
    try:
        _check_header(path)
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(
            f"terrain.path={path} cannot be read ({error.strerror}): give a .npy file that "
            "you may read"
        ) from error
    stored = np.load(io.BytesIO(content), allow_pickle=False)
    with np.errstate(over="ignore"):  # what a double cannot hold becomes infinite, caught below
        elevation = stored.astype(np.float64, order="C")
    broken = int(np.sum(~np.isfinite(elevation)))
    if broken:
        raise UsageError(
            f"the map in {path} has {broken} nodes that are NaN or infinite: fill them first, "
            "every elevation must be finite"
        )
    if np.all(elevation == elevation[0, 0]):
        raise UsageError(
            f"the map in {path} is {elevation[0, 0]:g} everywhere: there is nothing to map, "
            "give one whose elevations vary"
        )
    return elevation, hashlib.sha256(content).hexdigest()


def _check_header(path: Path) -> None:
    """Refuse a file by its header alone, before any memory is taken for what it claims to hold."""
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            read_header = HEADER_READERS[np.lib.format.read_magic(file)]
            shape, _, dtype = read_header(file)
        except OSError:
            raise
        except Exception as error:  # a mangled header fails in many ways
            raise UsageError(
                f"{path} is not a .npy file, or it is damaged: save the map with numpy.save"
            ) from error
        available = size - file.tell()
    if dtype.hasobject:
        raise UsageError(
            f"{path} holds pickled Python objects, which are never loaded: save the map with "
            "numpy.save as an array of numbers"
        )
    if dtype.kind not in NUMERIC_KINDS:
        raise UsageError(
            f"the map in {path} is of type {dtype}: elevations must be real numbers, integer "
            "or floating"
        )
    if len(shape) != 2:
        raise UsageError(
            f"the map in {path} has the shape {shape}: it must have two dimensions, "
            "rows along y and columns along x"
        )
    if min(shape) < 2:
        raise UsageError(
            f"the map in {path} has the shape {shape}: it must have at least 2 rows and 2 columns"
        )
    needed = math.prod(shape) * dtype.itemsize
    if available < needed:
        raise UsageError(
            f"{path} is cut short: it announces {needed} bytes of elevations and has {available}, "
            "so copy or save it again"
        )
