"""What makes two runs the same: the scientific configuration, the map, the code's numbers."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import Any

from infoplan.config import (
    METHODS,
    STORED_TERRAINS,
    MissionConfig,
    OwnTerrainConfig,
    TerrainConfig,
    is_survey,
    terrain_kind,
    validate,
)
from infoplan.errors import RunError
from infoplan.methods import complete, method_from_stored, stored_methods
from infoplan.obstacles import obstacles_of
from infoplan.options import check_options, walk
from infoplan.own import fits, in_words, load, resolve_options
from infoplan.study.terms import as_meant, as_stored
from infoplan.tables import MAX_ROWS
from infoplan.terrain import Terrain

NUMERICS_VERSION = 1
"""Raised by hand whenever the same configuration and seed give other numbers than before."""


@dataclass(frozen=True)
class Run:
    """One configuration on one map, without its seeds.

    Attributes
    ----------
    name
        Readable and unique: planner, detector, terrain, rho, scope, and a hash of `science`.
    config
        The resolved configuration: the terrain that was really loaded, the scope that counts.
    terrain
        The map.
    science
        Nested mapping of all that decides the numbers; what ``runs/<run>.yaml`` holds.
    """

    name: str
    config: MissionConfig
    terrain: Terrain
    science: dict[str, Any]


def identify(config: MissionConfig, terrain: Terrain) -> Run:
    """Resolve a configuration on the terrain that was loaded for it, and name the run."""
    resolved = resolve(config, terrain)
    science: dict[str, Any] = asdict(resolved) | stored_methods(resolved)
    for irrelevant in _whereabouts(resolved.terrain):
        del science["terrain"][irrelevant]
    science["terrain"]["sha256"] = terrain.sha256
    science["numerics_version"] = NUMERICS_VERSION
    science = as_stored(science)
    return Run(run_name(science), resolved, terrain, science)


def run_name(science: Mapping[str, Any]) -> str:
    """Name a run by its `science`; that of a replay begins with ``replay-``.

    That of a survey has its log's name in place of the planner's.
    """
    model, place = science["model"]["name"], science["terrain"]["name"]
    flown = not is_survey(place)
    return "-".join(
        [
            *(["replay"] if "replay" in science else []),
            *([science["planner"]["name"]] if flown else [place]),
            science["detector"]["name"],
            *([] if model == "gp" else [model]),
            *([science["fault"]["name"]] if "fault" in science else []),
            *([place, f"rho{science['rho']:g}"] if flown else []),
            science["detector"]["scope"],
            digest(science),
        ]
    )


def digest(science: Mapping[str, Any]) -> str:
    """Eight hex digits that stand for a run's `science`, the end of its name."""
    return hashlib.sha256(json.dumps(science, sort_keys=True).encode()).hexdigest()[:8]


def resolve(config: MissionConfig, terrain: Terrain) -> MissionConfig:
    """Reduce a configuration to its science, with the terrain that was really loaded.

    The detectors none and best judge a sample the same whenever they see it, so both scopes give
    the same mission: it is always called ``batch``.
    """
    science = {item.name: getattr(config, item.name) for item in fields(MissionConfig)}
    resolved = complete(MissionConfig(**science))
    resolved.terrain = _resolve_terrain(config.terrain, terrain)
    if terrain.obstacles.polygons:
        from infoplan.simulator import pilot_path  # imports SciPy and Numba

        pilot_path(config, terrain)  # refuses one that meets an obstacle
    if config.detector.name in ("none", "best"):
        resolved.detector = replace(config.detector, scope="batch")
    return resolved


def _resolve_terrain(config: TerrainConfig, terrain: Terrain) -> TerrainConfig:
    """Options of the terrain that was loaded: where helens is missing, those of volcano."""
    schema = STORED_TERRAINS[terrain_kind(terrain.name)]
    resolved = schema(
        **{
            item.name: getattr(config, item.name)
            for item in fields(schema)
            if hasattr(config, item.name)
        }
    )
    resolved.name = terrain.name
    resolved.extent = list(terrain.extent)
    resolved.unit = terrain.unit
    resolved.obstacles = [polygon.tolist() for polygon in terrain.obstacles.polygons]
    resolved.obstacles_mask = None
    if isinstance(resolved, OwnTerrainConfig) and resolved.function is not None:
        resolved.options = resolve_options(load(resolved.function), resolved.options)
    return resolved


def _whereabouts(schema: Any) -> list[str]:
    """Options that say where something is found, and not what it is."""
    return [item.name for item in fields(schema) if not item.metadata.get("science", True)]


def config_from_science(science: Mapping[str, Any]) -> MissionConfig:
    """Read a run's `science` back into the configuration it was made from.

    Parameters
    ----------
    science
        What ``runs/<run>.yaml`` holds.

    Returns
    -------
    MissionConfig
        Equal to `Run.config`, except that where the map was found is not stored and is the default.

    Raises
    ------
    RunError
        If an option is missing, unknown, or of another type, range or size than it may have.
    """
    try:
        return restored(science)
    except ValueError as error:
        raise RunError(
            f"the stored configuration does not fit this version of infoplan ({error}): "
            "run it again with this version"
        ) from error


def restored(science: Mapping[str, Any]) -> MissionConfig:
    """Do as `config_from_science`, and raise a ValueError that says what does not fit."""
    options: dict[str, Any] = {}
    try:
        science = as_meant(science)
        for item in fields(MissionConfig):
            value = options[item.name] = science[item.name]
            if item.name in METHODS:
                options[item.name] = method_from_stored(item.name, value)
            elif is_dataclass(item.type):
                schema: Any = item.type
                if item.name == "terrain":
                    schema = STORED_TERRAINS[terrain_kind(value["name"])]
                stored = {key: entry for key, entry in value.items() if key != "sha256"}
                absent = {part.name for part in fields(schema)} - {*_whereabouts(schema), *stored}
                if absent:
                    raise KeyError(f"{item.name}.{min(absent)}")
                options[item.name] = schema(**stored)
        config = MissionConfig(**options)
        _demand_types(config, science)
        _demand_ranges(config)
    except KeyError as error:
        raise ValueError(f"{error.args[0]} is missing or unknown") from error
    except (TypeError, AttributeError) as error:
        raise ValueError(error) from error
    return config


def _demand_types(config: MissionConfig, science: Mapping[str, Any]) -> None:
    """Check the type of every option, and of what a configuration holds besides."""
    for name, value, metadata in walk(config):
        if not fits(value, metadata["type"]):
            raise TypeError(f"{name} must be {in_words(metadata['type'])}")
    besides = {
        "numerics_version": (science["numerics_version"], int),
        "terrain.sha256": (science["terrain"]["sha256"], str),
        "replay": (science.get("replay"), str | None),
        **{f"{group}.sha256": (science[group].get("sha256"), str | None) for group in METHODS},
    }
    for name, (value, kind) in besides.items():
        if not fits(value, kind):
            raise TypeError(f"{name} must be {in_words(kind)}")


def _demand_ranges(config: MissionConfig) -> None:
    """Check the bounds of every option, and sizes beyond which nothing could have been flown."""
    terrain = config.terrain
    check_options(replace(terrain, name=terrain_kind(terrain.name)), "terrain.")
    # Of the stored terrain no file is known, which a terrain that is to be loaded needs.
    validate(replace(config, terrain=replace(TerrainConfig(), extent=terrain.extent)))
    obstacles_of(terrain.obstacles)
    if max(config.budget, math.prod(config.grid)) > MAX_ROWS:
        raise ValueError(f"budget and nodes of the grid must be at most {MAX_ROWS}")
