"""Small tables for notebooks, which show an object by its ``_repr_html_``.

They set no colours and no sizes: a notebook's own theme, light or dark, gives them.
"""

import html
from collections.abc import Iterable, Mapping, Sequence

from infoplan.wording import harmless


def html_table(
    caption: object,
    rows: Iterable[Sequence[object]],
    head: Sequence[object] = (),
    below: Iterable[object] = (),
) -> str:
    """Write a table as HTML, text of any origin shown as it is.

    Parameters
    ----------
    caption
        A sentence above it.
    rows
        Its cells.
    head
        What the columns are called; none: no such row.
    below
        Sentences below it.
    """
    lines = [_row(head, "th")] if head else []
    lines += [_row(row, "td") for row in rows]
    told = "".join(f"<p>{_text(sentence)}</p>" for sentence in below)
    return f"<p>{_text(caption)}</p><table>{''.join(lines)}</table>{told}"


def html_facts(caption: object, facts: Mapping[str, object]) -> str:
    """Write named facts as a table of two columns; otherwise as `html_table`."""
    lines = (f"<tr><th>{_text(name)}</th><td>{_text(fact)}</td></tr>" for name, fact in
             facts.items())  # fmt: skip
    return f"<p>{_text(caption)}</p><table>{''.join(lines)}</table>"


def _row(cells: Sequence[object], tag: str) -> str:
    return f"<tr>{''.join(f'<{tag}>{_text(cell)}</{tag}>' for cell in cells)}</tr>"


def _text(text: object) -> str:
    return html.escape(harmless(text))
