"""Columns of a table between memory and file: laid out, converted to their types, digested."""

import hashlib
from collections.abc import Mapping
from typing import Any

import pyarrow as pa

from infoplan.study.records import MisfitError
from infoplan.tables import KINDS, MAX_DOCUMENT, TABLES, Column

READ_AS = {
    "text": lambda found: pa.types.is_string(found) or pa.types.is_large_string(found),
    "integer": pa.types.is_integer,
    "double": pa.types.is_float64,
    "boolean": pa.types.is_boolean,
}
"""What each kind of column is read from."""


def lay_out(name: str, values: Mapping[str, Any]) -> pa.Table:
    """Build a table out of its columns, in the order of its schema, what it has besides at the end.

    Parameters
    ----------
    name
        A key of `TABLES`.
    values
        Each column's values; a column that files may lack may be left out and is null.

    Raises
    ------
    KeyError
        If a column that every file has is left out.
    """
    columns = TABLES[name].columns
    given = {key: values[key] for key, column in columns.items()
             if key in values or not column.may_be_missing}  # fmt: skip
    given |= values
    arrays = {
        key: pa.array(column, columns[key].field.type if key in columns else None)
        for key, column in given.items()
    }
    fields = [
        columns[key].field if key in columns else pa.field(key, array.type)
        for key, array in arrays.items()
    ]
    return completed(pa.table(list(arrays.values()), schema=pa.schema(fields)), name)


def canonical(table: pa.Table, name: str, unknown: bool = False) -> pa.Table:
    """Check the columns of a file, and give each the type that it was written with.

    Parameters
    ----------
    table
        As read.
    name
        A key of `TABLES`.
    unknown
        Whether nobody knows the truth: columns that need it may be null.

    Raises
    ------
    MisfitError
        If one that every file has is missing, or one holds what it must not.
    """
    if "run" in table.column_names:
        raise MisfitError("it holds a column run, which is a partition and no column")
    known = TABLES[name].columns
    for key, column in known.items():
        count = table.column_names.count(key)
        if count > 1 or (count == 0 and not column.may_be_missing):
            raise MisfitError(f"it has {count or 'no'} column{'s' * (count > 1)} {key}")
    columns = {
        key: _converted(key, table.column(i), known.get(key), unknown)
        for i, key in enumerate(table.column_names)
    }
    if len(columns) < table.num_columns:
        raise MisfitError("it has two columns of one name")
    return pa.table(columns)


def completed(table: pa.Table, name: str) -> pa.Table:
    """Append the columns that a file lacks, null in every row."""
    for key, column in TABLES[name].columns.items():
        if key not in table.column_names:
            nulls = pa.nulls(len(table), column.field.type)
            table = table.append_column(column.field, nulls)
    return table


def values_digest(table: pa.Table) -> str:
    """SHA-256 of all names and values of a table, whatever way a file stores them.

    Null and NaN are the same in a column of doubles.
    """
    hashed = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns, strict=True):
        hashed.update(name.encode())
        if column.null_count and not pa.types.is_floating(column.type):
            hashed.update(column.is_valid().to_numpy().tobytes())
            column = column.fill_null({pa.string(): "", pa.bool_(): False}.get(column.type, 0))
        if pa.types.is_string(column.type):
            hashed.update("\0".join(map(str, column.to_pylist())).encode())
        else:
            hashed.update(column.to_numpy().tobytes())
    return hashed.hexdigest()


def _converted(
    name: str, column: pa.ChunkedArray, expected: Column | None, unknown: bool
) -> pa.ChunkedArray:
    """Give a column the type of its kind; one of a version to come that of its own kind."""
    found = column.type
    if pa.types.is_dictionary(found):
        if any(chunk.dictionary.nbytes > MAX_DOCUMENT for chunk in column.chunks):
            raise MisfitError(f"its column {name} holds texts of more than {MAX_DOCUMENT} bytes")
        found = found.value_type
    for kind, is_known in READ_AS.items():
        if (expected is None or expected.kind == kind) and is_known(found):
            demanded = expected is not None and not (
                expected.nullable or (unknown and expected.of_truth)
            )
            if column.null_count and demanded:
                raise MisfitError(f"its column {name} has {column.null_count} missing values")
            return column.cast(KINDS[kind])
    wanted = expected.kind if expected else "plain values"
    raise MisfitError(f"its column {name} holds {found}, not {wanted}")
