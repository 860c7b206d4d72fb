"""Grids of numbers in a text, a row a line."""

import io
import math
import re
import warnings
from collections.abc import Iterator
from itertools import islice

import numpy as np

from infoplan.encodings import encoding_of
from infoplan.errors import UsageError
from infoplan.terrain import grids, points
from infoplan.terrain.grids import Floats
from infoplan.wording import harmless

MAX_TEXT = 2**28
"""Largest text that is read, bytes."""

DELIMITERS = ("\t", ";", ",")
COMMENT = "#"

NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
MISSING = re.compile(r"[+-]?nan", re.IGNORECASE)

HELP = "give a line a row, all with the same number of numbers (a missing one is nan)"

NumberedLine = tuple[int, str]
"""A line of a text and its number, from 1."""


def read_text(content: bytes, what: str) -> Floats:
    """Read a grid of numbers, a row a line; tab, semicolon, comma or blanks stand between them.

    Blank lines and such as begin with ``#`` are passed over.

    Parameters
    ----------
    content
        The text: UTF-8, UTF-16 with its mark, or Latin-1.
    what
        What it is called in a message.

    Returns
    -------
    ndarray, shape (rows, columns)
        NaN where the text says so.

    Raises
    ------
    UsageError
        If it is too long, or holds anything but lines with the same number of numbers.
    """
    if len(content) > MAX_TEXT:
        raise UsageError(
            f"{what} is a text of more than {MAX_TEXT} bytes: save the map as .npy, which is "
            "shorter"
        )
    encoding = encoding_of(content, what, HELP)
    first = next(_rows(content, encoding), None)
    if first is None:
        raise UsageError(f"{what} is empty: {HELP}")
    delimiter = next((mark for mark in DELIMITERS if mark in first[1]), None)
    columns = _columns(first[1], delimiter, what)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            elevation = np.loadtxt(
                (line for _, line in _rows(content, encoding)),
                delimiter=delimiter,
                comments=None,
                quotechar='"',
                ndmin=2,
                max_rows=grids.MAX_NODES // columns + 1,
            )
    except (ValueError, OverflowError) as error:
        raise UsageError(_fault(_rows(content, encoding), delimiter, what)) from error
    if np.isinf(elevation).any():
        raise UsageError(_fault(_rows(content, encoding), delimiter, what))
    grids.check_shape(elevation.shape, what)
    return elevation


def refusal(cell: str) -> str | None:
    """Say why a cell is neither an elevation nor marked as missing; None if it is."""
    if not cell:
        return "there is no number (a missing one is nan)"
    if MISSING.fullmatch(cell) or (NUMBER.fullmatch(cell) and math.isfinite(float(cell))):
        return None
    shown = harmless(cell if len(cell) <= 30 else f"{cell[:30]}...")
    if NUMBER.fullmatch(cell):
        return f"{shown} is too large a number"
    return f"{shown!r} is not a number"


def _rows(content: bytes, encoding: str) -> Iterator[NumberedLine]:
    """Go through the lines that hold something, numbered as in an editor."""
    stream = io.TextIOWrapper(io.BytesIO(content), encoding=encoding)
    for number, line in enumerate(stream, 1):
        if not line.isspace() and not line.lstrip().startswith(COMMENT):
            yield number, line


def _columns(line: str, delimiter: str | None, what: str) -> int:
    """Count the fields of a line, by no list of them: it may be as long as the whole file."""
    most = grids.MAX_NODES // 2
    columns = sum(1 for _ in islice(_cells(line, delimiter), most + 1))
    if columns > most:
        raise UsageError(
            f"the map in {what} has more than {most} columns, so that two rows are more than the "
            f"{grids.MAX_NODES} nodes that are read: cut or coarsen it first"
        )
    return columns


def _cells(line: str, delimiter: str | None) -> Iterator[tuple[int, str]]:
    """Go through the cells of a line: the column of a cell's first character, from 1, and it."""
    line = line.rstrip("\r\n")
    if delimiter is None:
        for found in re.finditer(r"\S+", line):
            yield found.start() + 1, found.group()
        return
    start = 0
    while start >= 0:
        end = line.find(delimiter, start)
        cell = line[start : end if end >= 0 else len(line)]
        yield start + 1 + len(cell) - len(cell.lstrip()), cell.strip()
        start = end + 1 if end >= 0 else -1


def _fault(rows: Iterator[NumberedLine], delimiter: str | None, what: str) -> str:
    """Say what the first fault of a text is, and where."""
    columns = first = 0
    for number, line in rows:
        found = 0
        for column, cell in _cells(line, delimiter):
            found += 1
            if len(cell) > 1 and cell[0] == cell[-1] == '"':
                cell = cell[1:-1].strip()
            if reason := refusal(cell):
                if not first and points.is_heading(line):
                    reason += f", and the line looks like a heading of points; {points.ADVICE}"
                elif not first:
                    reason += ", and a line of names has to go"
                return (
                    f"{what} is not a grid of numbers, line {number}, column {column}: {reason}: "
                    f"{HELP}"
                )
        if not first:
            columns, first = found, number
        elif found != columns:
            return (
                f"{what} is not a grid of numbers, line {number} has another number of numbers, "
                f"{found}, than line {first}, {columns}: {HELP}"
            )
    return f"{what} is not a grid of numbers: {HELP}"
