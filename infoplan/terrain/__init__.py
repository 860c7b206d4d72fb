"""Terrains: elevations over a workspace, from the paper's grid, built-in surfaces or a file."""

from infoplan.terrain.helens import fetch_helens, find_helens
from infoplan.terrain.load import TERRAINS, TerrainFallbackWarning, load_terrain
from infoplan.terrain.surface import Terrain

__all__ = [
    "TERRAINS",
    "Terrain",
    "TerrainFallbackWarning",
    "fetch_helens",
    "find_helens",
    "load_terrain",
]
