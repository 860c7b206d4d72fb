"""Real missions of a second or less, stored."""

from collections.abc import Sequence
from pathlib import Path

from infoplan.config import Config, CopodConfig, DetectorConfig, ModelConfig, PlannerConfig
from infoplan.study.identity import identify
from infoplan.study.provenance import provenance
from infoplan.study.runner import Task, fly
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
        planner=PlannerConfig(name=planner, iterations=20),
        detector=detectors.get(detector, DetectorConfig(name=detector)),
        model=ModelConfig(pilot_iterations=20, iterations=2),
        rho=rho,
        budget=budget,
        grid=[12, 14],
    )


def store(results_dir: Path, config: Config, terrain: Terrain, seeds: Sequence[int] = (0,)) -> str:
    """Fly and store missions; returns the run's name."""
    run = identify(config, terrain)
    for seed in seeds:
        outcome = fly(Task(run, seed, 0), None)
        assert outcome.tables, outcome.failure
        footer = {**provenance(), **outcome.footer, "git": None, "command": ["infoplan", "run"]}
        save_mission(results_dir, run, seed, outcome.tables, footer)
    return run.name
