"""A user's own function, found by its dotted path, and its options, typed by its annotations."""

import importlib
import inspect
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from infoplan.errors import UsageError
from infoplan.wording import suggest

WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a finite number",
    str: "text",
    list: "a list",
    dict: "a mapping",
    NoneType: "null",
}
"""The types that an option may have, and how each is called in a message."""

SUPPORTED = "int, float, bool, str, list, dict or one of them | None"


def load(path: str, option: str = "function") -> Callable[..., Any]:
    """Import what a dotted path names; modules in the current directory come first.

    Parameters
    ----------
    path
        ``module.function``, or ``package.module.Class``.
    option
        Name of the option that holds the path, for messages.

    Returns
    -------
    callable

    Raises
    ------
    UsageError
        If the path is none, its module cannot be imported, or it names nothing that can be called.
    """
    module_name, _, name = path.rpartition(".")
    if not module_name or not all(part.isidentifier() for part in path.split(".")):
        raise UsageError(f"{option}={path} is no dotted path: write it as module.function")
    module = _import(module_name, f"{option}={path}")
    public = [key for key, value in vars(module).items() if callable(value) and key[0] != "_"]
    found = getattr(module, name, None)
    if found is None:
        raise UsageError(
            f"{option}={path}: the module {module_name} ({_file(module)}) has no {name!r}"
            f"{suggest(name, public)}: name a function that it defines"
        )
    if not callable(found):
        raise UsageError(
            f"{option}={path} is a {type(found).__name__} and cannot be called: name a function"
        )
    return found


def text_parameters(function: Callable[..., Any]) -> set[str]:
    """Names of a function's keyword-only parameters that are annotated as text, or text | None."""
    try:
        signature = inspect.signature(function, eval_str=True)
    except (TypeError, ValueError, NameError, SyntaxError, AttributeError):
        return set()  # `resolve_options` says what is wrong with it
    return {
        key
        for key, parameter in signature.parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY
        and set(_alternatives(parameter.annotation)) <= {str, None, NoneType}
    }


def find_source(path: str) -> Path | None:
    """Find the file that importing a dotted path would run, and run nothing of it.

    Parameters
    ----------
    path
        As of `load`.

    Returns
    -------
    Path or None
        None if there is none: the module is built in, or cannot be found.
    """
    *modules, name = path.split(".")
    if not modules or not all(part.isidentifier() for part in (*modules, name)):
        return None
    loaded = getattr(sys.modules.get(".".join(modules)), "__file__", None)
    if loaded:
        return Path(loaded)
    places, file = None, None
    with _current_folder_first():
        for count in range(1, len(modules) + 1):
            full = ".".join(modules[:count])
            # Asked one by one: importlib's own search imports the packages on its way.
            finders = (finder for finder in sys.meta_path if hasattr(finder, "find_spec"))
            specs = (finder.find_spec(full, places) for finder in finders)
            spec = next((spec for spec in specs if spec), None)
            if spec is None:
                return None
            places, file = (
                spec.submodule_search_locations,
                spec.origin if spec.has_location else None,
            )
            if places is None and count < len(modules):
                return None
    return Path(file) if file else None


@contextmanager
def _current_folder_first() -> Iterator[None]:
    """Let modules in the current directory be found first, for a while."""
    before = list(sys.path)
    sys.path.insert(0, os.getcwd())
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = before


def resolve_options(
    function: Callable[..., Any], given: Mapping[str, Any], option: str = "options"
) -> dict[str, Any]:
    """Check options against a function's keyword-only parameters and fill in the defaults.

    Parameters
    ----------
    function
        Its keyword-only parameters are its options. Each is annotated with int, float, bool, str,
        list, dict, lists and mappings of these, or one of them ``| None``.
    given
        The options that were set.
    option
        Dotted name of the mapping, for messages.

    Returns
    -------
    dict
        Every option with its value, in the order of the signature; whole numbers for a float are
        floats.

    Raises
    ------
    UsageError
        If an option is unknown, missing or of another type, or the function declares one that no
        configuration can hold.
    """
    name = getattr(function, "__qualname__", repr(function))
    try:
        signature = inspect.signature(function, eval_str=True)
    except (TypeError, ValueError, NameError, SyntaxError, AttributeError) as error:
        raise UsageError(
            f"the parameters of {name} cannot be read ({error}): give a Python function whose "
            "annotations can be evaluated"
        ) from error
    declared = {
        key: parameter
        for key, parameter in signature.parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY
    }
    for key in given:
        if key not in declared:
            takes = f"it takes {', '.join(declared)}" if declared else "it takes none"
            raise UsageError(
                f"{name} has no option {option}.{key}{suggest(str(key), declared)}: {takes} "
                "(its keyword-only parameters)"
            )
    resolved = {}
    for key, parameter in declared.items():
        kind = parameter.annotation
        if not _is_supported(kind):
            what = "has no annotation" if kind is parameter.empty else f"is annotated {kind}"
            raise UsageError(f"the parameter {key!r} of {name} {what}: annotate it as {SUPPORTED}")
        if key not in given and parameter.default is parameter.empty:
            raise UsageError(f"{name} needs {option}.{key}: give {in_words(kind)}")
        value = given.get(key, parameter.default)
        if not fits(value, kind):
            where = f"{option}.{key}={value}" if key in given else f"the default {value!r} of {key}"
            raise UsageError(f"{where} does not fit {name}: it must be {in_words(kind)}")
        resolved[key] = _converted(value, kind)
    return resolved


def _import(name: str, asked: str) -> ModuleType:
    folder = os.getcwd()
    if folder not in sys.path:
        # To stay there: the module may import its neighbours later, and so may a worker.
        sys.path.insert(0, folder)
    importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            raise UsageError(
                f"{asked}: there is no module {error.name!r}, neither in {folder} nor among the "
                "installed packages: go to the folder that holds it, or install it"
            ) from error
        raise UsageError(f"{asked}: {name} cannot be imported: {error}") from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the module is the user's: anything may happen in it
        reason = " ".join(str(error).split())
        raise UsageError(
            f"{asked}: {name} cannot be imported: {type(error).__name__}: {reason}"
        ) from error


def _file(module: ModuleType) -> str:
    return getattr(module, "__file__", None) or "built in"


def _alternatives(kind: Any) -> tuple[Any, ...]:
    """Members of a union; a type alone is its only one."""
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _is_supported(kind: Any) -> bool:
    for member in _alternatives(kind):
        base = NoneType if member is None else get_origin(member) or member
        if base not in WORDS or not all(_is_supported(inner) for inner in get_args(member)):
            return False
    return True


def fits(value: Any, kind: Any) -> bool:
    """Tell whether a value is of a type, to the bottom of lists and mappings.

    Numbers for a float are finite, and whole ones will do; true and false are no numbers.
    """
    if type(value) is kind and kind in (int, bool, str):
        return True
    return any(_fits_one(value, member) for member in _alternatives(kind))


def _fits_one(value: Any, kind: Any) -> bool:
    if kind is Any:
        return True
    base, inner = get_origin(kind) or kind, get_args(kind)
    if kind in (None, NoneType):
        return value is None
    if base is float:
        return isinstance(value, int | float) and type(value) is not bool and math.isfinite(value)
    if base is int:
        return isinstance(value, int) and type(value) is not bool
    if not isinstance(value, base):
        return False
    if base is list and inner:
        return all(fits(entry, inner[0]) for entry in value)
    if base is dict and inner:
        return all(fits(k, inner[0]) and fits(v, inner[1]) for k, v in value.items())
    return True


def _converted(value: Any, kind: Any) -> Any:
    """Return a copy of a value that fits, its whole numbers floats where the type says so."""
    member = next(member for member in _alternatives(kind) if _fits_one(value, member))
    inner = get_args(member)
    if member is float:
        return float(value)
    if isinstance(value, list):
        return [_converted(entry, inner[0]) if inner else entry for entry in value]
    if isinstance(value, dict):
        return {k: _converted(v, inner[1]) if inner else v for k, v in value.items()}
    return value


def in_words(kind: Any) -> str:
    """Say what values a type takes."""
    described = []
    for member in _alternatives(kind):
        base = NoneType if member is None else get_origin(member) or member
        inner = get_args(member)
        of = f" of which each is {in_words(inner[-1])}" if inner else ""
        described.append(WORDS.get(base, "any value") + of)
    return " or ".join(described)
