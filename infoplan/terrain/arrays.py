"""Elevations from NumPy's files."""

import io
import math
import zipfile
from typing import IO

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.terrain.grids import check_shape
from infoplan.wording import harmless, suggest

Floats = NDArray[np.float64]

NUMERIC_KINDS = "iuf"
# Version 3 differs from 2 in the names of fields alone, which a map has not.
HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def read_npy(content: bytes, what: str) -> Floats:
    """Read the array of a ``.npy`` file from its bytes; a message calls it `what`.

    Raises
    ------
    UsageError
        If it is not a two-dimensional array of real numbers.
    """
    return _read_array(io.BytesIO(content), len(content), what)


def read_npz(content: bytes, what: str, name: str | None) -> Floats:
    """Read an array of a ``.npz`` file from its bytes: the named one, or the only one.

    Raises
    ------
    UsageError
        If there is no such file or array, several for None, or the array is no map.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            arrays = {
                entry.filename.removesuffix(".npy"): entry
                for entry in archive.infolist()
                if entry.filename.endswith(".npy")
            }
            chosen = _chosen(name, list(arrays), what)
            shown = f"{what}, array {harmless(chosen)}"
            with archive.open(arrays[chosen]) as stream:
                return _read_array(stream, arrays[chosen].file_size, shown)
    except (UsageError, MemoryError):
        raise
    except Exception as error:  # a mangled archive fails in many ways
        raise UsageError(
            f"{what} is not a .npz file, or it is damaged: save the map with numpy.savez"
        ) from error


def _chosen(name: str | None, arrays: list[str], what: str) -> str:
    listed = harmless(", ".join(arrays[:9]))
    if not arrays:
        raise UsageError(f"{what} holds no array: save the map with numpy.savez")
    if name is None:
        if len(arrays) > 1:
            raise UsageError(
                f"{what} holds {len(arrays)} arrays: choose one with terrain.array= ({listed})"
            )
        return arrays[0]
    if name not in arrays:
        raise UsageError(
            f"{what} holds no array {name!r}{suggest(name, arrays)}: terrain.array= takes {listed}"
        )
    return name


def _read_array(stream: IO[bytes], size: int, what: str) -> Floats:
    """Read an array of real numbers; nothing is read of one whose header rules it out."""
    _check_header(stream, size, what)
    stream.seek(0)
    stored = np.lib.format.read_array(stream, allow_pickle=False)
    with np.errstate(over="ignore"):  # what a double cannot hold becomes infinite
        return stored.astype(np.float64, order="C")


def _check_header(stream: IO[bytes], size: int, what: str) -> None:
    try:
        read_header = HEADER_READERS[np.lib.format.read_magic(stream)]
        shape, _, dtype = read_header(stream)
    except OSError:
        raise
    except Exception as error:  # a mangled header fails in many ways
        raise UsageError(
            f"{what} is not a .npy file, or it is damaged: save the map with numpy.save"
        ) from error
    if dtype.hasobject:
        raise UsageError(
            f"{what} holds pickled Python objects, which are never loaded: save the map with "
            "numpy.save as an array of numbers"
        )
    if dtype.kind not in NUMERIC_KINDS:
        raise UsageError(
            f"the map in {what} is of type {dtype}: elevations must be real numbers, integer "
            "or floating"
        )
    available, needed = size - stream.tell(), math.prod(shape) * dtype.itemsize
    if available < needed:
        raise UsageError(
            f"{what} is cut short: it announces {needed} bytes of elevations and has {available}, "
            "so copy or save it again"
        )
    check_shape(shape, what)
