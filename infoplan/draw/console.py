"""A console for text of any origin, and sentences on it."""

import os
import re
import shutil
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from infoplan.wording import encodable, harmless

UNLIMITED = 100_000
"""Width of a console that is no terminal: whole lines."""

INDENT = "  "
"""Of the fields of a stacked row."""

WORD = re.compile(r" *(?:[^ ]*\d (?=(?:s|min|h|m|ft|kB|MB|GB)\b|%))?[^ ]+")
"""What no line is broken in: a word, or a number with its unit."""


class PlainConsole(Console):
    """A console that prints text of any origin as it is: no markup, no control characters."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as `rich.console.Console.print` does."""
        super().print(*(self._plain(item) for item in objects), **options)

    def _plain(self, item: Any) -> Any:
        if isinstance(item, str | Text):
            return plain_text(item, self)
        return item


def wide_console() -> Console:
    """Return the console of a command, which prints text as it is.

    Its width is the terminal's, or what the environment variable COLUMNS says; in a pipe it is
    unlimited.
    """
    terminal = Console().is_terminal
    width = shutil.get_terminal_size((80 if terminal else UNLIMITED, 24)).columns
    # A width of its own keeps a display from following the terminal's.
    follows = terminal and not Console().is_dumb_terminal and "COLUMNS" not in os.environ
    return PlainConsole(highlight=False, width=None if follows else width)


def say(console: Console, text: object, style: str = "", indent: str = "") -> None:
    """Print a sentence, broken between words alone: a path that is too long stays whole.

    Parameters
    ----------
    console
        Where to.
    text
        Of any origin: it is printed as it is, control characters made visible.
    style
        Rich's.
    indent
        Before all lines but the first.
    """
    for line in wrapped(plain(text, console), console.width, indent):
        console.print(Text(line, style=style), soft_wrap=True)


def say_command(console: Console, before: str, command: str) -> None:
    """Print a sentence that ends in a command line, which can be pasted however it is broken.

    Parameters
    ----------
    console
        Where to.
    before
        The sentence up to the command.
    command
        Words as a shell reads them. Where the whole does not fit, it stands on lines of its own
        that end in a backslash.
    """
    whole = f"{before} {command}"
    if cell_len(plain(whole, console)) <= console.width:
        say(console, whole)
        return
    say(console, before)
    words = re.findall(r"""(?:'[^']*'|"[^"]*"|[^\s'"])+""", plain(command, console))
    line = INDENT + words[0]
    for word in words[1:]:
        if cell_len(f"{line} {word} \\") > console.width:
            console.print(Text(f"{line} \\"), soft_wrap=True)
            line = 2 * INDENT + word
        else:
            line += f" {word}"
    console.print(Text(line), soft_wrap=True)


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Break a text between words; one longer than the width, and a number and its unit, stay whole.

    Parameters
    ----------
    text
        A single line.
    width
        Of a line, in characters.
    indent
        Before all lines but the first.
    """
    lines, line = [], ""
    for word in WORD.findall(text):
        if line.strip() and cell_len(line + word) > width:
            lines.append(line)
            line, word = indent, word.lstrip()
        line += word
    return [*lines, line]


def plain(text: object, console: Console) -> str:
    """Make a line of any origin safe to print."""
    return encodable(harmless(text), console.encoding)


def plain_text(cell: str | Text, console: Console) -> Text:
    """Make a cell of any origin safe to print, line by line."""
    text, style = (cell.plain, cell.style) if isinstance(cell, Text) else (cell, "")
    return Text("\n".join(plain(line, console) for line in text.split("\n")), style)
