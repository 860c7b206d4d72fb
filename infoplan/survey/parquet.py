"""Logs in Parquet."""

import pyarrow as pa
import pyarrow.parquet as pq

from infoplan.errors import UsageError
from infoplan.survey.raw import RawLog, check_names


def read_parquet(content: bytes, what: str) -> RawLog:
    """Read all columns of a Parquet file; a field's metadata ``unit`` or ``units`` is its unit.

    Raises
    ------
    UsageError
        If it is no whole Parquet file.
    """
    try:
        table = pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UsageError(f"{what} is no whole Parquet file: copy it once more") from error
    check_names(table.column_names, what, "the schema")
    units = {}
    for field in table.schema:
        told = field.metadata or {}
        if unit := told.get(b"unit", told.get(b"units")):
            units[field.name] = unit.decode(errors="replace")
    return RawLog(table.to_pandas(), [*range(1, len(table) + 1)], "row", units)
