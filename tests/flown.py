"""Real missions of a second or less, stored."""

from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from infoplan.config import (
    Config,
    CopodConfig,
    DetectorConfig,
    GpConfig,
    MissionConfig,
    TreeSearchConfig,
)
from infoplan.mission import explore
from infoplan.scoring import State
from infoplan.simulator import Simulator
from infoplan.study.identity import Run, identify
from infoplan.study.mission_tables import MissionTables, build_tables
from infoplan.study.provenance import provenance
from infoplan.study.store import save_mission
from infoplan.terrain import Terrain


def short_mission(
    planner: str = "puct",
    detector: str = "copod",
    scope: str = "batch",
    rho: float = 0.1,
    budget: int = 200,
) -> Config:
    detectors = {"copod": CopodConfig(scope=scope)}
    return Config(
        planner=TreeSearchConfig(name=planner, iterations=20),
        detector=detectors.get(detector, DetectorConfig(name=detector)),
        model=GpConfig(pilot_iterations=20, iterations=2),
        rho=rho,
        budget=budget,
        grid=[12, 14],
    )


def fly(config: MissionConfig, terrain: Terrain, seed: int = 0) -> list[State]:
    """Fly a mission in the simulator."""
    with threadpool_limits(limits=1):
        return list(explore(config, Simulator(config, terrain, seed), seed))


def tables_of(run: Run, seed: int) -> MissionTables:
    """Fly a mission of a run and lay its tables out."""
    states = fly(run.config, run.terrain, seed)
    return build_tables(run, seed, [state.row for state in states], states[-1])


def store(results_dir: Path, config: Config, terrain: Terrain, seeds: Sequence[int] = (0,)) -> str:
    """Fly and store missions; returns the run's name."""
    run = identify(config, terrain)
    for seed in seeds:
        tables = tables_of(run, seed)
        footer = {
            **provenance(),
            "started": f"2030-01-02T03:04:0{seed}.000+00:00",
            "ended": f"2030-01-02T03:05:0{seed}.000+00:00",
            "seconds": 60.0,
            "git": {"commit": "0" * 40, "dirty": False},
            "command": ["/usr/bin/python3", "/usr/bin/infoplan", "run"],
        }
        save_mission(results_dir, run, seed, tables, footer)
    return run.name
