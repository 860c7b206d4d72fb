"""Types of values on the command line: how each is read, told and completed."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from infoplan.errors import UsageError
from infoplan.files import user_path

OPEN = "open"
"""Type of a completion after which the word goes on: no space follows."""


class UserPath(click.ParamType):
    """A path as the user typed it, its ``~`` their home.

    Parameters
    ----------
    folder
        Whether it is one of a folder: completion offers no files then.
    """

    name = "path"

    def __init__(self, folder: bool = False):
        self.folder, self.words = folder, "a folder" if folder else "a path"

    def convert(self, value: Any, param: Any, ctx: Any) -> Path | None:
        """Read it."""
        from infoplan.text_options import typed_text

        text = typed_text(param.word, str(value))
        path = None if text is None else user_path(text)
        if path and self.folder and path.exists() and not path.is_dir():
            raise UsageError(f"{param.word}={value} is a file: name a folder")
        return path

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer what is there."""
        return path_items(incomplete, folders_alone=self.folder)


class Text(click.ParamType):
    """Text as the user typed it."""

    name, words = "text", "text"

    def convert(self, value: Any, param: Any, ctx: Any) -> str | None:
        """Read it."""
        from infoplan.text_options import typed_text

        return typed_text(param.word, str(value))


class Number(click.FloatRange):
    """A finite number within bounds."""

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Read it."""
        number = float(super().convert(value, param, ctx))
        if number != number or number in (float("inf"), float("-inf")):
            self.fail(f"{value} is not finite", param, ctx)
        return number


def allowed(kind: click.ParamType) -> str:
    """Say what values a type takes."""
    if words := getattr(kind, "words", ""):
        return str(words)
    if isinstance(kind, click.Choice):
        return either([str(choice) for choice in kind.choices])
    if isinstance(kind, click.types.BoolParamType):
        return "true or false"
    words = {"integer": "a whole number", "integer range": "a whole number",
             "float range": "a number"}.get(kind.name, "text")  # fmt: skip
    if isinstance(kind, click.IntRange | click.FloatRange):
        low = "above" if kind.min_open else "at least"
        high = "below" if kind.max_open else "at most"
        bounds = [f"{low} {kind.min:g}"] if kind.min is not None else []
        bounds += [f"{high} {kind.max:g}"] if kind.max is not None else []
        return ", ".join([words, " and ".join(bounds)] if bounds else [words])
    return words


def either(names: Sequence[str]) -> str:
    """Join names: ``a, b or c``."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def written(value: Any) -> str:
    """Write a default as on the command line; empty for none."""
    if value is None or value == ():
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{','.join('null' if v is None else written(v) for v in value)}]"
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def path_items(incomplete: str, *, folders_alone: bool = False) -> list[CompletionItem]:
    """Complete a path; what is hidden only if it was begun."""
    head, begun = os.path.split(incomplete)
    try:
        entries = sorted(os.scandir(user_path(head or ".")), key=lambda entry: entry.name)
    except (OSError, ValueError):
        return []
    items = []
    for entry in entries:
        if not entry.name.startswith(begun) or (entry.name[0] == "." and not begun):
            continue
        try:
            folder = entry.is_dir()
        except OSError:
            folder = False
        if folder or not folders_alone:
            text = os.path.join(head, entry.name) + "/" * folder
            items.append(CompletionItem(text, type=OPEN if folder else "plain"))
    return items
