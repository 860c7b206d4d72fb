"""Help pages."""

import os
import shutil
from collections.abc import Iterable, Sequence

import click

from infoplan.command_line.flags import HELP, shown_flags
from infoplan.command_line.settings import GIVEN, HydraFlag
from infoplan.command_line.types import allowed

WIDEST = 100
"""Columns of a page where the terminal is wider; ``COLUMNS`` says otherwise."""


class Page(click.HelpFormatter):
    """A page whose left column leaves room for the right one, however narrow it is."""

    def write_dl(
        self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2
    ) -> None:
        """Write two columns."""
        super().write_dl(list(rows), min(col_max, self.width * 2 // 5), col_spacing)


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


def flag_records(command: click.Command, ctx: click.Context) -> list[tuple[str, str]]:
    """Lines of the help page about a command's flags."""
    return [
        (
            ", ".join(option.opts) + _metavar(option),
            "show this page" if set(option.opts) & set(HELP) else option.help or "",
        )
        for option in shown_flags(command, ctx)
    ]


def _metavar(option: click.Option) -> str:
    if option.is_flag:
        return ""
    if isinstance(option, HydraFlag) and option.optional:
        return f" [{'|'.join(option.optional)}]"
    if isinstance(option.type, click.Choice):
        return f" {'|'.join(map(str, option.type.choices))}"
    return f" {option.metavar or allowed(option.type).split()[-1].upper()}"
