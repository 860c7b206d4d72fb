"""What a command declares: settings ``name=value``, flags for Hydra, options of configurations."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from keyword import iskeyword
from typing import Any, TypeVar

import click

from infoplan.command_line.types import allowed, written
from infoplan.errors import UsageError

Function = TypeVar("Function", bound=Callable[..., Any])

GIVEN = "infoplan.given"
"""Where a context keeps the words ``name=value`` that were given, the last of each name."""

FLAGS = "infoplan.flags"
"""Where a context keeps the names of the flags that were given."""


class Setting(click.Parameter):
    """An option that is written ``name=value``, at any place after the command.

    Parameters
    ----------
    word
        Its name; a dot in it is an underscore in the function's parameter, and a keyword of Python
        has one behind it.
    type
        Of its values.
    doc
        One line for a person.
    default
        What it is if it is not given.
    unit
        Of its values, empty where they have none.
    bare
        How many words without ``=`` are taken for its value, too; -1: any number, as a tuple.
    named
        Whether ``name=value`` is a way to write it.
    """

    param_type_name = "setting"

    def __init__(
        self,
        word: str,
        type: Any,
        doc: str,
        *,
        default: Any = None,
        unit: str = "",
        bare: int = 0,
        named: bool = True,
    ):
        super().__init__([word], type=type, default=default, nargs=-1 if bare < 0 else 1)
        self.word, self.doc, self.unit, self.bare, self.named = word, doc, unit, bare, named

    def _parse_decls(
        self, decls: Sequence[str], expose_value: bool
    ) -> tuple[str, list[str], list[str]]:
        name = decls[0].replace(".", "_")
        return f"{name}_" if iskeyword(name) else name, [f"{decls[0]}="], []

    def add_to_parser(self, parser: Any, ctx: click.Context) -> None:
        """Leave the parser of flags alone: `Command` finds the words."""

    def consume_value(self, ctx: click.Context, opts: Any) -> Any:
        """Take the value from the words that were given."""
        given = ctx.meta[GIVEN]
        return super().consume_value(
            ctx, {self.name: given[self.word]} if self.word in given else {}
        )

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Read the value; what it cannot be is told in one sentence."""
        try:
            return super().type_cast_value(ctx, value)
        except click.BadParameter as error:
            raise UsageError(
                f"{self.word}={value} is not possible: it must be {self.allowed()} ({self.doc})"
            ) from error

    def allowed(self) -> str:
        """Say what values it takes."""
        return allowed(self.type) + (f", in {self.unit}" if self.unit else "")

    def get_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Show in the usage line what stands for itself, without ``name=``."""
        return [f"[{self.word}{' ...' if self.bare < 0 else ''}]"] if self.bare else []

    def get_help_record(self, ctx: click.Context) -> tuple[str, str]:
        """Give the lines of the help page."""
        term = f"{self.word}={written(self.default)}" if self.named else self.word
        return term, f"{self.doc} ({self.allowed()})"


class HydraFlag(click.Option):
    """A flag that goes on to Hydra as it was written.

    Parameters
    ----------
    decls, **attributes
        Of a Click option.
    optional
        Values that it may be followed by, but need not.
    """

    def __init__(self, decls: Sequence[str], *, optional: Sequence[str] = (), **attributes: Any):
        super().__init__([*decls], expose_value=False, **attributes)
        self.optional = optional


@dataclass(frozen=True)
class More:
    """Options of configurations, which a command takes besides its own.

    Attributes
    ----------
    parameter
        Which parameter of the function gets them: ``overrides``, a list of words as after
        ``infoplan run``, or ``filters``, a mapping of names to values.
    settings
        Gives their declarations, for the words that were given.
    passes
        Whether to pass on a word, by its name, that has no declaration.
    several
        Whether commas part several values; is given the flags.
    pages
        Adds their part to the help page.
    documented
        What they are, for a message about unknown options.
    words
        Completes words that are none of these options.
    """

    parameter: str
    settings: Callable[[dict[str, str]], list[Setting]]
    passes: Callable[[str], bool]
    several: Callable[[Iterable[str]], bool] = lambda flags: False
    pages: Callable[[click.HelpFormatter, dict[str, str]], None] | None = None
    documented: str = ""
    words: Callable[[str], list[str]] = lambda incomplete: []


def setting(word: str, type: Any, doc: str, **attributes: Any) -> Callable[[Function], Function]:
    """Declare a `Setting` of the command that is decorated."""

    def decorate(function: Function) -> Function:
        # Click's decorators collect parameters in this attribute, the last one first.
        declared = function.__dict__.setdefault("__click_params__", [])
        declared.append(Setting(word, type, doc, **attributes))
        return function

    return decorate


def hydra_flag(*decls: str, **attributes: Any) -> Callable[[Function], Function]:
    """Declare a `HydraFlag` of the command that is decorated."""

    def decorate(function: Function) -> Function:
        function.__dict__.setdefault("__click_params__", []).append(HydraFlag(decls, **attributes))
        return function

    return decorate
