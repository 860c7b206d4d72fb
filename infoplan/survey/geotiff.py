"""A survey's map as GeoTIFF, which geographic information systems open."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from infoplan.files import writing


def write_geotiff(
    path: Path,
    bands: Mapping[str, tuple[NDArray[np.float64], str]],
    extent: Sequence[float],
    origin: Sequence[float],
    crs: str | None,
) -> str:
    """Write grids that share their nodes as the bands of a GeoTIFF, if rasterio is installed.

    Parameters
    ----------
    path
        The file; its folder is made.
    bands
        Values and unit by name; values of shape (rows, columns), row 0 in the south. A pixel's
        middle is a node.
    extent
        xmin, xmax, ymin, ymax of the nodes, metres from the origin.
    origin
        Easting and northing.
    crs
        Of the plane; None: the file has none.

    Returns
    -------
    str
        A sentence on the file, or why there is none.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    try:
        import rasterio
        from rasterio.transform import Affine
    except ImportError:
        return "no map.tif: it takes rasterio (pip install 'infoplan[survey]')"
    grids = [grid for grid, _ in bands.values()]
    rows, columns = grids[0].shape
    xmin, xmax, ymin, ymax = extent
    width, height = (xmax - xmin) / (columns - 1), (ymax - ymin) / (rows - 1)
    corner = origin[0] + xmin - width / 2, origin[1] + ymax + height / 2
    unfinished = path.with_name(f".{path.name}")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with rasterio.open(
            unfinished, "w", driver="GTiff", height=rows, width=columns, count=len(bands),
            dtype="float32", nodata=np.nan, crs=crs, compress="deflate",
            transform=Affine.translation(*corner) @ Affine.scale(width, -height),
        ) as file:  # fmt: skip
            for number, (name, (grid, unit)) in enumerate(bands.items(), 1):
                file.write(np.flipud(grid).astype(np.float32), number)
                file.set_band_description(number, name)
                file.set_band_unit(number, unit)
        unfinished.replace(path)
    where = f"in {crs}" if crs else "in metres, without a place in the world (crs= gives one)"
    return f"{path.name}: {', '.join(bands)}, {where}"
