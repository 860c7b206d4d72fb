"""Hydra's flags on a command line of ours: in any order, and checked before Hydra sees them."""

from collections.abc import Sequence
from pathlib import Path

from infoplan.errors import UsageError
from infoplan.wording import suggest

CONFIG_KINDS = ("job", "hydra", "all")

INFO_CHOICES = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")

SHORT_FLAGS = {
    "-h": "--help", "-r": "--run", "-m": "--multirun", "-c": "--cfg", "-p": "--package",
    "-i": "--info", "-sc": "--shell-completion", "-cp": "--config-path", "-cn": "--config-name",
    "-cd": "--config-dir",
}  # fmt: skip

VALUED_FLAGS = {
    "--cfg": "one of job, hydra and all",
    "--package": "a part of the configuration, such as planner",
    "--config-path": "a folder",
    "--config-name": "the name of a configuration",
    "--config-dir": "a folder",
}
"""Flags that need a value, and what it is."""

FLAGS = (*SHORT_FLAGS.values(), "--hydra-help", "--version", "--resolve")


def sort_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Split a command line into flags, with their values, and overrides, in any order."""
    flags, overrides = [], []
    rest = iter(arguments)
    for argument in rest:
        if not argument.startswith("-"):
            overrides.append(argument)
            continue
        flags.append(argument)
        if SHORT_FLAGS.get(argument, argument) in VALUED_FLAGS:
            flags.extend(value for value in [next(rest, None)] if value is not None)
        elif argument in ("-i", "--info"):
            # Its value is optional: without one, the next override would be taken for it.
            flags[-1] = "--info=all"
            following = next(rest, None)
            if following in INFO_CHOICES:
                flags[-1] = f"--info={following}"
            elif following is not None:
                more_flags, more_overrides = sort_arguments([following, *rest])
                return flags + more_flags, overrides + more_overrides
    return flags, overrides


def given_flags(flags: Sequence[str]) -> dict[str, str]:
    """Check the flags of a command line, as `sort_arguments` gives them.

    Returns
    -------
    dict
        The long name of each flag, and its value; empty where it takes none.

    Raises
    ------
    UsageError
        If a flag is unknown, lacks its value, or does not go with another.
    """
    given: dict[str, str] = {}
    rest = iter(flags)
    for flag in rest:
        name, equals, value = flag.partition("=")
        name = SHORT_FLAGS.get(name, name)
        if name not in FLAGS:
            raise UsageError(
                f"there is no flag {flag!r}{suggest(flag, FLAGS)}: infoplan run --help lists all"
            )
        if name in VALUED_FLAGS and not equals:
            value = next(rest, "")
        elif name not in (*VALUED_FLAGS, "--info") and equals:
            raise UsageError(f"{name} takes no value: write {name} alone")
        if name in VALUED_FLAGS and (not value or (not equals and "=" in value)):
            raise UsageError(f"{name} wants {VALUED_FLAGS[name]}")
        given[name] = value
    if given.get("--cfg", "job") not in CONFIG_KINDS:
        raise UsageError(
            f"--cfg {given['--cfg']} shows nothing: use one of {_listed(CONFIG_KINDS)}"
        )
    if given.get("--info", "all") not in INFO_CHOICES:
        raise UsageError(
            f"--info={given['--info']} shows nothing: use one of {_listed(INFO_CHOICES)}"
        )
    if "--cfg" not in given and "--help" not in given:
        for name in ("--resolve", "--package"):
            if name in given:
                raise UsageError(f"{name} changes what --cfg shows: write --cfg job {name}, too")
    modes = ("--run", "--multirun", "--cfg", "--info", "--shell-completion")
    if len(chosen := [name for name in modes if name in given]) > 1:
        raise UsageError(f"{' and '.join(chosen)} do not go together: leave out all but one")
    folder = given.get("--config-dir")
    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"--config-dir {folder} is no folder: name the one that holds experiment/")
    return given


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}"
