"""Logs that are texts, a sample a line: CSV, TSV and their likes."""

import csv
import io
from collections.abc import Iterator

import pandas as pd

from infoplan.encodings import encoding_of
from infoplan.errors import UsageError
from infoplan.survey.raw import RawLog, Refusal, check_names
from infoplan.wording import counted

DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars"}
COMMENT = "#"

HELP = "give a line of column names, then a line a sample"


class _Lines:
    """The lines of a text that hold something, one after the other, and where they stand."""

    def __init__(self, content: bytes, encoding: str):
        self.stream = enumerate(io.TextIOWrapper(io.BytesIO(content), encoding=encoding), 1)
        self.first: int | None = None

    def __iter__(self) -> Iterator[str]:
        for number, line in self.stream:
            if self.first is None:  # within quotes a line may be blank or begin with anything
                if line.isspace() or line.lstrip().startswith(COMMENT):
                    continue
                self.first = number
            yield line


def read_delimited(content: bytes, what: str) -> RawLog:
    """Read a text with a header; tab, semicolon, comma or bar stand between the columns.

    Blank lines and such as begin with ``#`` are passed over; fields may be in double quotes. A line
    with another number of fields is refused alone: what it lacks is empty, what it has too much
    stays in its last field.

    Parameters
    ----------
    content
        The text: UTF-8, UTF-16 with its mark, or Latin-1.
    what
        What it is called in a message.

    Raises
    ------
    UsageError
        If it is no text, has no header, or a quote is never closed.
    """
    encoding = encoding_of(content, what, HELP)
    lines = _Lines(content, encoding)
    header = next(iter(lines), None)
    if header is None:
        raise UsageError(f"{what} is empty: {HELP}")
    number = lines.first
    delimiter = next((mark for mark in DELIMITERS if mark in header), None)
    if delimiter is None:
        raise UsageError(
            f"{what}, line {number}: there is one column, and nothing of tab, semicolon, comma or "
            f"bar that parts columns: {HELP}"
        )
    lines = _Lines(content, encoding)  # from the start: a name in quotes may be longer than a line
    (_, names), *rest = _rows(lines, delimiter, what)
    names = [name.strip() for name in names]
    while names and not names[-1] and len(names) > 1:  # a delimiter ends each line
        names.pop()
    if not any(character.isalpha() for name in names for character in name):
        raise UsageError(f"{what}, line {number} holds numbers and no column names: {HELP}")
    check_names(names, what, f"line {number}")
    refused: dict[int, Refusal] = {}
    cells: list[list[str]] = []
    for row, (_, fields) in enumerate(rest):
        while len(fields) > len(names) and not fields[-1].strip():
            fields = fields[:-1]
        if len(fields) != len(names):
            refused[row] = Refusal(_misfit(fields, len(names), delimiter))
            last = len(names) - 1
            fields = [*fields[:last], delimiter.join(fields[last:])]
            fields += [""] * (len(names) - len(fields))
        cells.append(fields)
    table = pd.DataFrame(cells, columns=names, dtype=object)
    return RawLog(table, [line for line, _ in rest], "line", refused=refused)


def _misfit(fields: list[str], wanted: int, delimiter: str) -> str:
    """Say why a line has not as many fields as the header."""
    other = next((mark for mark in DELIMITERS if len(fields) == 1 and mark in fields[0]), None)
    if other:
        return f"{DELIMITERS[other]} part its columns, {DELIMITERS[delimiter]} those of the header"
    return f"{counted(len(fields), 'field')} where the header has {wanted}"


def _rows(lines: _Lines, delimiter: str, what: str) -> Iterator[tuple[int, list[str]]]:
    """Go through the rows with the numbers of their first lines."""
    reader = csv.reader(iter(lines), delimiter=delimiter, strict=True, skipinitialspace=True)
    while True:
        lines.first = None
        try:
            fields = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise UsageError(
                f"{what}, line {lines.first}: a double quote is not closed, or something follows "
                f"it ({error}): close it, or write it twice where it is meant"
            ) from error
        assert lines.first is not None
        yield lines.first, fields
