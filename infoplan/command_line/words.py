"""The words after a command, sorted to the declarations that they belong to."""

from collections.abc import Iterable, Sequence
from typing import Any

import click

from infoplan.command_line.flags import NEAREST, flags_of, known_flag
from infoplan.command_line.settings import FLAGS, HydraFlag, More, Setting
from infoplan.command_line.types import allowed, either
from infoplan.errors import UsageError
from infoplan.wording import suggest


class Words:
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

    def __init__(
        self,
        settings: Sequence[Setting],
        more: More | None,
        ctx: click.Context,
        args: Sequence[str],
    ):
        self.settings, self.more, self.command = settings, more, ctx.command
        self.path, self.lenient = ctx.command_path, ctx.resilient_parsing
        self.flags: list[str] = []
        self.given: dict[str, Any] = {}
        self.overrides: list[str] = []
        own = {setting.word: setting for setting in settings if setting.named}
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
        more = self.more.settings(self.given) if self.more else []
        return [*own, *(s.word for s in more)]

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
        taker = next((s for s in self.settings if s.bare), None)
        if self.more and self.more.parameter == "overrides":
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
        known = {s.word: s for s in self.settings if s.named}
        known |= {s.word: s for s in self.more.settings({})} if self.more else {}
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
        more = self.more
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
