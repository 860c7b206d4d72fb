"""Commands that make what is missing from the stored results."""

import re
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from infoplan.analyse.configurations import Options, changed_options, defaults_of, flatten
from infoplan.analyse.tables import Selection
from infoplan.config import METHODS, TERRAIN_SCHEMAS, GpConfig, TerrainConfig, terrain_kind
from infoplan.method_identity import PAPERS_CHOICES
from infoplan.study.store import inspect
from infoplan.text_options import as_override, typed_text

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


def run_command(
    selection: Selection,
    method: str,
    rho: float,
    scope: str = "batch",
    seeds: Iterable[int] | None = None,
) -> str:
    """Command that makes one run of a method of the paper, as ``UCT-COPOD``.

    Its seeds are those of the selection if none are given.
    """
    planner, detector = PAPERS_CHOICES[method]
    options: dict[str, Any] = {"planner": planner, "detector": detector}
    if scope == "historical" and detector == "copod":
        options["detector.scope"] = scope
    options["rho"] = rho
    return _line(["infoplan", "run"], options | _common(selection, detector == "copod", seeds))


def study_command(selection: Selection) -> str:
    """Command that makes the paper's whole study and keeps what is there."""
    common = _common(selection, True)
    return _line(["infoplan", "run", "-m"], {"experiment": "fig5"} | common)


def _common(
    selection: Selection, copod: bool, of_seeds: Iterable[int] | None = None
) -> dict[str, Any]:
    """Options that the runs of a selection share, where they are not the default."""
    options = _terrain_options(selection)
    for flat in selection.options.values():
        for name, value in (changed_options(flat) | _model_options(flat)).items():
            if name not in NOT_OPTIONS and (copod or not name.startswith("detector.")):
                options[name] = value
    seeds = sorted(set(selection.missions["seed"] if of_seeds is None else of_seeds))
    count = seeds == list(range(len(seeds)))
    if not (count and len(seeds) == 10):
        options["seeds"] = len(seeds) if count else seeds
    if str(selection.results_dir) != "results":
        options["results_dir"] = selection.results_dir
    return options


def _model_options(flat: Options) -> Options:
    """Choose a model that is not the default one, and what it has not as it comes."""
    model = str(flat.get("model.name", GpConfig.name))
    if model == GpConfig.name or model not in METHODS["model"] or "model.function" in flat:
        return {}
    own = {name: value for name, value in flat.items() if name.startswith("model.")}
    default = defaults_of(flat)
    changed = {name: value for name, value in own.items() if value != default.get(name, value)}
    return {"model": model} | changed


def _terrain_options(selection: Selection) -> dict[str, Any]:
    """Options that make the map of a selection; a file's name is a guess where it was not typed."""
    name, unit = selection.terrain, selection.unit
    kind = terrain_kind(name)
    options: dict[str, Any] = {} if kind == "helens" else {"terrain": kind}
    if kind == "file":
        stem = re.sub(r"-turned\d$", "", name.removeprefix("file-")).removesuffix(f"-{unit}")
        options["terrain.path"] = _typed_path(selection) or f"{stem}.npy"
    if f"-{unit}" in name or (kind in ("file", "own", "random_field") and unit != "m"):
        options["terrain.unit"] = unit
    schema = TERRAIN_SCHEMAS.get(kind, TerrainConfig)
    default = flatten({"terrain": asdict(schema())})
    for flat in selection.options.values():
        for option, value in flat.items():
            known = option in default or option.startswith("terrain.options.")
            if known and option not in NOT_OPTIONS and value != default.get(option):
                options[option] = value
    return options


def _line(words: list[str], options: dict[str, Any]) -> str:
    return " ".join([*words, *(as_override(name, value) for name, value in options.items())])


def _typed_path(selection: Selection) -> str | None:
    """Path of the map, as it stands in the command that flew one of the missions."""
    for run, seed in zip(selection.missions["run"], selection.missions["seed"], strict=True):
        footer = inspect(selection.results_dir, run, seed).footer
        for word in footer.command if footer else []:
            name, _, value = word.partition("=")
            if name == "terrain.path" and value:
                return typed_text(name, value)
    return None
