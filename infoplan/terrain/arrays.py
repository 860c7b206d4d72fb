"""Elevations from NumPy's files and from grids of numbers in a text."""

import math
import re
import warnings
import zipfile
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.terrain.grids import MAX_NODES, check_shape
from infoplan.wording import suggest

Floats = NDArray[np.float64]

NUMERIC_KINDS = "iuf"
# Version 3 differs from 2 in the names of fields alone, which a map has not.
HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}
MAX_TEXT = 2**28
"""Largest text that is read, bytes."""

DELIMITERS = ("\t", ";", ",")


def read_npy(file: Path, what: str) -> Floats:
    """Read the array of a ``.npy`` file; a message calls it `what`.

    Raises
    ------
    UsageError
        If it is not a two-dimensional array of real numbers.
    """
    with file.open("rb") as stream:
        return _read_array(stream, file.stat().st_size, what)


def read_npz(file: Path, what: str, name: str | None) -> Floats:
    """Read an array of a ``.npz`` file: the named one, or the only one.

    Raises
    ------
    UsageError
        If there is no such file or array, several for None, or the array is no map.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            arrays = {
                entry.filename.removesuffix(".npy"): entry
                for entry in archive.infolist()
                if entry.filename.endswith(".npy")
            }
            chosen = _chosen(name, list(arrays), what)
            with archive.open(arrays[chosen]) as stream:
                return _read_array(stream, arrays[chosen].file_size, f"{what}, array {chosen}")
    except UsageError:
        raise
    except Exception as error:  # a mangled archive fails in many ways
        raise UsageError(
            f"{what} is not a .npz file, or it is damaged: save the map with numpy.savez"
        ) from error


def read_text(file: Path, what: str) -> Floats:
    """Read a grid of numbers, a row a line; tab, semicolon, comma or blanks stand between them.

    Raises
    ------
    UsageError
        If it is too long, or holds anything but lines with the same number of numbers.
    """
    if file.stat().st_size > MAX_TEXT:
        raise UsageError(
            f"{what} is a text of more than {MAX_TEXT} bytes: save the map as .npy, which is "
            "shorter"
        )
    help_text = "give a line a row, all with the same number of numbers (a missing one is nan)"
    try:
        with file.open(encoding="utf-8-sig") as stream:
            first = next((line for line in stream if not line.isspace()), None)
            if first is None:
                raise UsageError(f"{what} is empty: {help_text}")
            delimiter = next((mark for mark in DELIMITERS if mark in first), None)
            columns = _columns(first, delimiter, what)
            stream.seek(0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of blank lines, which are passed over
                elevation = np.loadtxt(
                    stream,
                    delimiter=delimiter,
                    comments=None,
                    ndmin=2,
                    max_rows=MAX_NODES // columns + 1,
                )
    except UnicodeDecodeError as error:
        raise UsageError(f"{what} is no text: {help_text}") from error
    except UsageError:
        raise
    except (ValueError, OverflowError) as error:
        reason = str(error).splitlines()[0].rstrip(".").partition(";")[0]
        raise UsageError(f"{what} is not a grid of numbers, {reason}: {help_text}") from error
    check_shape(elevation.shape, what)
    return elevation


def _columns(line: str, delimiter: str | None, what: str) -> int:
    """Count the fields of a line, by no list of them: it may be as long as the whole file."""
    most = MAX_NODES // 2
    if delimiter is None:
        columns = sum(1 for _ in islice(re.finditer(r"\S+", line), most + 1))
    else:
        columns = line.count(delimiter) + 1
    if columns > most:
        raise UsageError(
            f"the map in {what} has more than {most} columns, so that two rows are more than the "
            f"{MAX_NODES} nodes that are read: cut or coarsen it first"
        )
    return columns


def _chosen(name: str | None, arrays: list[str], what: str) -> str:
    listed = ", ".join(arrays[:9])
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
