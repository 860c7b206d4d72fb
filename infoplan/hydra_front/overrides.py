"""Overrides as users type them, written so that Hydra reads what was meant."""

import itertools
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from decimal import Decimal
from functools import cache, lru_cache

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, RangeSweep
from hydra.errors import HydraException

from infoplan.config import GROUPS
from infoplan.errors import UsageError
from infoplan.hydra_front.known_options import all_options
from infoplan.options import requirement
from infoplan.own import load, text_parameters
from infoplan.study.limits import check_sweep, sweep_fits
from infoplan.text_options import (
    OWN_OPTION,
    decimal,
    for_hydra,
    renamed,
    text_options,
    typed_text,
    typed_texts,
)
from infoplan.wording import harmless


def readable(overrides: Sequence[str], several: bool) -> list[str]:
    """Write overrides so that Hydra reads what was typed.

    Parameters
    ----------
    overrides
        As typed: ``option=value``.
    several
        Whether commas separate values, as after ``-m``.

    Returns
    -------
    list of str
        Text is in quotes that Hydra takes off again. Doing it twice does no harm.

    Raises
    ------
    UsageError
        If one of them is no override.
    """
    overrides = [renamed(override) for override in overrides]
    parser = OverridesParser.create()
    own = _own_texts(overrides)
    words = [_readable(override, several, own, parser) for override in overrides]
    if several and not values_of("hydra/sweeper", overrides):
        words = [_stepped(word, parser) for word in words]
    for typed, word in zip(overrides, words, strict=True):
        try:
            _check_grammar(word)
        except (HydraException, RecursionError) as error:
            metadata = all_options().get(key(typed))
            remedy = (
                f"{key(typed)} must be {requirement(metadata)}"
                if metadata
                else "write option=value; a value with other than letters, digits and ./-_+ goes "
                "into quotes, \"option='...'\""
            )
            shown = typed if len(typed) < 100 else f"{typed[:60]} ..."
            raise UsageError(f"the argument {harmless(shown)} cannot be read: {remedy}") from error
    return words


@lru_cache(maxsize=4096)
def _check_grammar(word: str) -> None:
    """Let Hydra parse an override; the entries of a long sweep have many in common."""
    OverridesParser.create().parse_override(word)


def _readable(
    override: str, several: bool, own: Mapping[str, set[str]], parser: OverridesParser
) -> str:
    """Write one override as `readable` says."""
    name, equals, value = override.partition("=")
    bare = name.lstrip("+")
    if name.startswith("~"):
        if not name.startswith("~hydra"):
            raise UsageError(f"{override} would take away what infoplan needs: give {name[1:]}=...")
        return override
    if not equals or not bare:
        raise UsageError(f"the argument {override!r} is no option=value, and no flag")
    if not value:
        raise UsageError(f"{name}= has no value: give one, or leave {name}= out")
    for end in re.finditer(r"\.", bare):
        owner = all_options().get(bare[: end.start()])
        if owner and "dict" not in str(owner["type"]):
            raise UsageError(f"{bare[: end.start()]} has no parts: give {bare[: end.start()]}=...")
    metadata = all_options().get(bare)
    if (
        metadata
        and metadata["type"] is bool
        and re.search(r"(^|,)(?![01](,|$))[-+]?\d+(,|$)", value)
    ):
        # OmegaConf takes every number but 0 for true.
        raise UsageError(f"{override} is not possible: {bare} must be {requirement(metadata)}")
    if OWN_OPTION.match(name):
        # Hydra is to take options of which it has no list.
        name = f"++{name}"
    if all_options().get(bare, {}).get("type") in (list[list[float]], list[list[list[float]]]):
        # OmegaConf takes no whole number for a float there.
        value = re.sub(r"(?<![\w.])(\d+)(?![\w.])", r"\1.0", value)
    group, _, option = bare.partition(".options.")
    # What is in quotes Hydra reads as text anyhow.
    is_own = option in own.get(group, ()) and value[0] not in ("'", '"')
    if bare not in text_options() and not is_own:
        return f"{name}={value}"
    if several and re.match(r"(choice|range|interval|glob|sort|shuffle|tag)\(", value):
        try:
            parsed = parser.parse_override(f"{name}={value}")
        except HydraException:
            return f"{name}={for_hydra(typed_text(bare, value))}"
        if parsed.is_sweep_override():
            return f"{name}={_texts_in_choice(bare, value)}"
    texts = typed_texts(bare, value) if several else [typed_text(bare, value)]
    return f"{name}={','.join(map(for_hydra, texts))}"


def _stepped(word: str, parser: OverridesParser) -> str:
    """Write a range of decimals as its values: Hydra's steps are rounded, and may reach the stop.

    Sweepers that search take a range as a whole.
    """
    try:
        override = parser.parse_override(word)
    except (HydraException, RecursionError):
        return word  # it is told below what cannot be read
    sweep = override.value()
    if not isinstance(sweep, RangeSweep):
        return word
    if all(isinstance(number, int) for number in (sweep.start, sweep.stop, sweep.step)):
        return word
    start, step, count = _steps(sweep)
    if not count or not sweep_fits(count):
        return word  # it is refused when all are counted
    values = ",".join(str(start + i * step) for i in range(count))
    return f"{override.get_key_element()}={f'shuffle({values})' if sweep.shuffle else values}"


def _steps(sweep: RangeSweep) -> tuple[Decimal, Decimal, int]:
    """Start, step and number of values of a range, by its decimals as they were typed."""
    start, stop, step = (
        Decimal(str(decimal(number) if isinstance(number, float) else number))
        for number in (sweep.start, sweep.stop, sweep.step)
    )
    if not (start.is_finite() and stop.is_finite() and step.is_finite() and step):
        raise UsageError("range(start,stop,step) needs finite numbers and a step other than 0")
    return start, step, max(math.ceil((stop - start) / step), 0)


def _texts_in_choice(name: str, value: str) -> str:
    """Write the texts of ``choice(a,b)`` in quotes; other functions of Hydra stay as they are."""
    if match := re.fullmatch(r"choice\((.*)\)", value):
        return f"choice({','.join(map(for_hydra, typed_texts(name, match[1])))})"
    return value


def _own_texts(overrides: Sequence[str]) -> dict[str, set[str]]:
    """Options that are text of the user's functions which the overrides name, by their group."""
    functions, wanted = {}, set()
    for override in overrides:
        name, _, value = override.lstrip("+").partition("=")
        group, _, option = name.partition(".")
        if option == "function" and group in GROUPS and value:
            functions[group] = typed_text(name, value)
        elif option.startswith("options."):
            wanted.add(group)
    found = {}
    for group in wanted & set(functions):
        try:
            found[group] = text_parameters(load(str(functions[group])))
        except UsageError:
            continue  # whoever calls the function says what is wrong with it
    return found


def sweep_jobs(lines: Sequence[str], given: Sequence[str]) -> list[list[str]]:
    """Expand the command lines of ``sweep`` to the overrides of single jobs.

    Parameters
    ----------
    lines
        Overrides, also of several values, as after ``infoplan run -m``.
    given
        Overrides of the command line proper; they take the place of the lines' own.

    Returns
    -------
    list of list of str
        All combinations of each line, in order.

    Raises
    ------
    UsageError
        If a line is no command line, or they are more than can be held.
    """
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    taken = {override.key_or_group for override in parser.parse_overrides(list(given))}
    parse, parsed = cache(parser.parse_override), []
    for line in lines:
        try:
            if not isinstance(line, str):
                raise ValueError("no command line")
            overrides = [parse(word) for word in readable(shlex.split(line), several=True)]
            if any(override.key_or_group in ("sweep", "experiment") for override in overrides):
                raise ValueError("a study within a study")
            if any(each.is_sweep_override() != each.is_discrete_sweep() for each in overrides):
                raise ValueError("values that only a search can choose")
            own = [override for override in overrides if override.key_or_group not in taken]
            parsed.append(own)
        except (HydraException, ValueError, UsageError) as error:
            raise UsageError(
                f"the entry {line!r} of sweep cannot be read: it is what would follow "
                "`infoplan run -m`, like planner=uct,puct rho=0.1"
            ) from error
    check_sweep(sum(map(combinations, parsed)))
    return [
        [*given, *combination]
        for own in parsed
        for combination in itertools.product(*map(_values, own))
    ]


def _values(override: Override) -> list[str]:
    """Write an override of one or several values as overrides of one each."""
    if not override.is_sweep_override():
        return [override.input_line or ""]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]


def combinations(overrides: Sequence[Override]) -> int:
    """Count the jobs of overrides, of which the last of a name counts; none is written out.

    Raises
    ------
    UsageError
        If one of them has no value.
    """
    sizes = {override.key_or_group: _size(override) for override in overrides}
    for name, count in sizes.items():
        if not count:
            raise UsageError(
                f"the values of {name} are none: give a range or pattern that has some"
            )
    return math.prod(sizes.values())


def _size(override: Override) -> int:
    """Count the values of an override; 1 where Hydra or a sweeper that searches has to say."""
    value = override.value()
    if isinstance(value, RangeSweep):
        return _steps(value)[2]
    if not override.is_discrete_sweep():
        return 1
    return sum(1 for _ in override.sweep_string_iterator())


def key(word: str) -> str:
    """Name of the option, or the group, that an override is about."""
    return word.partition("=")[0].lstrip("+")


def values_of(name: str, overrides: Sequence[str]) -> list[str]:
    """List the values that overrides give an option or a group."""
    return [word.partition("=")[2] for word in overrides if key(word) == name]


def is_multirun(flags: Sequence[str], overrides: Sequence[str]) -> bool:
    """Whether commas part several values of an option."""
    asked = any(flag in ("-m", "--multirun") for flag in flags)
    return asked or values_of("hydra.mode", overrides)[-1:] == ["MULTIRUN"]
