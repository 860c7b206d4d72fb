"""A log as its file holds it, before anything is made of it."""

from dataclasses import dataclass, field

import pandas as pd

from infoplan.errors import UsageError
from infoplan.wording import harmless

FEWEST = 10
"""Samples without which there is nothing to map."""


@dataclass(frozen=True)
class Refusal:
    """Why a row is no sample.

    Attributes
    ----------
    reason
        A few words, ``'abc' is no number``.
    column
        Whose cell it is; empty: the whole row.
    """

    reason: str
    column: str = ""

    def __str__(self) -> str:
        return f"{harmless(self.column)} {self.reason}" if self.column else self.reason


@dataclass(frozen=True)
class RawLog:
    """The columns of a log as they were.

    Attributes
    ----------
    columns
        One row a sample; text where the file is one.
    lines
        Where each row stands in the file, counted from 1.
    place
        What is counted: ``line``, ``point`` or ``row``.
    units
        Of the columns whose unit the file tells apart from their names.
    refused
        Rows that the file's own form has spoilt, and why.
    """

    columns: pd.DataFrame
    lines: list[int]
    place: str
    units: dict[str, str] = field(default_factory=dict)
    refused: dict[int, Refusal] = field(default_factory=dict)

    def where(self, row: int, column: str = "") -> str:
        """Say where a row, or a cell of it, is to be found."""
        line = f"{self.place} {self.lines[row]}"
        if not column:
            return line
        return f"{line}, column {list(self.columns).index(column) + 1} ({harmless(column)})"


def check_names(names: list[str], what: str, where: str) -> None:
    """Refuse columns without a name or with one name for two."""
    for number, name in enumerate(names, 1):
        if not name:
            raise UsageError(f"{what}, {where}, column {number} has no name: give every column one")
        if name in names[: number - 1]:
            raise UsageError(
                f"{what}, {where}, column {number} is the second of the name {harmless(name)!r}: "
                "rename one"
            )
