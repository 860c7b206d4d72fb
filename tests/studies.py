"""Small studies: in this process, or as a user starts them, with missions that misbehave."""

import copy
import io
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pandas as pd
import psutil
from rich.console import Console

from infoplan.config import Config, DetectorConfig, TerrainConfig
from infoplan.draw.progress import listener
from infoplan.study.runner import run_study
from infoplan.study.study import Study

CLOCKS = ["plan_seconds", "fit_seconds", "predict_seconds", "detect_seconds"]
SABOTEUR = str(Path(__file__).parent / "study" / "saboteur")

OPTIONS = [
    "detector=none",
    "terrain=volcano",
    "budget=160",
    "grid=[12,12]",
    "planner.iterations=30",
    "model.pilot_iterations=20",
    "model.iterations=2",
]
"""The configuration `quick` on the command line."""


def quick() -> Config:
    """Configure a mission of a tenth of a second, whose workers need not import PyOD."""
    config = Config(budget=160, grid=[12, 12], seeds=1, n_jobs=1, detector=DetectorConfig())
    config.terrain = TerrainConfig(name="volcano")
    config.planner = replace(config.planner, iterations=30)
    config.model = replace(config.model, pilot_iterations=20, iterations=2)
    return config


def study(config: Config, folder: Path, **options: object) -> tuple[Study, str]:
    """Run a study here; returns it and what it said."""
    console = Console(file=io.StringIO(), width=300)
    config = replace(copy.deepcopy(config), results_dir=str(folder), **options)
    done = run_study([config], listener(console))
    return done, console.file.getvalue()


def numbers(folder: Path) -> dict[str, pd.DataFrame]:
    """All tables of a folder, without the times."""
    found = {}
    for path in sorted(folder.rglob("*.parquet")):
        frame = pd.read_parquet(path, partitioning=None)
        found[str(path.relative_to(folder))] = frame.drop(columns=CLOCKS, errors="ignore")
    return found


def assert_same_numbers(one: Path, other: Path) -> None:
    first, second = numbers(one), numbers(other)
    assert first
    assert list(first) == list(second)
    for name, frame in first.items():
        pd.testing.assert_frame_equal(frame, second[name], check_exact=True)


def environment(slow: float = 0.0, sabotage: str = "") -> dict[str, str]:
    """Environment of a process whose missions are slow, or worse."""
    return {**os.environ, "PYTHONPATH": SABOTEUR, "SLOW": str(slow), "SABOTAGE": sabotage}


@contextmanager
def started(folder: Path, *options: str, slow: float = 0.0, sabotage: str = "") -> Iterator:
    """Start the console command in a process group of its own; ended in any case."""
    command = [sys.executable, "-m", "infoplan.cli", "run", *OPTIONS, *options]
    process = subprocess.Popen(
        [*command, f"results_dir={folder}"], env=environment(slow, sabotage), text=True,
        start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        yield process
    finally:
        for one in [*family(process.pid), process]:
            one.kill()
        process.wait()
        process.stdout.close()


def family(pid: int) -> list[psutil.Process]:
    """All living descendants of a process."""
    try:
        children = psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
    return [child for child in children if alive(child)]


def alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def workers(pid: int) -> list[psutil.Process]:
    """Worker processes of a study, loky's or Dask's."""
    found = []
    for process in family(pid):
        try:
            line = " ".join(process.cmdline())
        except (psutil.NoSuchProcess, psutil.ZombieProcess):
            continue
        if "popen_loky" in line or "spawn_main" in line:
            found.append(process)
    return found


def until(condition: Callable[[], object], process: subprocess.Popen | None = None) -> None:
    """Wait for something to become true; at most two minutes, or the life of a process."""
    end = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < end, "it never came true"
        assert process is None or process.poll() is None, process.stdout.read()
        time.sleep(0.02)


def curves(folder: Path) -> list[Path]:
    return sorted(folder.glob("curves/*/*.parquet"))
