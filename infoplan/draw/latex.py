"""Tables for papers: what is printed on this console is LaTeX, with booktabs' rules."""

import re
from collections.abc import Sequence
from typing import Any

from rich.text import Text

from infoplan.draw.console import UNLIMITED, PlainConsole

SIGNS = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "–": r"\textendash{}",
    "±": r"$\pm$",
    "×": r"$\times$",
    "²": r"$^2$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "°": r"$^\circ$",
}
"""What LaTeX, or a font of its, takes for something else."""

MINUS = re.compile(r"(?<![\w.)\]-])-(?=[\d.]|inf)")
"""The sign of a number, unlike the dash of a name."""

LONG = 40
"""Columns of longer texts are broken into lines."""

PAGE = 45
"""Tables of more rows are no floats: a page does not hold them."""


class LatexConsole(PlainConsole):
    """A console for which tables are LaTeX, and all else is a comment."""

    def __init__(self) -> None:
        super().__init__(highlight=False, no_color=True, width=UNLIMITED)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print sentences as comments."""
        lines = ("\n% ".join(str(item).split("\n")) for item in objects)
        comments = [Text(f"% {line}") if line else line for line in lines]
        super().print(*comments, **{**options, "soft_wrap": True})

    def write_table(
        self,
        title: str,
        titles: Sequence[str],
        right: Sequence[bool],
        rows: Sequence[Sequence[Text] | None],
    ) -> None:
        """Write a table with a caption.

        Parameters
        ----------
        title
            Its caption; without one it is a `tabular` alone.
        titles
            Headings of the columns.
        right
            Whether a column is set to the right.
        rows
            Cells, one a column; None stands for a space between two groups of rows.
        """
        if title and len(rows) > PAGE:
            text = longtable(title, titles, right, rows)
        elif title:
            text = (
                f"\\begin{{table}}\n\\centering\n\\caption{{{escaped(title)}}}\n"
                f"{tabular(titles, right, rows)}\n\\end{{table}}"
            )
        else:
            text = tabular(titles, right, rows)
        super().print(Text(text), soft_wrap=True)


def tabular(
    titles: Sequence[str], right: Sequence[bool], rows: Sequence[Sequence[Text] | None]
) -> str:
    """Write a `tabular` environment; parameters as of `LatexConsole.write_table`."""
    return "\n".join([
        f"\\begin{{tabular}}{{{_columns(right, rows)}}}",
        *_heading(titles), *_body(rows), "\\end{tabular}",
    ])  # fmt: skip


def longtable(
    title: str,
    titles: Sequence[str],
    right: Sequence[bool],
    rows: Sequence[Sequence[Text] | None],
) -> str:
    """Write a `longtable` environment, which breaks between pages and repeats its heading.

    Parameters are as of `LatexConsole.write_table`.
    """
    return "\n".join([
        f"\\begin{{longtable}}{{{_columns(right, rows)}}}",
        f"\\caption{{{escaped(title)}}} \\\\", *_heading(titles), "\\endfirsthead",
        *_heading(titles), "\\endhead", *_body(rows), "\\end{longtable}",
    ])  # fmt: skip


def _columns(right: Sequence[bool], rows: Sequence[Sequence[Text] | None]) -> str:
    full = [row for row in rows if row is not None]
    return "".join(
        "r" if to_right
        else r"p{0.35\linewidth}" if any(len(row[i].plain) > LONG for row in full)
        else "l"
        for i, to_right in enumerate(right)
    )  # fmt: skip


def _heading(titles: Sequence[str]) -> list[str]:
    return ["\\toprule", _line([escaped(name) for name in titles]), "\\midrule"]


def _body(rows: Sequence[Sequence[Text] | None]) -> list[str]:
    lines = []
    for number, row in enumerate(rows):
        if row is not None:
            lines.append(_line([_cell(cell) for cell in row]))
        elif number < len(rows) - 1:
            lines.append("\\addlinespace")
    return [*lines, "\\bottomrule"]


def escaped(text: str) -> str:
    """Write text of any origin so that LaTeX sets it as it is; a number's sign is a minus."""
    parts = MINUS.split(" ".join(text.split()))
    joined = "$-$".join("".join(SIGNS.get(sign, sign) for sign in part) for part in parts)
    return joined.replace("--", "-{}-")  # two dashes would become one


def _cell(cell: Text) -> str:
    text = escaped(cell.plain)
    style = str(cell.style)
    if text and "bold" in style:
        return rf"\textbf{{{text}}}"
    return rf"\textit{{{text}}}" if text and "italic" in style else text


def _line(cells: Sequence[str]) -> str:
    r"""Write a row; what \\ would take for an argument of its own is in braces."""
    first, *others = cells
    first = re.sub(r"^[\[*]", r"{\g<0>}", first)
    return " & ".join([first, *others]) + r" \\"
