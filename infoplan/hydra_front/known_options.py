"""Every option that some choice has, and what to say of one that there is not."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from infoplan.config import GROUPS, RENAMED, Config
from infoplan.options import walk
from infoplan.wording import suggest


def no_option(name: str) -> str:
    """Say that there is no such option, or none in the choice that was made."""
    known = all_options()
    group = name.split(".")[0]
    if group in RENAMED:
        return f"{group} is called {RENAMED[group]} now: write {RENAMED[group]} in its place"
    if name in known:
        return f"the chosen {group} has no option {name!r}: infoplan run --help tells which have it"
    return (
        f"there is no option {name!r}{suggest(name, [*known, *GROUPS, 'experiment'], 3)}: "
        "infoplan run --help lists all"
    )


@cache
def all_options() -> Mapping[str, dict[str, Any]]:
    """Metadata of every option that some choice has."""
    known = {name: metadata for name, _, metadata in walk(Config())}
    for group, choices in GROUPS.items():
        for schema in choices.values():
            for name, _, metadata in walk(schema, f"{group}."):
                known.setdefault(name, metadata)
    return MappingProxyType(known)
