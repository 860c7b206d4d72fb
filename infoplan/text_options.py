"""Text on the command line: what is typed is what is meant, and how values are written for a shell.

Hydra's grammar would read ``2024_11_25`` as a number and refuse ``dem (1).npy``. Options that hold
text are therefore read here, in one way for every command.
"""

import math
import re
import shlex
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from infoplan.config import GROUPS, RENAMED, Config
from infoplan.errors import UsageError
from infoplan.options import plain_number, walk

_QUOTED = re.compile(r"'((?:[^'\\]|\\.)*)'|\"((?:[^\"\\]|\\.)*)\"", re.DOTALL)
"""A whole string in quotes, as Hydra writes and reads it."""

_PLAIN = re.compile(r"[\w./@%+~-]+(?: +[\w./@%+~-]+)*")
"""Text that needs no quotes in any place where Hydra reads text, once it is known to be text."""

_WORD = re.compile(r"(?!(?:true|false|null|inf|nan)$)[a-z_][\w-]*", re.IGNORECASE | re.ASCII)
"""Text that Hydra itself reads as text."""


FLOATS = {float, list[float], list[list[float]], list[list[list[float]]]}

OWN_OPTION = re.compile(r"\w+\.(options|params)(\.|$)")
"""How options of a user's own function, or of one of PyOD's classes, begin."""


def renamed(word: str) -> str:
    """Write an option, or what sets it, by its present name."""
    group, dot, rest = word.partition(".")
    return f"{RENAMED[group]}.{rest}" if dot and group in RENAMED else word


@cache
def text_options() -> dict[str, bool]:
    """Names of the options that hold text, and whether ``null`` stands for none."""
    return {
        name: bool(types - {str}) for name, types in _types().items() if types <= {str, str | None}
    }


def typed_text(name: str, value: str) -> str | None:
    r"""Read what was typed for an option that holds text: itself, whatever it contains.

    Parameters
    ----------
    name
        The option, as in ``terrain.path``; one that no run has is text, too.
    value
        What follows the equals sign.

    Returns
    -------
    str or None
        `value`; without its quotes if it is wholly one string in quotes, as Hydra writes it
        (``\'`` in it is an apostrophe, ``\${`` the beginning of no interpolation). None for
        ``null``, if the option can be None.

    Raises
    ------
    UsageError
        If it is empty, or no text can hold it.
    """
    if value == "null" and text_options().get(name, False):
        return None
    text = value
    if quoted := _QUOTED.fullmatch(value):
        text = _unescaped(quoted[1] if quoted[2] is None else quoted[2], value[0])
    if not text:
        raise UsageError(f"{name}={value} is empty: give a value, or leave {name}= out")
    if text == "???":
        raise UsageError(f"{name}=??? is Hydra's sign for a value that is missing: give another")
    if "\0" in text:
        raise UsageError(f"{name}={value} holds a NUL character: leave it out")
    return text


def typed_texts(name: str, value: str) -> list[str | None]:
    r"""Read what was typed for an option of which commas separate several values.

    Commas in quotes, in brackets and after a backslash (``\,``) do not separate. Spaces around
    the values of a list are no part of them.

    Raises
    ------
    UsageError
        If one of the values is empty.
    """
    parts = _split(value)
    if len(parts) == 1:
        return [typed_text(name, parts[0])]
    return [typed_text(name, part.strip(" \t")) for part in parts]


def for_hydra(text: str | None) -> str:
    """Write text as a value that Hydra reads as that text, and in which nothing is replaced."""
    if text is None:
        return "null"
    # OmegaConf would put the value of another option, or of a variable, in the place of ${...}.
    text = re.sub(r"(\\*)\$\{", r"\1\1\\${", text)
    text = re.sub(r"(\\+)('|\Z)", r"\1\1\2", text)
    return "'" + text.replace("'", "\\'") + "'"


def as_value(name: str, value: Any) -> str:
    """Write a value as that of the option of an override, for Hydra and for `typed_text`.

    Parameters
    ----------
    name
        The option.
    value
        None, a truth value, a number, text, a path; a list or mapping of them, or an array.

    Raises
    ------
    UsageError
        If no command line can say it.
    """
    is_text = name in text_options() or not (name in _types() or OWN_OPTION.match(name))
    if isinstance(value, PathLike):
        value = str(value)
    if is_text and value is not None:
        plain = _PLAIN.fullmatch(str(value)) and value != "null"
        return str(value) if plain else for_hydra(str(value))
    return _written(name, value)


def as_override(name: str, value: Any) -> str:
    """Write an option and its value as a word which, pasted in a shell, means that very value.

    Parameters
    ----------
    name, value
        As of `as_value`.

    Returns
    -------
    str
        ``rho=0.1``, ``'results_dir=my results'``.

    Raises
    ------
    UsageError
        If no command line can say it.
    """
    return shlex.quote(f"{name}={as_value(name, value)}")


def as_command(words: str, results_dir: str | Path) -> str:
    """Write a command for a results folder, which is named if it is not the default one."""
    usual = str(results_dir) == Config().results_dir
    return words if usual else f"{words} {as_override('results_dir', results_dir)}"


def decimal(value: float) -> float:
    """Return the decimal of at most twelve digits that a number means but for its rounding.

    Steps of 0.1 lead to 0.30000000000000004, which is another number than 0.3 and would be
    another run. A number that is no such decimal is itself; -0.0 is 0.0.
    """
    if not math.isfinite(value):
        return value
    short = float(f"{value:.12g}")
    near = abs(value - short) <= 16 * math.ulp(value)
    return (short if near else value) + 0.0


@cache
def _types() -> dict[str, set[Any]]:
    """Types that each option has: those of one name may differ between the choices of a group."""
    schemas = [(f"{group}.", one) for group, made in GROUPS.items() for one in made.values()]
    found: dict[str, set[Any]] = {}
    for prefix, schema in [("", Config()), *schemas]:
        for name, _, metadata in walk(schema, prefix):
            found.setdefault(name, set()).add(metadata["type"])
    return found


def _split(value: str) -> list[str]:
    """Split at the commas that stand outside of quotes and brackets."""
    parts, part, depth, start = [], "", 0, 0
    while start < len(value):
        quoted = None if part.strip(" \t") else _QUOTED.match(value, start)
        if quoted and re.match(r"[ \t]*(,|\Z)", value[quoted.end() :]):
            part, start = part + quoted[0], quoted.end()
            continue
        character = value[start]
        start += 1
        if character == "," and depth == 0:
            escapes = len(part) - len(part.rstrip("\\"))
            if escapes % 2:
                part = part[: len(part) - escapes] + "\\" * (escapes // 2) + ","
                continue
            parts.append(part[: len(part) - escapes // 2] if escapes else part)
            part = ""
            continue
        if character in "([{" and _closes(value, start):
            depth += 1
        elif character in ")]}" and depth:
            depth -= 1
        part += character
    return [*parts, part]


def _closes(value: str, start: int) -> bool:
    """Whether a bracket that was opened before `start` is closed."""
    depth = 1
    for character in value[start:]:
        depth += (character in "([{") - (character in ")]}")
        if depth == 0:
            return True
    return False


def _unescaped(content: str, quote: str) -> str:
    """Read what stands between quotes, as Hydra and OmegaConf do."""

    def halved(match: re.Match[str]) -> str:
        return match[1][: len(match[1]) // 2] + match[2]

    content = re.sub(rf"(\\+)({quote}|\Z)", halved, content)
    return re.sub(r"(\\+)(\$\{)", halved, content)


def _written(name: str, value: Any) -> str:
    """Write a value in Hydra's grammar."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and _types().get(name, set()) <= FLOATS and name in _types():
        return plain_number(value)  # 9 will do for 9.0 where nothing else can be meant
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, dict):
        return (
            "{" + ",".join(f"{_key(name, k)}:{_written(name, v)}" for k, v in value.items()) + "}"
        )
    if isinstance(value, list | tuple | range):
        return "[" + ",".join(_written(name, entry) for entry in value) + "]"
    if isinstance(value, str | PathLike):
        text = str(value)
        return text if _WORD.fullmatch(text) else for_hydra(text)
    raise UsageError(
        f"{name} is given a {type(value).__name__}: give a number, text, true or false, null, or a "
        "list or mapping of them"
    )


def _key(name: str, key: Any) -> str:
    if isinstance(key, str) and _WORD.fullmatch(key):
        return key
    raise UsageError(
        f"{name} has the key {key!r}, which a command line cannot say: give the mapping in an "
        "experiment's file"
    )
