"""Who is to blame when a mission breaks: the user's own method, PyOD, or infoplan itself."""

import inspect
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType
from typing import Any

from infoplan.config import METHODS, MissionConfig, PyodConfig
from infoplan.errors import RunError, UsageError
from infoplan.methods import OWN, load_own, method_label, source_file


@contextmanager
def culprit_named(config: MissionConfig, doing: str) -> Iterator[None]:
    """Turn what goes wrong in the user's code, or in PyOD, into a `RunError` that says where.

    Parameters
    ----------
    config
        The mission's.
    doing
        What was going on, for the message.
    """
    try:
        yield
    except (UsageError, RunError):
        raise
    except Exception as error:
        calls = [(frame.f_code, line) for frame, line in traceback.walk_tb(error.__traceback__)]
        group = _culprit(config, [code for code, _ in calls])
        if group is None:
            raise
        options = getattr(config, group)
        file, line = next(
            (code.co_filename, line)
            for code, line in reversed(calls)
            if _is_of(group, options, code.co_filename)
        )
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RunError(
            f"the {group} {method_label(options)} failed {doing}: {reason} "
            f"({Path(file).name}, line {line})"
        ) from error


def _culprit(config: MissionConfig, codes: list[CodeType]) -> str | None:
    """Find the group whose method was called, by the outermost call that is one's own.

    Several methods may be in one file: it alone tells only where no method is seen in its calls,
    as with a decorator that fails.
    """
    for by_file in (False, True):
        for code in codes:
            for group in METHODS:
                options = getattr(config, group)
                if _is_of(group, options, code.co_filename) and (
                    by_file or _is_part(code.co_qualname, group, options)
                ):
                    return group
    return None


def _is_part(name: str, group: str, options: Any) -> bool:
    """Tell whether a qualified name in an own method's file is that method's or in it.

    True of a method that has no name of its own, such as an instance, and of all that PyOD has.
    """
    if not isinstance(options, OWN):
        return True
    method = load_own(group, options)
    if not hasattr(method, "__qualname__"):
        return True
    # Of a class also those that it derives from: their methods are its own.
    parts = inspect.getmro(method) if inspect.isclass(method) else (method,)
    return any(f"{name}.".startswith(f"{part.__qualname__}.") for part in parts)


def _is_of(group: str, options: Any, filename: str) -> bool:
    """Tell whether a file defines an own method, or belongs to PyOD where that is the detector."""
    if isinstance(options, OWN):
        return filename == source_file(load_own(group, options))
    return isinstance(options, PyodConfig) and "pyod" in Path(filename).parts
