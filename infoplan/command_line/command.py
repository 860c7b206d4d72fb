"""Commands whose options are words, ``option=value`` in any order, on top of Click."""

from collections.abc import Callable, Sequence
from typing import Any

import click
from click.shell_completion import CompletionItem

from infoplan.command_line.flags import HELP, NEAREST, known_flag
from infoplan.command_line.items import flag_items, name_items, value_items
from infoplan.command_line.pages import Page, flag_records, show_help_if_asked, write_examples
from infoplan.command_line.settings import FLAGS, GIVEN, More, Setting
from infoplan.command_line.types import OPEN
from infoplan.command_line.words import Words
from infoplan.errors import UsageError
from infoplan.wording import suggest


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
        words = Words(self.settings, self.more, ctx, args)
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
                    return value_items(ctx, setting, text, several)
            return []
        items = []
        for setting in self.settings:
            if setting.bare < 0 or (setting.bare and setting.word not in given):
                taken = given.get(setting.word, ()) if setting.bare < 0 else ()
                found = setting.type.shell_complete(ctx, setting, incomplete)
                items += [item for item in found if item.value not in taken]
        return items + name_items(settings, given, incomplete)


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
