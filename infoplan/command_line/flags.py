"""The flags of a command, looked up as they are written."""

from collections.abc import Iterable

import click

from infoplan.errors import UsageError
from infoplan.wording import suggest

HELP = ("-h", "--help")

NEAREST = 3
"""So many names are suggested for an unknown one at most."""


def flags_of(command: click.Command) -> dict[str, click.Option]:
    """Give the flags of a command by each way to write them, ``--help`` left out."""
    return {
        written: param
        for param in command.params
        if isinstance(param, click.Option)
        for written in param.opts
    }


def shown_flags(command: click.Command, ctx: click.Context) -> list[click.Option]:
    """List the flags that help and completion tell of, ``--help`` among them."""
    params = command.get_params(ctx)
    return [param for param in params if isinstance(param, click.Option) and not param.hidden]


def known_flag(command: click.Command, word: str, names: Iterable[str] = ()) -> click.Option:
    """Look a flag up.

    Parameters
    ----------
    command
        Which has it.
    word
        As it was written, perhaps with ``=value``.
    names
        Of options, which have no dashes.

    Raises
    ------
    UsageError
        If there is none.
    """
    flags = flags_of(command)
    flag, equals, text = word.partition("=")
    if flag in flags:
        return flags[flag]
    name, known = flag.lstrip("-"), set(names)
    bare = name if name in known else name.replace("-", "_")
    if bare in known:
        raise UsageError(
            f"{word} is written without dashes here: {bare}={text if equals else '...'}"
        )
    raise UsageError(
        f"there is no flag {flag!r}"
        f"{suggest(flag, [*flags, *HELP, *(f'{name}=' for name in known)], NEAREST)}: "
        f"use {', '.join([*flags, *HELP])}"
    )
