"""Elevations from the formats of geographers, read by rasterio."""

import importlib.util
import logging
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from infoplan.errors import UsageError
from infoplan.terrain.grids import MAX_NODES, Edges, Floats, Grid, check_shape

DRIVERS = {
    ".tif": "GTiff",
    ".tiff": "GTiff",
    ".dem": "USGSDEM",
    ".hgt": "SRTMHGT",
    ".asc": "AAIGrid",
}
"""What reads which file: no other driver is tried, whatever the file claims to be."""

FORMATS = {
    "GTiff": "GeoTIFF",
    "USGSDEM": "USGS ASCII DEM",
    "SRTMHGT": "SRTM height file with a name like N46W123.hgt",
    "AAIGrid": "ESRI ASCII grid",
}
BYTES_A_NODE = {"USGSDEM": 1, "SRTMHGT": 2, "AAIGrid": 2}
"""Least bytes that a node takes in a format that does not compress."""

MAX_STORED_NODES = 2**30
"""Most nodes of a file that is coarsened while it is read."""


def have_rasterio() -> bool:
    """Say whether rasterio is installed."""
    try:
        return importlib.util.find_spec("rasterio") is not None
    except ValueError:  # what find_spec says of a module that was made None
        return False


def read_raster(file: Path, what: str, coarsen: bool) -> Grid:
    """Read the elevations of a GeoTIFF, USGS DEM, SRTM or ESRI ASCII file.

    Parameters
    ----------
    file
        Its ending names its format; files beside it are not looked at.
    what
        What it is called in a message.
    coarsen
        Whether a file of more than `MAX_NODES` nodes is read as means over square blocks of them.

    Returns
    -------
    Grid
        North up; NaN where the file has no data; scale and offset applied.

    Raises
    ------
    UsageError
        If rasterio is not installed or cannot read the file, or it is not a map, or too large.
    """
    if not have_rasterio():
        raise UsageError(
            f"{what} is read by rasterio, which is not installed: "
            "pip install 'infoplan[geo]', or save the map as .npy"
        )
    import rasterio
    import rasterio.errors

    driver = DRIVERS[file.suffix.lower()]
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
            with rasterio.open(file, driver=driver) as dataset:
                _check_dataset(dataset, file, what, coarsen)
                return _north_up(dataset, _read(dataset), what)
    except UsageError:
        raise
    except Exception as error:  # a mangled file fails in many ways
        raise UsageError(
            f"{what} is not a readable {FORMATS[driver]}, or it is damaged or cut short: "
            "get it again, or save the map as .npy"
        ) from error


def _check_dataset(dataset: Any, file: Path, what: str, coarsen: bool) -> None:
    """Refuse a file by its header alone, before any memory is taken for what it claims to hold."""
    if dataset.count != 1:
        raise UsageError(f"{what} has {dataset.count} bands: a map has one, so extract it first")
    if np.dtype(dataset.dtypes[0]).kind not in "iuf":
        raise UsageError(f"{what} is of type {dataset.dtypes[0]}: elevations must be real numbers")
    nodes = dataset.height * dataset.width
    size = file.stat().st_size
    if nodes * BYTES_A_NODE.get(dataset.driver, 0) > size:
        raise UsageError(
            f"{what} is cut short: it announces {dataset.height} x {dataset.width} nodes and has "
            f"{size} bytes, so copy or download it again"
        )
    if math.prod(dataset.block_shapes[0]) > MAX_NODES or nodes > MAX_STORED_NODES:
        raise UsageError(
            f"the map in {what} has {dataset.height} x {dataset.width} nodes, too many to be read: "
            "cut or coarsen it first"
        )
    if nodes > MAX_NODES and not coarsen:
        raise UsageError(
            f"the map in {what} has {dataset.height} x {dataset.width} nodes, more than the "
            f"{MAX_NODES} that are read as they are: give terrain.shape=[rows,columns] to have it "
            "coarsened"
        )
    check_shape(_shape_read(dataset), what)


def _shape_read(dataset: Any) -> tuple[int, int]:
    """Rows and columns after coarsening: few enough, by square blocks as small as possible."""
    block = math.isqrt(math.ceil(dataset.height * dataset.width / MAX_NODES) - 1) + 1
    # The blocks at the borders, cut off, count as whole ones.
    while math.ceil(dataset.height / block) * math.ceil(dataset.width / block) > MAX_NODES:
        block += 1
    return math.ceil(dataset.height / block), math.ceil(dataset.width / block)


def _read(dataset: Any) -> Floats:
    from rasterio.enums import Resampling

    stored = dataset.read(
        1, masked=True, out_shape=_shape_read(dataset), resampling=Resampling.average
    )
    elevation = stored.astype(np.float64).filled(np.nan)
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
