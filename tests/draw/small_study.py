"""The paper's study in small: all its runs, on the volcano, stored in seconds."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from flown import tables_of

from infoplan.config import Config, CopodConfig, DetectorConfig, TerrainConfig
from infoplan.study.identity import identify
from infoplan.study.store import save_mission
from infoplan.terrain import load_terrain

METHODS = (("uct", "none"), ("uct", "best"), ("uct", "copod"), ("puct", "copod"))
RUNS = [
    *((*method, rho, "batch") for method, rho in itertools.product(METHODS, (0.05, 0.1, 0.15))),
    ("uct", "copod", 0.1, "historical"),
    ("puct", "copod", 0.1, "historical"),
]
"""Planner, detector, rho and scope of every run of Fig. 5."""


def store(folder: Path, runs: Iterable[tuple] = RUNS, seeds: Sequence[int] = (0, 1)) -> None:
    """Fly and store missions of a tenth of a second each."""
    volcano = load_terrain("volcano")
    config = Config(budget=200, grid=[12, 14], terrain=TerrainConfig(name="volcano"))
    config.model = replace(config.model, pilot_iterations=10, iterations=1)
    for planner, detector, rho, scope in runs:
        options = CopodConfig(scope=scope) if detector == "copod" else DetectorConfig(detector)
        search = replace(config.planner, name=planner, iterations=20)
        run = identify(replace(config, planner=search, detector=options, rho=rho), volcano)
        for seed in seeds:
            save_mission(folder, run, seed, tables_of(run, seed), {})
