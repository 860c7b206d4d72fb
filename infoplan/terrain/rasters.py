"""Elevations from the formats of geographers, read by rasterio."""

import importlib.util
import logging
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath
from typing import Any, BinaryIO

import numpy as np

from infoplan.errors import UsageError
from infoplan.terrain import grids
from infoplan.terrain.grids import Block, Edges, Floats, Grid, Resampled

DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".dem": "USGSDEM", ".hgt": "SRTMHGT"}
"""What reads which file: no other driver is tried, whatever the file claims to be."""

FORMATS = {
    "GTiff": "GeoTIFF",
    "USGSDEM": "USGS ASCII DEM",
    "SRTMHGT": "SRTM height file with a name like N46W123.hgt",
}
BYTES_A_NODE = {"USGSDEM": 1, "SRTMHGT": 2}
"""Least bytes that a node takes in a format that does not compress."""

MAX_BLOCK = 2**25
"""Most nodes of a block of a file, which is unpacked as a whole."""

WINDOW = 2**22
"""About as many nodes of a large file are read at once."""

SRTM_NAME = re.compile(r"[NS]\d\d[EW]\d\d\d\.hgt", re.IGNORECASE)
SIGN = re.compile(rb"[+-](?![0-9.])")
"""A sign without a number, which GDAL takes for 0."""


def have_rasterio() -> bool:
    """Say whether rasterio is installed."""
    try:
        return importlib.util.find_spec("rasterio") is not None
    except ValueError:  # what find_spec says of a module that was made None
        return False


def read_raster(
    source: bytes | BinaryIO, name: str, what: str, shape: list[int] | None, mark: float | None
) -> tuple[Grid, Resampled | None]:
    """Read the elevations of a GeoTIFF, USGS DEM or SRTM file, from all its nodes.

    Parameters
    ----------
    source
        The file's bytes, or, of a large one, the open file.
    name
        Its name; the ending names its format. Files beside it are not looked at.
    what
        What it is called in a message.
    shape
        Rows and columns that a grid of more than `MAX_NODES` nodes is resampled to while it is
        read; None: it is refused.
    mark
        A number that stands for a missing elevation besides the file's, in such a grid.

    Returns
    -------
    grid : Grid
        North up; NaN where the file has no data; scale and offset applied.
    resampled : Resampled or None
        What was seen of a grid that was resampled while it was read.

    Raises
    ------
    UsageError
        If rasterio is not installed, the file is damaged, or it holds no map.
    """
    driver = DRIVERS[PurePath(name).suffix.lower()]
    if not have_rasterio():
        raise UsageError(
            f"{what} needs rasterio, which is not installed: pip install 'infoplan[geo]', "
            "or save the map as .npy"
        )
    import rasterio

    # GDAL's own words about a broken file would come besides the one sentence.
    logging.getLogger("rasterio").setLevel(logging.CRITICAL + 1)
    settings = {
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "GDAL_PAM_ENABLED": "NO",
        "GDAL_CACHEMAX": 64,
    }
    try:
        with warnings.catch_warnings(), rasterio.Env(**settings):
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            with _opened(source, driver, name) as dataset:
                size = len(source) if isinstance(source, bytes) else source.seek(0, 2)
                _check_dataset(dataset, size, what)
                if driver == "USGSDEM" and isinstance(source, bytes):
                    _check_signs(source, what)
                blocks = _blocks(dataset)
                elevation, resampled = grids.read_in(dataset.shape, shape, mark, what, blocks)
                return _north_up(dataset, elevation, what), resampled
    except (UsageError, MemoryError):
        raise
    except Exception as error:  # a mangled file fails in many ways
        raise UsageError(
            f"{what} is not a readable {FORMATS[driver]}, or it is damaged or cut short: "
            "get it again, or save the map as .npy"
        ) from error


@contextmanager
def _opened(source: bytes | BinaryIO, driver: str, name: str) -> Iterator[Any]:
    import rasterio

    if not isinstance(source, bytes):
        # The very file that is open, whatever its name leads to by now.
        with rasterio.open(f"/dev/fd/{source.fileno()}", driver=driver) as dataset:
            yield dataset
        return
    # The name matters to one format alone, which has the place from it.
    own = name if driver == "SRTMHGT" and SRTM_NAME.fullmatch(name) else "map"
    with rasterio.MemoryFile(source, filename=own) as file, file.open(driver=driver) as dataset:
        yield dataset


def _check_dataset(dataset: Any, size: int, what: str) -> None:
    """Refuse a file by its header alone, before any memory is taken for what it claims to hold."""
    if dataset.count != 1:
        raise UsageError(f"{what} has {dataset.count} bands: a map has one, so extract it first")
    if np.dtype(dataset.dtypes[0]).kind not in "iuf":
        raise UsageError(f"{what} is of type {dataset.dtypes[0]}: elevations must be real numbers")
    if dataset.colorinterp[0].name == "palette":
        raise UsageError(
            f"{what} is a picture: its numbers stand for colours, not elevations, so get the "
            "elevations it was drawn from"
        )
    if dataset.height * dataset.width * BYTES_A_NODE.get(dataset.driver, 0) > size:
        raise UsageError(
            f"{what} is cut short: it announces {dataset.height} x {dataset.width} nodes and has "
            f"{size} bytes, so copy or download it again"
        )
    if math.prod(dataset.block_shapes[0]) > MAX_BLOCK:
        raise UsageError(
            f"the map in {what} has {dataset.height} x {dataset.width} nodes, too many to be read "
            "in blocks as large as its own: cut, coarsen or tile it first"
        )


def _check_signs(content: bytes, what: str) -> None:
    """Refuse a sign where an elevation should be, by its place after the first record."""
    if found := SIGN.search(content, 1024):
        raise UsageError(
            f"{what} has a sign without a number, byte {found.start() + 1}: correct it, or get "
            "the file again"
        )


def _blocks(dataset: Any) -> Iterator[Block]:
    """Read a grid part by part, each of whole blocks of the file, and never an overview."""
    from rasterio.windows import Window

    high, wide = dataset.block_shapes[0]
    columns = min(dataset.width, max(wide, WINDOW // high // wide * wide))
    rows = min(dataset.height, max(high, WINDOW // columns // high * high))
    for row in range(0, dataset.height, rows):
        for column in range(0, dataset.width, columns):
            window = Window(
                column, row, min(columns, dataset.width - column), min(rows, dataset.height - row)
            )
            yield row, column, _values(dataset, window)


def _values(dataset: Any, window: Any) -> Floats:
    stored = dataset.read(1, masked=True, window=window)
    with np.errstate(over="ignore", invalid="ignore"):  # what a double cannot hold is infinite
        elevation: Floats = stored.astype(np.float64).filled(np.nan)
        return elevation * dataset.scales[0] + dataset.offsets[0]


def _north_up(dataset: Any, elevation: Floats, what: str) -> Grid:
    """Put the south first and the west first, whatever the file's order."""
    transform = dataset.transform
    if not math.isclose(abs(transform.b) + abs(transform.d), 0.0, abs_tol=1e-9 * abs(transform.a)):
        raise UsageError(
            f"the rows of {what} do not run from west to east: turn the map north up first, "
            "with gdalwarp for example"
        )
    # Without a place in the world it is a picture, whose first row is the top.
    placed = not transform.is_identity
    if transform.e < 0 or not placed:
        elevation = elevation[::-1]
    if transform.a < 0:
        elevation = elevation[:, ::-1]
    edges: Edges | None = None
    if placed:
        left, bottom, right, top = dataset.bounds
        edges = min(left, right), max(left, right), min(bottom, top), max(bottom, top)
    return Grid(elevation, dataset.units[0] or None, edges, _crs_name(dataset.crs))


def _crs_name(crs: Any) -> str:
    """Name a coordinate system: its EPSG code if it has one, else its projection's parameters."""
    if not crs:
        return ""
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else crs.to_proj4()
