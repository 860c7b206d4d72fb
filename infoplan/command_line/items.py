"""What the shell offers for the last word of a line."""

from collections.abc import Iterable
from typing import Any

import click
from click.shell_completion import CompletionItem

from infoplan.command_line.flags import shown_flags
from infoplan.command_line.settings import FLAGS, Setting
from infoplan.command_line.types import OPEN


def flag_items(command: click.Command, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Complete a flag that was not given yet."""
    given = set(ctx.meta.get(FLAGS, []))
    return [
        CompletionItem(written, help=option.help)
        for option in shown_flags(command, ctx)
        if not given & set(option.opts)
        for written in option.opts
        if written.startswith(incomplete)
        and (written.startswith("--") or not incomplete.startswith("--"))
    ]


def value_items(
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


def name_items(
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
