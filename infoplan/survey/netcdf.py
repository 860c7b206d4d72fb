"""Logs in NetCDF: trajectories as of CF's discrete sampling geometries."""

import io
from typing import Any

import pandas as pd

from infoplan.errors import UsageError
from infoplan.survey.raw import RawLog

HELP = "give latitude and longitude (or projection_x_coordinate and ..._y_...) along one dimension"

HDF = b"\x89HDF"
"""How a NetCDF 4 file begins."""

STANDARD_NAMES = {
    "latitude": "lat",
    "longitude": "lon",
    "projection_x_coordinate": "x",
    "projection_y_coordinate": "y",
    "time": "time",
}
"""What a variable is by CF's standard name, whatever it is called."""


def read_netcdf(content: bytes, what: str) -> RawLog:
    """Read the trajectories of a NetCDF file, one after the other.

    Of variables with the dimensions of the positions each is a column. Where trajectories are the
    rows of an array, what fills them up is left out. A variable with one of the standard names
    `STANDARD_NAMES` is renamed to what it is, unless its name is taken.

    Parameters
    ----------
    content
        The file: NetCDF 3 or 4.
    what
        What it is called in a message.

    Raises
    ------
    UsageError
        If xarray is not installed, the file cannot be read, or it has no such positions.
    """
    try:
        import xarray

        if content.startswith(HDF):
            import h5netcdf  # noqa: F401 - xarray reads NetCDF 4 by it
    except ImportError as error:
        raise UsageError(
            f"{what} is read by xarray and h5netcdf, which are not installed: "
            "pip install 'infoplan[survey]', or give CSV"
        ) from error
    try:
        with xarray.open_dataset(io.BytesIO(content)) as dataset:
            dataset.load()
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(f"{what} is no whole NetCDF file: copy it once more") from error
    meant = {name: _meaning(dataset[name]) for name in dataset.variables}
    along = next((dataset[name].dims for name, role in meant.items() if role in ("lat", "x")), ())
    if not along or len(along) > 2:
        raise UsageError(f"{what} has no positions: {HELP}")
    columns, units = {}, {}
    for name in dataset.variables:
        variable = dataset[name]
        if variable.dims != along or variable.values.dtype.kind not in "fiubMmOSU":
            continue
        taken = name != meant[name] and meant[name] in dataset.variables
        column = str(name if taken else meant[name])
        columns[column] = variable.values.ravel()
        if unit := variable.attrs.get("units"):
            units[column] = str(unit)
    table = pd.DataFrame(columns)
    rows = [*range(1, len(table) + 1)]
    if len(along) == 2:
        positions = [column for column in table if column in ("lat", "lon", "x", "y")]
        filled = table[positions].notna().all(axis=1)
        rows = [row for row, there in zip(rows, filled, strict=True) if there]
        table = table[filled].reset_index(drop=True)
    return RawLog(table, rows, "sample", units)


def _meaning(variable: Any) -> str:
    """Name a variable by its CF standard name, else as it is called."""
    return STANDARD_NAMES.get(str(variable.attrs.get("standard_name")), str(variable.name))
