"""Terrains: elevations over a workspace, built in, drawn at random, from a file or a function."""

from infoplan.terrain.helens import fetch_helens, find_helens
from infoplan.terrain.load import (
    TERRAINS,
    TerrainFallbackWarning,
    TerrainValueWarning,
    available,
    load_terrain,
)
from infoplan.terrain.surface import Terrain

__all__ = [
    "TERRAINS",
    "Terrain",
    "TerrainFallbackWarning",
    "TerrainValueWarning",
    "available",
    "fetch_helens",
    "find_helens",
    "load_terrain",
]
