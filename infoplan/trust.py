"""Functions that a stored run names: which may be imported."""

import hashlib
from collections.abc import Callable, Collection, Mapping
from typing import Any

from infoplan.config import MissionConfig
from infoplan.errors import UsageError
from infoplan.methods import OWN
from infoplan.own import find_source
from infoplan.text_options import as_override
from infoplan.wording import harmless


def admit(
    config: MissionConfig,
    science: Mapping[str, Any],
    named: Collection[str],
    trust: bool,
    tell: Callable[[str], object],
) -> None:
    """Let functions that a stored run names be imported, or refuse; none is imported here.

    Parameters
    ----------
    config, science
        The run's configuration, as a record and as it is stored. Only its detector and model
        count: a stored mission's planner is never asked again.
    named
        Groups whose function the command line itself names.
    trust
        Whether the others may be imported, if their files are those that were flown with.
    tell
        Is given a line for each function that will be imported.

    Raises
    ------
    UsageError
        Names the function, and what to do.
    """
    for group in ("detector", "model"):
        options = getattr(config, group)
        if not isinstance(options, OWN):
            continue
        path = str(options.function)
        option, file = as_override(f"{group}.function", path), find_source(path)
        if group not in named and not trust:
            raise UsageError(
                harmless(
                    f"the stored run's {group} is the function {path} ({file or 'not found here'}),"
                    f" which would be imported and run: if you trust it, give {option} or "
                    "trust=true"
                )
            )
        stored = science[group].get("sha256")
        if group not in named and stored is not None:
            found = hashlib.sha256(file.read_bytes()).hexdigest() if file else None
            if found != stored:
                raise UsageError(
                    harmless(
                        f"the stored run's {group} {path} is not what it was flown with: "
                        + (f"{file} has the SHA-256 {found}" if file else "its file is not here")
                        + f", the run says {stored}; {option} takes what is here"
                    )
                )
        tell(harmless(f"importing {path} from {file or 'Python itself'}"))
