"""Completion in bash, zsh and fish: the scripts that shells read, and answers to their questions.

A script hands over the line up to the cursor in ``COMP_LINE``; Click finds the command, which
completes the last word.
"""

import os
import re
import sys
from dataclasses import dataclass

import click
from click.shell_completion import CompletionItem, ShellComplete

from infoplan.command_line.types import OPEN
from infoplan.errors import UsageError
from infoplan.wording import harmless, suggest

ACTIONS = ("install", "uninstall", "query")

BASH = """\
_infoplan_completion() {
    local line="${COMP_LINE:0:COMP_POINT}" reply
    COMPREPLY=()
    while IFS= read -r reply; do
        COMPREPLY+=("$reply")
    done < <(COMP_LINE="$line" COMP_POINT=${#line} COMP_WORDBREAKS="$COMP_WORDBREAKS" \\
        "${1/#\\~/$HOME}" -sc query=bash 2>/dev/null)
}
complete -o nospace -F _infoplan_completion infoplan
"""

ZSH = """\
_infoplan_completion() {
    local word about ending
    local -a open shown finished told
    while IFS=$'\\t' read -r ending word about; do
        if [[ $ending == open ]]; then
            open+=("$word") shown+=("$word${about:+  -- $about}")
        else
            finished+=("$word") told+=("$word${about:+  -- $about}")
        fi
    done < <(COMP_LINE="${(j: :)words[1,CURRENT-1]} $IPREFIX$QIPREFIX$PREFIX" COMP_POINT= \\
        ${~words[1]} -sc query=zsh 2>/dev/null)
    (( $#open )) && compadd -l -S '' -d shown -a open
    (( $#finished )) && compadd -l -d told -a finished
}
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
compdef _infoplan_completion infoplan
"""

FISH = """\
function __infoplan_completion
    set -l words (commandline -opc)
    COMP_LINE=(commandline -cp | string collect) COMP_POINT= $words[1] -sc query=fish 2>/dev/null
end
complete -c infoplan -f -k -a '(__infoplan_completion)'
"""

OFF = {
    "bash": "complete -r infoplan; unset -f _infoplan_completion\n",
    "zsh": "compdef -d infoplan; unfunction _infoplan_completion\n",
    "fish": "complete -c infoplan -e; functions -e __infoplan_completion\n",
}
"""What takes the completion out of a shell again."""


@dataclass
class TypedLine:
    """A command line up to the cursor, read as a shell does.

    Attributes
    ----------
    words
        Those before the last one.
    last
        The one that is being typed, quotes and backslashes resolved.
    start
        Where in `last` the shell's own word begins: bash begins anew after some characters.
    quote
        The quotation mark that is still open; empty if none is.
    """

    words: list[str]
    last: str = ""
    start: int = 0
    quote: str = ""


def read_line(text: str, breaks: str = "") -> TypedLine:
    """Read a line up to the cursor; after ``;``, ``|`` or ``&`` a new command begins.

    Parameters
    ----------
    text
        The line.
    breaks
        Characters after which the shell begins a new word of its own.
    """
    line, within, escaped = TypedLine([]), False, False
    for character in text:
        if escaped:
            line.last += character
            escaped = False
        elif character == "\\" and line.quote != "'":
            escaped = within = True
        elif line.quote:
            if character == line.quote:
                line.quote = ""
            else:
                line.last += character
        elif character in "'\"":
            line.quote, within = character, True
            line.start = len(line.last)
        elif character.isspace():
            if within:
                line.words.append(line.last)
            line.last, line.start, within = "", 0, False
        else:
            line.last += character
            within = True
            if character in breaks:
                line.start = len(line.last)
    return line


class _Shell(ShellComplete):
    """What the three shells have in common."""

    def __init__(self, cli: click.Command):
        super().__init__(cli, {}, "infoplan", "_INFOPLAN_COMPLETE")
        text = os.environ.get("COMP_LINE", "")
        if (point := os.environ.get("COMP_POINT", "")).isdigit():
            text = text[: int(point)]
        self.line = read_line(text, self.breaks())

    def get_completion_args(self) -> tuple[list[str], str]:
        """Give the words after the command, and the one that is being typed."""
        return self.line.words[1:], self.line.last

    def complete(self) -> str:
        """Answer: a line for each completion."""
        items = [
            item
            for item in self.get_completions(*self.get_completion_args())
            if harmless(item.value) == item.value and item.value.startswith(self.line.last)
        ]
        return "".join(f"{self.format_completion(item)}\n" for item in items)

    def breaks(self) -> str:
        """Characters after which the shell begins a new word of its own."""
        return ""


class Bash(_Shell):
    """Bash replaces what follows the last of its break characters, and quotes nothing."""

    name, source_template = "bash", BASH

    def breaks(self) -> str:
        """Characters after which the shell begins a new word of its own."""
        return os.environ.get("COMP_WORDBREAKS", "")

    def format_completion(self, item: CompletionItem) -> str:
        """Give the rest of the word, and a space if it is finished."""
        rest = str(item.value)[self.line.start :]
        space = "" if item.type == OPEN else " "
        if self.line.quote:
            return rest + (self.line.quote + space if space else "")
        return re.sub(r"([\s\\'\"`$&|;<>()*?!#])", r"\\\1", rest) + space


class Zsh(_Shell):
    """Zsh quotes by itself, and shows what a completion is."""

    name, source_template = "zsh", ZSH

    def format_completion(self, item: CompletionItem) -> str:
        """Give how it ends, the word, and what it is."""
        return f"{item.type}\t{item.value}\t{item.help or ''}"


class Fish(_Shell):
    """Fish quotes by itself, and shows what a completion is."""

    name, source_template = "fish", FISH

    def format_completion(self, item: CompletionItem) -> str:
        """Give the word, and what it is."""
        return f"{item.value}\t{item.help or ''}".rstrip("\t")


SHELLS: dict[str, type[_Shell]] = {shell.name: shell for shell in (Bash, Zsh, Fish)}


def serve(cli: click.Command, text: str) -> None:
    """Print a shell's script, or the answer to its question.

    Parameters
    ----------
    cli
        The command line.
    text
        ``install=bash`` and the like; the shell may be left out where ``SHELL`` names it.

    Raises
    ------
    UsageError
        If it is something else.
    """
    action, _, name = text.partition("=")
    name = name or os.path.basename(os.environ.get("SHELL", ""))
    if action not in ACTIONS or name not in SHELLS:
        near = suggest(action, ACTIONS) if action not in ACTIONS else suggest(name, SHELLS)
        raise UsageError(
            f"-sc {text} is not possible{near}: use install=, uninstall= or query= with "
            f'{", ".join(SHELLS)}, as in eval "$(infoplan -sc install=bash)"'
        )
    if action == "install":
        sys.stdout.write(SHELLS[name].source_template)
    elif action == "uninstall":
        sys.stdout.write(OFF[name])
    else:
        sys.stdout.write(SHELLS[name](cli).complete())
