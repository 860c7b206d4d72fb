"""Stored runs by what people call them: the name, the hash at its end, or the beginning of one."""

from collections.abc import Iterable
from pathlib import Path

from infoplan.errors import UsageError
from infoplan.text_options import as_command
from infoplan.wording import counted, harmless, suggest

SHORTEST = 4
"""So many digits of a hash stand for it, if no other begins with them."""

MOST_LISTED = 6
"""So many runs are named in a message at most."""


def stored_runs(results_dir: Path) -> list[str]:
    """List the runs of a folder that have a curve, whole or not, sorted."""
    curves = results_dir.glob("curves/run=*/seed=*.parquet")
    return sorted({path.parent.name.removeprefix("run=") for path in curves})


def find_run(results_dir: Path, text: str) -> str:
    """Find the stored run that a text stands for.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    text
        The run's name, its hash, or the beginning of either that no other run has.

    Returns
    -------
    str
        The name.

    Raises
    ------
    UsageError
        If it stands for none, or for several.
    """
    return choose_run(text, stored_runs(results_dir), results_dir)


def choose_run(text: str, runs: Iterable[str], results_dir: str | Path) -> str:
    """Choose the run that a text stands for; otherwise as `find_run`.

    Parameters
    ----------
    text
        As of `find_run`.
    runs
        Names of all runs that could be meant.
    results_dir
        What holds them, for messages.
    """
    names = sorted(set(runs))
    if not names:
        raise UsageError(
            f"run={text} is not stored in {results_dir}, which holds no finished mission: fly one "
            f"with {as_command('infoplan run', results_dir)}, or name another "
            "results_dir="
        )
    hashes = {name: name.rpartition("-")[2] for name in names}
    exact = [name for name in names if text in (name, hashes[name])]
    begun = [
        name
        for name in names
        if text and (name.startswith(text)
                     or (len(text) >= SHORTEST and hashes[name].startswith(text)))
    ]  # fmt: skip
    found = exact or begun
    if len(found) == 1:
        return found[0]
    if found:
        raise UsageError(
            f"run={text} stands for {counted(len(found), 'run')} in {results_dir}: write more of "
            f"the name, or the hash at its end, of {listed(found, results_dir)}"
        )
    near = suggest(text, [*names, *hashes.values()], 3)
    raise UsageError(
        f"run={text} is not stored in {results_dir}{near}: use {listed(names, results_dir)}; the "
        "hash alone, or the beginning of either, will do"
    )


def listed(runs: list[str], results_dir: str | Path) -> str:
    """Name runs of a folder in a message, a few of many."""
    shown = " or ".join(map(harmless, runs[:MOST_LISTED]))
    more = len(runs) - MOST_LISTED
    if more <= 0:
        return shown
    return f"{shown} or {more} others ({as_command('infoplan status', results_dir)})"
