"""Fixtures that all tests share: a small map, a small mission, the command line."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from infoplan.config import Config, TerrainConfig
from infoplan.terrain import Terrain, load_terrain

# Workers of pytest-xdist have a width of 80, for which tables are laid out; pipes have none.
os.environ.pop("COLUMNS", None)

# In a shell's background, or by nohup, tests would ignore the signals that they are about.
for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

# The first example may compile kernels, and a loaded machine is no fault.
settings.register_profile("infoplan", deadline=None)
settings.load_profile("infoplan")


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
