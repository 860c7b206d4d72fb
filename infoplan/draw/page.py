"""What the HTML pages share: text that cannot become markup, data that cannot end its element."""

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

from infoplan.draw.page_theme import custom_properties
from infoplan.files import writing
from infoplan.method_identity import Look
from infoplan.wording import harmless

HERE = Path(__file__).parent


def fill_page(
    name: str,
    data: Any,
    parts: dict[str, str],
    *,
    brand: str,
    first: str,
    first_words: str,
    charts: bool = False,
) -> str:
    """Put a page together that needs nothing besides itself.

    Parameters
    ----------
    name
        Of its template, style sheet and script beside this module; they follow those of all pages.
    data
        What the script reads: anything that JSON knows, without NaN.
    parts
        HTML for the template's places, and ``title`` and ``subtitle``, every text in it escaped.
    brand
        What kind of page of infoplan's it is.
    first, first_words
        Identifier of the section that a keyboard can skip to, and what that is called.
    charts
        Whether it has charts of lines, or verdicts.
    """
    sheets = ("page", *(["charts"] if charts else []), name)
    body = Template((HERE / f"{name}.html").read_text(encoding="utf-8")).substitute(parts)
    return Template((HERE / "page.html").read_text(encoding="utf-8")).substitute(
        title=parts["title"],
        subtitle=parts["subtitle"],
        brand=brand,
        first=first,
        first_words=first_words,
        body=body,
        data=embedded(data),
        style=style_sheet(*sheets),
        script="\n".join((HERE / f"{one}.js").read_text(encoding="utf-8") for one in sheets),
        version=as_html(version("infoplan")),
    )


def style_sheet(*names: str) -> str:
    """Write the properties that all pages share, and after them style sheets beside this module."""
    sheets = ((HERE / f"{name}.css").read_text(encoding="utf-8") for name in names)
    return "\n".join([custom_properties(), *sheets])


def dash_array(look: Look) -> str:
    """Write a line style as SVG does, for a line of two pixels."""
    return " ".join(f"{2 * length:g}" for length in look.dashes)


def method_key(look: Look) -> str:
    """Draw a short piece of a method's line."""
    return (
        f'<svg class="key" viewBox="0 0 30 12" aria-hidden="true" style="--colour:{look.colour}">'
        f'<path class="line" d="M1 6H29" stroke-dasharray="{dash_array(look)}"/></svg>'
    )


def write_page(path: Path, page: str) -> None:
    """Write a page, whole or not at all.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    unfinished = path.with_name(f".{path.name}")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(page, encoding="utf-8")
        unfinished.replace(path)


def as_html(text: object) -> str:
    """Write any text so that a page shows it, and it is nothing but text."""
    return escape(harmless(text))


def embedded(data: Any) -> str:
    """Write data as JSON that cannot end the element it stands in."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def html_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    caption: str = "",
    sortable: bool = False,
) -> str:
    """Lay texts out as a table, numbers from the second column on; too wide, it scrolls."""
    first, *others = headings
    head = f'<th scope="col">{as_html(first)}</th>' + "".join(
        f'<th scope="col" class="number">{as_html(text)}</th>' for text in others
    )
    body = "".join(
        f'<tr><th scope="row">{as_html(name)}</th>'
        + "".join(f'<td class="number">{as_html(text)}</td>' for text in numbers)
        + "</tr>"
        for name, *numbers in rows
    )
    title = f"<caption>{as_html(caption)}</caption>" if caption else ""
    kind = ' class="sortable"' if sortable else ""
    return (
        f'<div class="scroll" role="region" aria-label="{as_html(caption or first)}" tabindex="0">'
        f"<table{kind}>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def sentence(text: str) -> str:
    """Begin with a capital and end with a full stop."""
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":")) else ".")
