"""Commands whose options are words, ``option=value`` in any order, on top of Click.

A `Setting` declares an option; Click's own options are the flags. Parsing, help, completion and
suggestions all read the same declarations.
"""

import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from infoplan.errors import UsageError
from infoplan.files import user_path
from infoplan.wording import suggest

HELP = ("-h", "--help")

NEAREST = 3
"""So many names are suggested for an unknown one at most."""

WIDEST = 100
"""Columns of a page where the terminal is wider; ``COLUMNS`` says otherwise."""

GIVEN = "infoplan.given"
"""Where a context keeps the words ``name=value`` that were given, the last of each name."""

FLAGS = "infoplan.flags"
"""Where a context keeps the names of the flags that were given."""

OPEN = "open"
"""Type of a completion after which the word goes on: no space follows."""

Function = TypeVar("Function", bound=Callable[..., Any])


class Setting(click.Parameter):
    """An option that is written ``name=value``, at any place after the command.

    Parameters
    ----------
    word
        Its name; a dot in it is an underscore in the function's parameter.
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
        return decls[0].replace(".", "_"), [f"{decls[0]}="], []

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


class Page(click.HelpFormatter):
    """A page whose left column leaves room for the right one, however narrow it is."""

    def write_dl(
        self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2
    ) -> None:
        """Write two columns."""
        super().write_dl(list(rows), min(col_max, self.width * 2 // 5), col_spacing)


class Context(click.Context):
    """A context with pages of ours."""

    formatter_class = Page


class Command(click.Command):
    """A command of words.

    Parameters
    ----------
    *arguments, **attributes
        Of a Click command.
    examples
        Command lines that work.
    more
        Gives what it takes of the options of configurations; called only when that is needed.
    """

    context_class = Context

    def __init__(
        self,
        *arguments: Any,
        examples: Sequence[str] = (),
        more: Callable[[], More] | None = None,
        **attributes: Any,
    ):
        attributes |= {"context_settings": {"help_option_names": list(HELP)}}
        super().__init__(*arguments, **attributes)
        self.examples, self._more = examples, more

    @property
    def more(self) -> More | None:
        """What it takes of the options of configurations."""
        return self._more() if self._more else None

    @property
    def settings(self) -> list[Setting]:
        """Its own settings."""
        return [param for param in self.params if isinstance(param, Setting)]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Sort the words, and give each to the declaration that it belongs to."""
        show_help_if_asked(self, ctx, args)
        words = _Words(self, ctx, args)
        ctx.meta[GIVEN] = words.given
        super().parse_args(ctx, words.flags)
        if self.more and self.more.parameter == "overrides":
            ctx.params["overrides"] = words.overrides
        elif self.more:
            filters = {setting.word: setting for setting in self.more.settings(words.given)}
            ctx.params["filters"] = {
                name: filters[name].type_cast_value(ctx, text)
                for name, text in words.given.items()
                if name in filters and not ctx.resilient_parsing
            }
        return []

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the line that shows where options and flags go."""
        pieces = [piece for param in self.params for piece in param.get_usage_pieces(ctx)]
        if any(setting.named for setting in self.settings) or self.more:
            pieces.append("[option=value ...]")
        formatter.write_usage(ctx.command_path, " ".join([*pieces, "[flags]"]))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write examples, options and flags, and what there is to say of configurations."""
        write_examples(formatter, self.examples)
        if self.settings:
            with formatter.section("Options"):
                formatter.write_dl([setting.get_help_record(ctx) for setting in self.settings])
        with formatter.section("Flags"):
            formatter.write_dl(flag_records(self, ctx))
        if self.more and self.more.pages:
            self.more.pages(formatter, ctx.meta.get(GIVEN, {}))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete a word: a flag, a value, or the name of an option."""
        if incomplete.startswith("-"):
            return flag_items(self, ctx, incomplete)
        given = ctx.meta.get(GIVEN, {})
        settings = [setting for setting in self.settings if setting.named]
        flags: list[str] = ctx.meta.get(FLAGS, [])
        if self.more:
            if words := self.more.words(incomplete):
                return [CompletionItem(word, type=OPEN) for word in words]
            settings += self.more.settings(given)
        name, equals, text = incomplete.partition("=")
        if equals:
            several = self.more is not None and self.more.several(flags)
            for setting in settings:
                if setting.word == name:
                    return _value_items(ctx, setting, text, several)
            return []
        items = []
        for setting in self.settings:
            if setting.bare < 0 or (setting.bare and setting.word not in given):
                taken = given.get(setting.word, ()) if setting.bare < 0 else ()
                found = setting.type.shell_complete(ctx, setting, incomplete)
                items += [item for item in found if item.value not in taken]
        return items + _name_items(settings, given, incomplete)


class Group(click.Group):
    """A command of commands; otherwise as `Command`."""

    context_class = Context

    def __init__(self, *arguments: Any, examples: Sequence[str] = (), **attributes: Any):
        attributes |= {"context_settings": {"help_option_names": list(HELP)}}
        super().__init__(*arguments, **attributes | {"no_args_is_help": False})
        self.examples = examples

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Find the subcommand."""
        first = next(iter(args), "")
        if not ctx.resilient_parsing:
            if first in HELP or not args:
                click.echo(self.get_help(ctx))
                ctx.exit(0 if args else 2)
            if first.startswith("-"):
                flag = known_flag(self, first)
                if not flag.is_flag and first in flag.opts and len(args) == 1:
                    raise UsageError(f"{first} wants a value: {flag.metavar} ({flag.help})")
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Look the subcommand up.

        Raises
        ------
        UsageError
            If there is none of that name.
        """
        if not ctx.resilient_parsing and args[0] not in self.commands:
            path = ctx.command_path
            raise UsageError(
                f"there is no command {args[0]!r}"
                f"{suggest(args[0], self.commands, NEAREST)}: use {', '.join(self.commands)}; "
                f"{path} --help tells what they do"
            )
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the subcommands in the order of their declarations."""
        return list(self.commands)

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the line that shows where the subcommand goes."""
        formatter.write_usage(ctx.command_path, "<command> [option=value ...] [flags]")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write examples, subcommands and flags."""
        write_examples(formatter, self.examples)
        rows = []
        for name, command in self.commands.items():
            pieces = [piece for param in command.params for piece in param.get_usage_pieces(ctx)]
            if isinstance(command, click.Group):
                pieces = ["|".join(command.commands)]
            rows.append((" ".join([name, *pieces]), (command.help or "").rstrip(".")))
        with formatter.section("Commands"):
            formatter.write_dl(rows)
        with formatter.section("Flags"):
            formatter.write_dl(flag_records(self, ctx))


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


class UserPath(click.ParamType):
    """A path as the user typed it, its ``~`` their home.

    Parameters
    ----------
    folder
        Whether it is one of a folder: completion offers no files then.
    """

    name = "path"

    def __init__(self, folder: bool = False):
        self.folder, self.words = folder, "a folder" if folder else "a path"

    def convert(self, value: Any, param: Any, ctx: Any) -> Path | None:
        """Read it."""
        from infoplan.text_options import typed_text

        text = typed_text(param.word, str(value))
        return None if text is None else user_path(text)

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer what is there."""
        return path_items(incomplete, folders_alone=self.folder)


class Text(click.ParamType):
    """Text as the user typed it."""

    name, words = "text", "text"

    def convert(self, value: Any, param: Any, ctx: Any) -> str | None:
        """Read it."""
        from infoplan.text_options import typed_text

        return typed_text(param.word, str(value))


class Number(click.FloatRange):
    """A finite number within bounds."""

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Read it."""
        number = float(super().convert(value, param, ctx))
        if number != number or number in (float("inf"), float("-inf")):
            self.fail(f"{value} is not finite", param, ctx)
        return number


def allowed(kind: click.ParamType) -> str:
    """Say what values a type takes."""
    if words := getattr(kind, "words", ""):
        return str(words)
    if isinstance(kind, click.Choice):
        return either([str(choice) for choice in kind.choices])
    if isinstance(kind, click.types.BoolParamType):
        return "true or false"
    words = {"integer": "a whole number", "integer range": "a whole number",
             "float range": "a number"}.get(kind.name, "text")  # fmt: skip
    if isinstance(kind, click.IntRange | click.FloatRange):
        low = "above" if kind.min_open else "at least"
        high = "below" if kind.max_open else "at most"
        bounds = [f"{low} {kind.min:g}"] if kind.min is not None else []
        bounds += [f"{high} {kind.max:g}"] if kind.max is not None else []
        return ", ".join([words, " and ".join(bounds)] if bounds else [words])
    return words


def either(names: Sequence[str]) -> str:
    """Join names: ``a, b or c``."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def written(value: Any) -> str:
    """Write a default as on the command line; empty for none."""
    if value is None or value == ():
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{','.join('null' if v is None else written(v) for v in value)}]"
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def page_width() -> int:
    """Columns of a help page: those of ``COLUMNS`` or the terminal, 80 in a pipe."""
    columns = shutil.get_terminal_size((80, 24)).columns
    return max(30, columns if os.environ.get("COLUMNS", "").isdigit() else min(columns, WIDEST)) - 1


def show_help_if_asked(command: click.Command, ctx: click.Context, args: Sequence[str]) -> None:
    """Print the page of a command and end, if one of its words asks for it."""
    if ctx.resilient_parsing or not set(HELP) & set(args):
        return
    parted = (word.partition("=") for word in args)
    ctx.meta[GIVEN] = {name: text for name, equals, text in parted if equals}
    click.echo(command.get_help(ctx))
    ctx.exit()


def write_examples(formatter: click.HelpFormatter, examples: Sequence[str]) -> None:
    """Write command lines that can be pasted, broken where they are too long."""
    if not examples:
        return
    with formatter.section("Example" if len(examples) == 1 else "Examples"):
        for example in examples:
            first, *rest = example.split(" ")
            lines = [first]
            for word in rest:
                if len(lines[-1]) + len(word) + 7 > formatter.width:
                    lines[-1] += " \\"
                    lines.append(f"  {word}")
                else:
                    lines[-1] += f" {word}"
            for line in lines:
                formatter.write(f"{' ' * formatter.current_indent}{line}\n")


def flags_of(command: click.Command) -> dict[str, click.Option]:
    """Give the flags of a command by each way to write them, ``--help`` left out."""
    return {
        written: param
        for param in command.params
        if isinstance(param, click.Option)
        for written in param.opts
    }


def flag_records(command: click.Command, ctx: click.Context) -> list[tuple[str, str]]:
    """Lines of the help page about a command's flags."""
    return [
        (
            ", ".join(option.opts) + _metavar(option),
            "show this page" if set(option.opts) & set(HELP) else option.help or "",
        )
        for option in _shown(command, ctx)
    ]


def flag_items(command: click.Command, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Complete a flag that was not given yet."""
    given = set(ctx.meta.get(FLAGS, []))
    return [
        CompletionItem(written, help=option.help)
        for option in _shown(command, ctx)
        if not given & set(option.opts)
        for written in option.opts
        if written.startswith(incomplete)
        and (written.startswith("--") or not incomplete.startswith("--"))
    ]


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


def path_items(incomplete: str, *, folders_alone: bool = False) -> list[CompletionItem]:
    """Complete a path; what is hidden only if it was begun."""
    head, begun = os.path.split(incomplete)
    try:
        entries = sorted(os.scandir(user_path(head or ".")), key=lambda entry: entry.name)
    except (OSError, ValueError):
        return []
    items = []
    for entry in entries:
        if not entry.name.startswith(begun) or (entry.name[0] == "." and not begun):
            continue
        try:
            folder = entry.is_dir()
        except OSError:
            folder = False
        if folder or not folders_alone:
            text = os.path.join(head, entry.name) + "/" * folder
            items.append(CompletionItem(text, type=OPEN if folder else "plain"))
    return items


class _Words:
    """The words after a command, sorted.

    Attributes
    ----------
    flags
        The command's own flags, with their values: for Click.
    given
        ``name=value`` words, the last of each name; those without ``=`` under the name of the
        setting that takes them.
    overrides
        Words that belong to the configuration, and Hydra's flags, as they were written.
    """

    def __init__(self, command: Command, ctx: click.Context, args: Sequence[str]):
        self.command, self.path, self.lenient = command, ctx.command_path, ctx.resilient_parsing
        self.flags: list[str] = []
        self.given: dict[str, Any] = {}
        self.overrides: list[str] = []
        own = {setting.word: setting for setting in command.settings if setting.named}
        undeclared: list[str] = []
        bare: list[str] = []
        seen = ctx.meta[FLAGS] = []
        rest = list(args)
        while rest:
            word = rest.pop(0)
            name, equals, text = word.partition("=")
            if word.startswith("-"):
                seen.append(name)
                self._flag(word, rest, own)
            elif equals:
                self.given[name] = text
                if name not in own:
                    undeclared.append(word)
            else:
                bare.append(word)
        self._bare(bare, undeclared)
        self._undeclared(undeclared, own)

    def _names(self, own: Iterable[str]) -> list[str]:
        more = self.command.more
        return [*own, *(s.word for s in more.settings(self.given))] if more else [*own]

    def _flag(self, word: str, rest: list[str], own: dict[str, Setting]) -> None:
        name, equals, text = word.partition("=")
        if self.lenient and name not in flags_of(self.command):
            return
        flag = known_flag(self.command, word, self._names(own))
        passed = self.overrides if isinstance(flag, HydraFlag) else self.flags
        passed.append(word)
        optional = flag.optional if isinstance(flag, HydraFlag) else ()
        if flag.is_flag:
            if equals and not self.lenient:
                raise UsageError(f"{name} takes no value: write {name} alone")
            return
        if not equals:
            follows = rest and (not optional or rest[0] in optional)
            if not follows and not (optional or self.lenient):
                value = flag.metavar or allowed(flag.type)
                raise UsageError(f"{name} wants a value: {value} ({flag.help})")
            text = rest.pop(0) if follows else ""
            passed += [text] if follows else []
        choices = getattr(flag.type, "choices", optional)
        if text and choices and text not in choices and not self.lenient:
            raise UsageError(f"{name} {text} is not a choice: use {either(choices)}")

    def _bare(self, words: list[str], undeclared: list[str]) -> None:
        taker = next((s for s in self.command.settings if s.bare), None)
        if self.command.more and self.command.more.parameter == "overrides":
            undeclared += [word for word in words if word.startswith(("~", "+"))]
            words = [word for word in words if not word.startswith(("~", "+"))]
        if not words:
            return
        if taker and taker.bare < 0:
            self.given[taker.word] = tuple(words)
        elif taker and len(words) == 1 and taker.word not in self.given:
            self.given[taker.word] = words[0]
        elif not self.lenient:
            raise UsageError(self._too_many(words, taker))

    def _too_many(self, words: list[str], taker: Setting | None) -> str:
        if taker and all("=" not in word for word in words):
            named = [self.given[taker.word], *words] if taker.word in self.given else words
            return f"{self.path} takes one {taker.word}, not {len(named)}: {' and '.join(named)}"
        word = words[0]
        known = {s.word: s for s in self.command.settings if s.named}
        known |= {s.word: s for s in self.command.more.settings({})} if self.command.more else {}
        if word in known:
            return f"{word} wants a value: write {word}=..., {known[word].allowed()}"
        meant = [f"{s.word}={word}" for s in known.values()
                 if isinstance(s.type, click.Choice) and word in s.type.choices]  # fmt: skip
        hint = (
            f" (did you mean {' or '.join(meant[:NEAREST])}?)"
            if meant
            else suggest(word, known, NEAREST)
        )
        return (
            f"{self.path} has no use for {word!r}{hint}: options are written option=value; "
            f"{self.path} --help lists them"
        )

    def _undeclared(self, words: list[str], own: dict[str, Setting]) -> None:
        more = self.command.more
        known = self._names(own)
        for word in words:
            name = word.partition("=")[0]
            if more and (name in known or more.passes(name)):
                if more.parameter == "overrides":
                    self.overrides.append(word)
            elif not self.lenient:
                also = f", and {more.documented}" if more else ""
                takes = ", ".join([*(f"{s}=" for s in own), *flags_of(self.command)]) or "none"
                raise UsageError(
                    f"{self.path} has no option {name!r}"
                    f"{suggest(name, known, NEAREST)}: it takes {takes}{also}"
                )


def _shown(command: click.Command, ctx: click.Context) -> list[click.Option]:
    params = command.get_params(ctx)
    return [param for param in params if isinstance(param, click.Option) and not param.hidden]


def _metavar(option: click.Option) -> str:
    if option.is_flag:
        return ""
    if isinstance(option, HydraFlag) and option.optional:
        return f" [{'|'.join(option.optional)}]"
    if isinstance(option.type, click.Choice):
        return f" {'|'.join(map(str, option.type.choices))}"
    return f" {option.metavar or allowed(option.type).split()[-1].upper()}"


def _value_items(
    ctx: click.Context, setting: Setting, text: str, several: bool
) -> list[CompletionItem]:
    """Complete the value of a setting; after a comma, or within brackets, the next one."""
    head, listed = "", bool(getattr(setting.type, "listed", False))
    if listed:
        text = text or "["
    if several or (listed and text.startswith("[")):
        cut = max(text.rfind(","), text.rfind("[") if listed else -1) + 1
        head, text = text[:cut], text[cut:]
    taken = head.strip("[").split(",")
    return [
        CompletionItem(
            f"{setting.word}={head}{item.value}",
            type=OPEN if several or listed else item.type,
            help=item.help,
        )
        for item in setting.type.shell_complete(ctx, setting, text)
        if item.value not in taken
    ]


def _name_items(
    settings: Iterable[Setting], given: dict[str, Any], incomplete: str
) -> list[CompletionItem]:
    """Complete the name of a setting; of those with a dot first only what is before it."""
    items: dict[str, CompletionItem] = {}
    for setting in settings:
        if not setting.word.startswith(incomplete) or setting.word in given:
            continue
        group, dot, _ = setting.word.partition(".")
        if dot and len(incomplete) <= len(group):
            items.setdefault(f"{group}.", CompletionItem(f"{group}.", type=OPEN))
        else:
            word = f"{setting.word}="
            items[word] = CompletionItem(word, type=OPEN, help=setting.doc)
    return list(items.values())
