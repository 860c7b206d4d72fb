"""Replays: a run's trajectory and measurements through another detector or model.

Nothing is planned, so whatever differs between a run and its replay is the detector's or the
model's doing, and not that of where the robot went.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from infoplan.config import Config, MissionConfig
from infoplan.errors import RunError, UsageError
from infoplan.study.executor import carry_out
from infoplan.study.identity import Run, identify, run_name
from infoplan.study.listening import Listener
from infoplan.study.replayed import stand_in
from infoplan.study.run_names import find_run
from infoplan.study.store import inspect, list_missions, prepare
from infoplan.study.study import Study
from infoplan.terrain import Terrain


@dataclass(frozen=True)
class FlownRun:
    """A stored run that is replayed.

    Attributes
    ----------
    name
        The run.
    config, science
        Its configuration, as a record and as it is stored.
    seeds
        Those that are done, ascending.
    """

    name: str
    config: MissionConfig
    science: dict[str, Any]
    seeds: list[int]


def find_flown(results_dir: Path, named: str) -> FlownRun:
    """Find the stored run that a name, a hash, or the beginning of either stands for.

    Raises
    ------
    UsageError
        If there is none, or several.
    RunError
        If its configuration does not fit this version, or none of its missions is whole.
    """
    name = find_run(results_dir, named)
    missions = {seed: inspect(results_dir, name, seed) for seed in list_missions(results_dir)[name]}
    done = {seed: mission for seed, mission in missions.items() if mission.state == "done"}
    if not done:
        broken = next(iter(missions.values()))
        raise RunError(broken.reason or f"{name} has gone meanwhile: run it again")
    footer = next(iter(done.values())).footer
    assert footer is not None
    return FlownRun(name, footer.config, footer.configuration, list(done))


def identify_replay(source: FlownRun, config: MissionConfig) -> Run:
    """Name the replay of a run: ``replay-...``, a hash over the source's name, too.

    `Run.science` gets the key ``replay``, the name of the run that was flown. The terrain is known
    by name and digest alone: its elevations come from the tables.
    """
    stored = source.science["terrain"]
    unknown = np.full((2, 2), np.nan)
    terrain = Terrain(
        stored["name"], unknown, tuple(stored["extent"]), stored["unit"], stored["sha256"]
    )
    # Whatever has become of a planner of the user's own: its trajectory is the stored one.
    run = identify(
        replace(config, terrain=MissionConfig().terrain, planner=stand_in(config)), terrain
    )
    kept = {"terrain": stored, "replay": source.science.get("replay", source.name)}
    planner = {**source.science["planner"], "smoothing": config.planner.smoothing}
    science = {**run.science, "planner": planner, **kept}
    resolved = replace(run.config, terrain=source.config.terrain, planner=config.planner)
    return Run(run_name(science), resolved, terrain, science)


def replay_study(
    results_dir: Path,
    source: FlownRun,
    config: Config,
    seeds: Sequence[int] | None,
    listener: Listener,
) -> Study:
    """Replay the stored missions of a run, and store the tables as those of a run of its own.

    Parameters
    ----------
    results_dir
        Where the run's tables are, and the replay's go.
    source
        The run.
    config
        The source's, with another detector or model, valid; and how to run it.
    seeds
        Which; None: all that are done.
    listener
        Is told of warnings and progress.

    Returns
    -------
    Study
        Of one run, the replay.

    Raises
    ------
    UsageError
        If a seed is not there.
    RunError
        If a table cannot be written, or the pool is lost.
    """
    run = identify_replay(source, config)
    wanted = source.seeds if seeds is None else seeds
    stored = set(source.seeds)
    # The first will do: a count may stand for a thousand million of them.
    if (missing := next((seed for seed in wanted if seed not in stored), None)) is not None:
        raise UsageError(
            f"seed {missing} of {source.name} is not stored: use some of {source.seeds}, or fly it "
            "first"
        )
    prepare(results_dir)
    study = Study([run.name], [(run, list(wanted))], results_dir, flown=source.name)
    study.look()
    carry_out(study, config, listener)
    return study
