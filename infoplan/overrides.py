"""Overrides of the commands that are not Hydra's: option=value in any order."""

from typing import Any

import yaml

from infoplan.errors import UsageError
from infoplan.wording import suggest


def parse(command: str, arguments: list[str], defaults: dict[str, Any]) -> dict[str, Any]:
    """Read ``option=value`` arguments and ``--flag`` switches.

    Parameters
    ----------
    command
        Name of the command, for messages.
    arguments
        The command line after the command.
    defaults
        Every option the command takes, with its default; a switch is called ``--name`` and is
        False by default.

    Returns
    -------
    dict
        The defaults, overridden; values are read as YAML, except where the default is a string.

    Raises
    ------
    UsageError
        On an unknown option or an argument of another form.
    """
    chosen = dict(defaults)
    for argument in arguments:
        name, equals, text = argument.partition("=")
        if name not in defaults:
            raise UsageError(
                f"infoplan {command} has no option {name!r}{suggest(name, defaults)}: "
                f"it takes {', '.join(_usage(key) for key in defaults)}"
            )
        if name.startswith("--"):
            if equals:
                raise UsageError(f"{name} takes no value: write {name} alone")
            chosen[name] = True
        elif not equals:
            raise UsageError(f"{name} wants a value: write {name}=...")
        else:
            chosen[name] = text if isinstance(defaults[name], str) else _value(name, text)
    return chosen


def _usage(key: str) -> str:
    return key if key.startswith("--") else f"{key}="


def _value(name: str, text: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise UsageError(f"{name}={text} cannot be read: check its brackets and quotes") from error
