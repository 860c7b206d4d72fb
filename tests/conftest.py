"""Fixtures that all tests share: a small map, a small mission, the command line."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoplan.config import Config, TerrainConfig
from infoplan.terrain import Terrain, load_terrain


@pytest.fixture(scope="session")
def volcano() -> Terrain:
    return load_terrain("volcano")


@pytest.fixture(scope="session")
def hills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small map in a file, the terrain of most short missions."""
    y, x = np.mgrid[0:1:30j, 0:1:30j]
    path = tmp_path_factory.mktemp("maps") / "hills.npy"
    np.save(path, 800 * np.exp(-8 * ((x - 0.6) ** 2 + (y - 0.5) ** 2)) + 100 * np.sin(9 * x * y))
    return path


@pytest.fixture
def small() -> Config:
    """A mission of a second or less."""
    config = Config(budget=160, grid=[12, 12], seeds=1, n_jobs=1)
    config.terrain = TerrainConfig(name="volcano")
    config.planner = replace(config.planner, iterations=30)
    config.model = replace(config.model, pilot_iterations=20, iterations=2)
    return config


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
