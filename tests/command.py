"""The console command as a user runs it, and a mission of a second."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

SMALL = [
    "terrain=volcano",
    "budget=160",
    "grid=[12,12]",
    "seeds=1",
    "n_jobs=1",
    "planner.iterations=30",
    "model.pilot_iterations=20",
    "model.iterations=2",
]
"""The same mission on the command line."""


def infoplan(
    *arguments: str, cwd: Path | None = None, env: dict[str, str] | None = None, check: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run the console command as a user does, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "infoplan.cli", *arguments],
        cwd=cwd,
        env={**os.environ, **(env or {})},
        capture_output=True,
        text=True,
        timeout=300,
    )
    if check and done.returncode:
        raise AssertionError(f"status {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done


COMMANDS = (
    "demo|run|replay|survey|next|status|show|figures|claims|explain|leaderboard|report|audit|animate|"
    "terrain"
)


def suggested(output: str) -> list[list[str]]:
    """Command lines that a message suggests, as the words after ``infoplan``.

    Of what follows the command only flags and options are its own, and no mark at the end of what
    is not in quotes.
    """
    plain = r"""[^\s'"`]*[^\s'"`,;:)]"""
    quoted = r"""'[^']*'|"[^"]*\""""
    word = rf"""(?:--?[a-z]+|(?=\S*=|'[^']*=)(?:{quoted}|{plain})+)"""
    line = rf"infoplan (?:{COMMANDS})(?: {word})*"
    return [shlex.split(found)[1:] for found in re.findall(line, output)]
