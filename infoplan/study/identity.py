"""What makes two runs the same: the scientific configuration, the map, the code's numbers."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from infoplan.config import (
    METHODS,
    TERRAIN_SCHEMAS,
    MissionConfig,
    OwnTerrainConfig,
    TerrainConfig,
    terrain_kind,
)
from infoplan.errors import RunError, UsageError
from infoplan.methods import complete, method_from_stored, method_label, stored_methods
from infoplan.own import load, resolve_options
from infoplan.terrain import Terrain, find_helens, load_terrain

NUMERICS_VERSION = 1
"""Raised by hand whenever the same configuration and seed give other numbers than before."""

SCHEMA_VERSION = 1
"""Raised by hand whenever a table's columns or their meaning change."""


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
    name = "-".join(
        [
            method_label(resolved.planner),
            method_label(resolved.detector),
            *([] if resolved.model.name == "gp" else [method_label(resolved.model)]),
            terrain.name,
            f"rho{resolved.rho:g}",
            resolved.detector.scope,
            digest(science),
        ]
    )
    return Run(name, resolved, terrain, science)


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
    if config.detector.name in ("none", "best"):
        resolved.detector = replace(config.detector, scope="batch")
    return resolved


def stored_terrains(
    results_dir: Path, path: str | None = None, member: str | None = None
) -> list[Terrain]:
    """Load the maps of stored runs again, those that are to be had here; nothing is downloaded.

    Parameters
    ----------
    results_dir
        The folder that holds ``runs``.
    path, member
        The file, and its name in a ``.zip`` archive, of the runs whose map came from a file; None:
        their maps are left out.

    Returns
    -------
    list of Terrain
        Each has the digest of the run's map: it is that map, in that unit and orientation.

    Raises
    ------
    UsageError
        If `path` leads to the map of no run.
    """
    found: dict[str, Terrain] = {}
    failure = ""
    for file in sorted(results_dir.glob("runs/*.yaml")):
        try:
            science = yaml.safe_load(file.read_text(encoding="utf-8"))
            options = vars(config_from_science(science).terrain)
            digest = science["terrain"]["sha256"]
        except (OSError, ValueError, TypeError, KeyError, RunError, yaml.YAMLError):
            continue  # whoever reads the run says what is wrong with it
        kind = terrain_kind(options["name"])
        if kind == "helens":
            options["path"] = find_helens()
        elif kind == "file":
            options |= {"path": path, "member": member}
        if digest in found or options.get("path", "") is None:
            continue
        try:
            terrain = load_terrain(**options)
        except UsageError as error:
            failure = f": {error}"
            continue
        if terrain.sha256 == digest:
            found[digest] = terrain
    if path is not None and not any(terrain.name.startswith("file-") for terrain in found.values()):
        raise UsageError(
            f"terrain.path={path} leads to the map of no run in {results_dir}{failure}"
        )
    return list(found.values())


def _resolve_terrain(config: TerrainConfig, terrain: Terrain) -> TerrainConfig:
    """Options of the terrain that was loaded: where helens is missing, those of volcano."""
    schema = TERRAIN_SCHEMAS[terrain_kind(terrain.name)]
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
        If an option is missing or unknown: the mapping is of another version.
    """
    options: dict[str, Any] = {}
    try:
        for item in fields(MissionConfig):
            value = options[item.name] = science[item.name]
            if item.name in METHODS:
                options[item.name] = method_from_stored(item.name, value)
            elif is_dataclass(item.type):
                schema: Any = item.type
                if item.name == "terrain":
                    schema = TERRAIN_SCHEMAS[terrain_kind(value["name"])]
                stored = {key: entry for key, entry in value.items() if key != "sha256"}
                absent = {part.name for part in fields(schema)} - {*_whereabouts(schema), *stored}
                if absent:
                    raise KeyError(f"{item.name}.{min(absent)}")
                options[item.name] = schema(**stored)
    except (KeyError, TypeError, AttributeError) as error:
        raise RunError(
            f"the stored configuration does not fit this version of infoplan ({error}): "
            "run it again with this version"
        ) from error
    return MissionConfig(**options)
