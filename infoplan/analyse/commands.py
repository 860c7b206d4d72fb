"""Commands that make what is missing from the stored results."""

import shlex
from collections.abc import Iterable
from typing import Any

from infoplan.analyse.tables import Selection, changed_options

NOT_OPTIONS = ("terrain.name", "terrain.unit", "terrain.sha256", "numerics_version")
"""Parts of a stored configuration that the command line has no option for, or names otherwise."""

Wanted = tuple[str, float, str]
"""Method, rho and scope of a run."""


def commands(selection: Selection, wanted: Iterable[Wanted]) -> tuple[str, ...]:
    """Commands that make some runs with the options and seeds of the others.

    One run gets its own command; several are part of the paper's whole study, which keeps what is
    there.
    """
    runs = list(dict.fromkeys(wanted))
    if not runs:
        return ()
    if len(runs) == 1:
        return (run_command(selection, *runs[0]),)
    return (study_command(selection),)


def run_command(selection: Selection, method: str, rho: float, scope: str = "batch") -> str:
    """Command that makes one run, ``method`` as in ``UCT-COPOD``."""
    planner, detector = method.lower().split("-")
    options: dict[str, Any] = {"planner": planner, "detector": detector}
    if scope == "historical" and detector == "copod":
        options["detector.scope"] = scope
    options["rho"] = rho
    return _line(["infoplan", "run"], options | _common(selection, detector == "copod"))


def study_command(selection: Selection) -> str:
    """Command that makes the paper's whole study and keeps what is there."""
    common = _common(selection, True)
    return _line(["infoplan", "run", "-m"], {"experiment": "fig5"} | common)


def _common(selection: Selection, copod: bool) -> dict[str, Any]:
    """Options that the runs of a selection share, where they are not the default."""
    options: dict[str, Any] = {}
    if selection.terrain.startswith("file-"):
        options |= {"terrain": "file", "terrain.path": f"{selection.terrain[5:]}.npy"}
    elif selection.terrain != "helens":
        options["terrain"] = selection.terrain
    for flat in selection.options.values():
        for name, value in changed_options(flat).items():
            if name not in NOT_OPTIONS and (copod or not name.startswith("detector.")):
                options[name] = value
    seeds = sorted(set(selection.missions["seed"]))
    count = seeds == list(range(len(seeds)))
    if not (count and len(seeds) == 10):
        options["seeds"] = len(seeds) if count else seeds
    if str(selection.results_dir) != "results":
        options["results_dir"] = selection.results_dir
    return options


def _line(words: list[str], options: dict[str, Any]) -> str:
    return shlex.join([*words, *(f"{name}={_written(value)}" for name, value in options.items())])


def _written(value: Any) -> str:
    """Write a value as Hydra reads it."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{','.join(map(_written, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
