"""Tables for a console of any width: as they are, without what can be spared, or stacked.

Numbers and names are never cut. Where a table does not fit, its cells are broken between words,
then columns that can be spared are left out and named below it, and at last every row becomes a
block of lines.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from infoplan.draw.console import INDENT, UNLIMITED, plain, plain_text, say, wrapped
from infoplan.draw.latex import LatexConsole
from infoplan.wording import encodable

Cell = str | Text
"""Lines of a cell; only line ends part them, all other control characters are made visible."""

ASCII_BOX = box.Box("    \n    \n -- \n    \n    \n -- \n    \n    \n", ascii=True)
"""As `box.SIMPLE`, for encodings without its line."""

WHOLE = UNLIMITED
"""As `TextColumn.least`: the lines of a column are never broken."""

GAP = 2
"""Spaces between columns."""


@dataclass(frozen=True)
class TextColumn:
    """A column of a table.

    Attributes
    ----------
    title
        Its heading.
    right
        Whether it is set to the right, as numbers are.
    least
        Fewest characters that it may be squeezed to, if its words allow.
    spare
        0: never left out of a table; of the others the greatest goes first.
    drawn
        Whether its cells are drawings: their lines are never broken.
    style
        Of its cells.
    empty
        What an empty cell says where rows are stacked; such a field is left out if this is empty.
    """

    title: str
    right: bool = False
    least: int = 0
    spare: int = 0
    drawn: bool = False
    style: str = ""
    empty: str = ""


def print_table(
    console: Console,
    title: str,
    columns: Sequence[TextColumn],
    rows: Sequence[Sequence[Cell] | None],
    *,
    named: int = 1,
) -> None:
    """Print a table as the console's width allows; on a `LatexConsole` as LaTeX, with all columns.

    Parameters
    ----------
    console
        Where to.
    title
        Above it.
    columns
        Left to right.
    rows
        Cells of each row, one a column; None stands for a space between two groups of rows.
    named
        How many of the first columns name a row; they head its block where rows are stacked.
    """
    columns = [replace(column, title=plain(column.title, console)) for column in columns]
    cells = [None if row is None else [plain_text(cell, console) for cell in row] for row in rows]
    if isinstance(console, LatexConsole):
        titles, right = [c.title for c in columns], [c.right for c in columns]
        console.write_table(title, titles, right, cells)
        return
    if title:
        say(console, title, style="italic")
    full = [row for row in cells if row is not None]
    for kept in _choices(columns):
        chosen = [columns[index] for index in kept]
        widths = _widths(chosen, [[row[index] for index in kept] for row in full], console.width)
        if widths is not None:
            shown = [row and [row[index] for index in kept] for row in cells]
            console.print(_table(chosen, widths, shown, _takes_lines(console)), crop=False)
            left_out = [column.title for i, column in enumerate(columns) if i not in kept]
            if left_out:
                say(console, f"left out for want of room: {', '.join(left_out)}")
            return
    for row in full:
        console.print()
        for line in _block(columns, row, named, console.width):
            console.print(line, soft_wrap=True)
    console.print()


def _choices(columns: Sequence[TextColumn]) -> list[list[int]]:
    """List which columns may be kept, by index: all, and fewer and fewer."""
    kept = list(range(len(columns)))
    choices = [kept]
    for index in sorted(kept, key=lambda index: -columns[index].spare):
        if columns[index].spare:
            choices.append([other for other in choices[-1] if other != index])
    return choices


def _widths(
    columns: Sequence[TextColumn], rows: Sequence[Sequence[Text]], width: int
) -> list[int] | None:
    """Width of each column of a table; None if it is wider than the console."""
    natural, least = [], []
    for number, column in enumerate(columns):
        lines = [line for row in rows for line in row[number].plain.split("\n")]
        longest = max(map(cell_len, lines), default=0)
        words = lines if column.drawn else [word for line in lines for word in line.split()]
        head = max(map(cell_len, _title_words(column.title)), default=0)
        natural.append(max(longest, cell_len(column.title)))
        word = max(map(cell_len, words), default=0)
        least.append(max(word, head, min(column.least, longest)))
    left = width - sum(least) - GAP * len(columns)
    if left < 0:
        return None
    # The nearly satisfied first: so most columns get what they want.
    for number in sorted(range(len(columns)), key=lambda number: natural[number] - least[number]):
        more = min(natural[number] - least[number], left)
        least[number] += more
        left -= more
    return least


def _title_words(title: str) -> list[str]:
    """Parts that a heading may be broken into: words, and parts of dotted names."""
    return re.split(r" |(?<=\.)", title)


def _table(
    columns: Sequence[TextColumn],
    widths: Sequence[int],
    rows: Sequence[Sequence[Text] | None],
    lines: bool,
) -> Table:
    table = Table(box=box.SIMPLE if lines else ASCII_BOX, safe_box=False, pad_edge=False,
                  collapse_padding=True)  # fmt: skip
    for column, width in zip(columns, widths, strict=True):
        title = column.title
        if max(map(cell_len, title.split()), default=0) > width:
            title = title.replace(".", ".\n")
        table.add_column(Text(title), width=width, justify="right" if column.right else "left",
                         style=column.style, no_wrap=column.drawn, overflow="fold")  # fmt: skip
    for row in rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*row)
    return table


def _block(
    columns: Sequence[TextColumn], row: Sequence[Text], named: int, width: int
) -> list[Text]:
    """Lines of a row that is stacked: what names it, and a line a field."""
    name = " ".join(cell.plain for cell in row[:named] if cell.plain)
    style = next((cell.style for cell in row[:named] if cell.style), "bold")
    lines = [Text(part, style) for line in name.split("\n") for part in wrapped(line, width)]
    fields = [
        (column, cell if cell.plain else Text(column.empty))
        for column, cell in list(zip(columns, row, strict=True))[named:]
        if cell.plain or column.empty
    ]
    margin = max((cell_len(column.title) for column, _ in fields), default=0) + len(INDENT) + GAP
    for column, cell in fields:
        title, style = f"{INDENT}{column.title}", cell.style or column.style
        values = _stacked(column, cell, width - margin)
        if margin + max(map(cell_len, values)) <= width:
            padded = title + " " * (margin - cell_len(title))
            values = [
                f"{' ' * margin if line else padded}{value}" for line, value in enumerate(values)
            ]
        else:  # a word is too long to stand beside the title
            values = [
                title,
                *(2 * INDENT + v for v in _stacked(column, cell, width - 2 * len(INDENT))),
            ]
        lines += [Text(value, style) for value in values]
    return lines


def _stacked(column: TextColumn, cell: Text, width: int) -> list[str]:
    lines = cell.plain.split("\n")
    return lines if column.drawn else wrapped(" ".join(lines), width)


def _takes_lines(console: Console) -> bool:
    return encodable("─", console.encoding) == "─"
