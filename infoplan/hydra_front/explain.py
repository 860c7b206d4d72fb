"""What Hydra and OmegaConf refuse, in one sentence."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import yaml
from hydra.errors import MissingConfigException
from omegaconf.errors import (
    ConfigKeyError,
    ConfigTypeError,
    GrammarParseError,
    InterpolationResolutionError,
    MissingMandatoryValue,
    ValidationError,
)

from infoplan.config import GROUPS
from infoplan.errors import RunError, UsageError
from infoplan.hydra_front.known_options import all_options, no_option
from infoplan.options import requirement
from infoplan.wording import suggest


@contextmanager
def explained(done: Sequence[int | Exception] = ()) -> Iterator[None]:
    """Put what goes wrong while a configuration is composed in words.

    Parameters
    ----------
    done
        How the studies ended that were acted on meanwhile. Their own errors stay what they are;
        after the first, composing is over and what remains is a sweeper's or launcher's.
    """
    try:
        yield
    except UsageError:
        raise
    except Exception as error:
        if error in done:
            raise
        if failures := [failure for failure in done if isinstance(failure, Exception)]:
            raise failures[0] from error
        if isinstance(error, RunError):
            raise
        if done:
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise RunError(f"the sweep ended early, Hydra says {reason}") from error
        raise UsageError(explain(error)) from error


def explain(error: BaseException) -> str:
    """Say in one sentence what is wrong with a configuration that Hydra refused."""
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(cause)
    text = "\n".join(str(link) for link in chain)
    for link in chain:
        for kind, sentence in SENTENCES.items():
            if isinstance(link, kind) and (said := sentence(link)):
                file = re.search(r"In '(\w+)/([^']*)': \w+ raised", text)
                return f"{file[1]}={file[2]}: {said}" if file else said
    for pattern, words in REFUSALS.items():
        if match := re.search(pattern, text):
            return words(match)
    return (
        "the configuration cannot be made of these options and files: leave out one after the "
        "other (HYDRA_FULL_ERROR=1 shows where it fails)"
    )


def _missing_file(error: Any) -> str:
    """Name a choice, an experiment or a root configuration that is not there."""
    name = str(error.missing_cfg_file or "")
    group, slash, choice = name.rpartition("/")
    if not slash:
        called = f"no configuration {name!r}" if name else "no configuration in that folder"
        return f"there is {called}: leave out --config-name and --config-path"
    choices = list(error.options or GROUPS.get(group, {}))
    takes = f"{group}= takes {', '.join(choices)}" if choices else f"there is no group {group}"
    where = ""
    if group == "experiment":
        where = ", or put its file into the folder experiment of --config-dir"
    elif "own" in choices and "." in choice:
        where = f"; a function of your own is {group}=own {group}.function={choice}"
    return f"there is no {group} {choice!r}{suggest(choice, choices)}: {takes}{where}"


def _bad_yaml(error: Any) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or "it cannot be read"
    where = f"{mark.name}, line {mark.line + 1}, column {mark.column + 1}" if mark else "a file"
    return f"{where} is no YAML: {problem}; mend it"


def _wrong_type(error: Any) -> str:
    name = str(error.full_key or "").lstrip(".")
    known = all_options()
    option = next((name[:end] for end in _ends(name) if name[:end] in known), "")
    if name.partition(".")[0] == "hydra":
        return f"{name}={error.value} is not possible: Hydra takes another kind of value there"
    if not option:
        return ""
    value = f"={'null' if error.value is None else error.value}"
    if name != option or not isinstance(error, ValidationError):
        value = ""  # it is a part's, or not told
    return f"{option}{value} is not possible: {option} must be {requirement(known[option])}"


def _wrong_value(name: str, value: str) -> str:
    if metadata := all_options().get(name):
        return f"{name}={value} is not possible: {name} must be {requirement(metadata)}"
    return f"{name}={value} is not possible"


def _ends(name: str) -> Iterator[int]:
    """Where a dotted name, or one with indices, may end, the longest first."""
    yield len(name)
    yield from (match.start() for match in reversed(list(re.finditer(r"[.\[]", name))))


def _unknown_key(error: Any) -> str:
    name = str(error.full_key or "").lstrip(".")
    if name == "experiment":
        return "its first line must be `# @package _global_`, and then option: value, a line each"
    return no_option(name) if name else ""


def _leads_nowhere(error: Any) -> str:
    name = str(error.full_key or "an option").lstrip(".")
    return (
        f"{name} refers with ${{...}} to what is not there, or to itself: write its value, or "
        "another option's name in place of the dots"
    )


SENTENCES: dict[type[BaseException], Callable[[Any], str]] = {
    UsageError: str,  # of what Hydra has made for us
    MissingConfigException: _missing_file,
    yaml.YAMLError: _bad_yaml,
    UnicodeDecodeError: lambda error: (
        f"a file of the configuration is not in UTF-8: {error.reason}"
    ),
    RecursionError: lambda error: (
        "the configuration refers to itself or is nested too deep: write the values themselves"
    ),
    InterpolationResolutionError: _leads_nowhere,
    GrammarParseError: _leads_nowhere,
    MissingMandatoryValue: lambda error: f"{error.full_key} has no value: give one",
    ConfigKeyError: _unknown_key,
    ValidationError: _wrong_type,
    ConfigTypeError: _wrong_type,
    OSError: lambda error: (
        f"{error.filename} cannot be read or written ({error.strerror}): name another"
        if error.filename
        else ""
    ),
}
"""What to say of an error of Hydra or OmegaConf; empty where the text of others says more."""

REFUSALS: dict[str, Callable[[re.Match[str]], str]] = {
    r"Ambiguous value for argument '([^'=]+)": lambda match: (
        f"{match[1]} gives several values: add -m to run them all, or quote what is one value"
    ),
    r"Sweep parameters '([^'=]+)": lambda match: (
        f"{match[1]} gives several values: add -m to run them all"
    ),
    r"Could not override '([^']+)'": lambda match: no_option(match[1]),
    r"Error merging override \+*([^\s=]+)=(.*)": lambda match: _wrong_value(match[1], match[2]),
    r"Merge error: \w+ is not a subclass of (\w+)Config": lambda match: (
        "a group is chosen by a list `defaults:` in a file, with `- override /planner: uct`, and "
        "its options are given as option: value"
    ),
    r"Config group override must be a string": lambda match: (
        "planner, detector, terrain, model and experiment are chosen by a name: leave out null, "
        "numbers and the like"
    ),
    r"Multiple values for (\S+)\.": lambda match: f"write {match[1]}=... without the +",
    r"Invalid defaults list in '([^']+)'": lambda match: (
        f"{match[1]}: `defaults:` must be a list, like [override /planner: uct]"
    ),
    r"does not support sweep type : (\w+)_SWEEP": lambda match: (
        f"{match[1].lower()}() needs a sweeper that searches, such as hydra/sweeper=optuna "
        "(pip install 'infoplan[sweep]')"
    ),
    r"range\(\) arg 3 must not be zero|Invalid range values": lambda match: (
        "range(start,stop,step) needs a step other than 0"
    ),
    r'Could not detect "srun"': lambda match: (
        "hydra/launcher=submitit_slurm finds no Slurm on this machine: start it where srun is, or "
        "give hydra/launcher=submitit_local"
    ),
    r"Expecting one subcommand|No completion plugin": lambda match: (
        "--shell-completion wants install=bash, install=zsh or install=fish"
    ),
    r"(?:Could not append to config\. An item is already at|Could not append) '([^']+?)'": (
        lambda match: f"{match[1]} is an option that there is: write {match[1]}=... without the +"
    ),
}
"""What to say where only the text of the error tells; each has one name."""
