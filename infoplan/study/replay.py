"""``infoplan replay``: a run's trajectory and measurements through another detector or model.

Nothing is planned, so whatever differs between a run and its replay is the detector's or the
model's doing, and not that of where the robot went.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from infoplan.caches import kernel_note
from infoplan.config import MissionConfig, TreeSearchConfig, validate
from infoplan.culprit import culprit_named
from infoplan.errors import RunError, UsageError
from infoplan.hydra_front import compose
from infoplan.mission import CurveRow, Mission, Samples
from infoplan.study.flight import Outcome, Task, failed
from infoplan.study.identity import Run, identify, run_name
from infoplan.study.locks import Lock, NoLocksError, acquire, no_locks
from infoplan.study.provenance import git_state, provenance
from infoplan.study.run_names import find_run
from infoplan.study.store import (
    build_tables,
    inspect,
    list_missions,
    prepare,
    read_table,
    save_failure,
    save_mission,
)
from infoplan.terrain import Terrain
from infoplan.threads import look_again, one_thread
from infoplan.trust import admit
from infoplan.wording import figure

GROUPS = ("detector", "model")
"""Groups that a replay may choose anew."""

OPTIONS = ("planner.smoothing",)
"""Further options that change what is told of a mission, and not its trajectory."""


@dataclass(frozen=True)
class Source:
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


@dataclass
class Replay:
    """What `replay_run` did: the new run, its source, what was computed.

    Attributes
    ----------
    run, source
        The replay and what was flown.
    seeds
        Those that are done, before or now.
    computed, failed
        Number of missions replayed now, and of those that broke down.
    seconds
        Wall time.
    """

    run: Run
    source: Source
    seeds: list[int]
    computed: int = 0
    failed: int = 0
    seconds: float = 0.0


def find_source(results_dir: Path, named: str) -> Source:
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
    return Source(name, footer.config, footer.configuration, list(done))


def reconfigure(config: MissionConfig, overrides: Sequence[str]) -> MissionConfig:
    """Put another detector, scope or model into a stored configuration.

    Parameters
    ----------
    config
        The source's.
    overrides
        Hydra's: ``detector=...`` or ``model=...`` chooses anew, with that choice's defaults;
        ``detector.*``, ``model.*`` and ``planner.smoothing`` change an option, and all else stays.

    Returns
    -------
    MissionConfig
        Valid.

    Raises
    ------
    UsageError
        If an override would change anything else, is unknown or has no possible value.
    """
    names = [_replayable(override) for override in overrides]
    chosen = [f"{group}={getattr(config, group).name}" for group in ("planner", *GROUPS)]
    kept = [choice for choice in chosen if choice.partition("=")[0] not in names]
    composed = compose([*kept, *overrides])
    parts: dict[str, Any] = {"planner": config.planner, "detector": config.detector,
                             "model": config.model}  # fmt: skip
    parts |= {group: getattr(composed, group) for group in GROUPS if group in names}
    for name in names:
        group, _, rest = name.partition(".")
        if not rest or group in names:
            continue
        option = rest.partition(".")[0]
        value = getattr(getattr(composed, group), option)
        if isinstance(value, dict):
            value = {**getattr(parts[group], option), **value}
        parts[group] = replace(parts[group], **{option: value})
    changed = replace(config, **parts)
    # Of the stored terrain no file is known, which a terrain that is to be loaded needs.
    validate(
        replace(changed, terrain=replace(MissionConfig().terrain, extent=config.terrain.extent))
    )
    return changed


def _replayable(override: str) -> str:
    """Name what an override changes, if that is open to a replay."""
    try:
        parsed = OverridesParser.create().parse_override(override)
    except HydraException as error:
        raise UsageError(
            f"the override {override!r} cannot be read: write option=value, like detector=best"
        ) from error
    name = parsed.key_or_group
    if parsed.is_delete() or (name.split(".")[0] not in GROUPS and name not in OPTIONS):
        raise UsageError(
            f"{override} is not open to a replay, which keeps trajectory and measurements: change "
            "detector, model, their options or planner.smoothing, or fly it with infoplan run"
        )
    if parsed.is_sweep_override():
        raise UsageError(f"{override} has several values: a replay takes one, so replay for each")
    return name


def _named_functions(overrides: Sequence[str]) -> set[str]:
    """List the groups whose function is named by an override."""
    names = map(_replayable, overrides)
    return {name.partition(".")[0] for name in names if name.endswith(".function")}


def identify_replay(source: Source, config: MissionConfig) -> Run:
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


def replay_mission(
    config: MissionConfig, terrain: Terrain, seed: int, samples: pd.DataFrame, maps: pd.DataFrame
) -> tuple[Mission, list[CurveRow]]:
    """Give a mission the stored samples, epoch by epoch, and evaluate it after each.

    Parameters
    ----------
    config, terrain, seed
        As of `Mission`; of the terrain only the extent counts.
    samples, maps
        Tables of the mission that was flown; the map's truth is what predictions are scored by.

    Returns
    -------
    mission : Mission
    rows : list of CurveRow
        After the pilot and after each epoch.
    """
    # Nobody plans: a planner of the user's own need not be there any more.
    config = replace(config, planner=stand_in(config))
    mission = Mission(config, terrain, seed)
    mission.grid_truth = maps["truth"].to_numpy(dtype=np.float64)
    n = len(samples)
    stored = Samples(
        epoch=samples["epoch"].to_numpy(dtype=np.int64),
        x=samples[["x1", "x2"]].to_numpy(dtype=np.float64),
        flagged=np.zeros(n, dtype=bool),
        score=np.full(n, np.nan),
        **{name: samples[name].to_numpy() for name in ("heading", "truth", "measured",
                                                       "is_outlier")},
    )  # fmt: skip
    rows = []
    for mission.epoch in range(int(stored.epoch[-1]) + 1):
        batch = stored[stored.epoch == mission.epoch]
        with culprit_named(config, f"in epoch {mission.epoch}"):
            if mission.epoch:
                mission.observe(batch)
            else:
                mission.start(batch)
            rows.append(mission.evaluate())
    return mission, rows


def stand_in(config: MissionConfig) -> TreeSearchConfig:
    """Planner that keeps what a mission reads of a planner's options."""
    return TreeSearchConfig(smoothing=config.planner.smoothing)


def replay_run(
    results_dir: Path,
    named: str,
    overrides: Sequence[str],
    *,
    seeds: Sequence[int] | None = None,
    n_jobs: int = -1,
    resume: bool = True,
    trust: bool = False,
    tell: Callable[[str], object] = print,
) -> Replay:
    """Replay the stored missions of a run, and store the tables as those of a run of its own.

    Parameters
    ----------
    results_dir
        Where the run's tables are, and the replay's go.
    named
        The run, or its hash.
    overrides
        As of `reconfigure`.
    seeds
        Which; None: all that are done.
    n_jobs
        Missions at a time; -1: one a core.
    resume
        Keep what has been replayed already.
    trust
        Whether a detector's or model's function that the stored run names may be imported; one
        that an override names may.
    tell
        Is given a line for each function that is imported, and each mission that is done.

    Returns
    -------
    Replay

    Raises
    ------
    UsageError
        If the run or a seed is not there, an override is not possible, or a function that the run
        names is not to be trusted.
    RunError
        If a table cannot be written, or no mission of the run is whole.
    """
    from joblib import Parallel, delayed, parallel_config

    source = find_source(results_dir, named)
    config = reconfigure(source.config, overrides)
    admit(config, source.science, _named_functions(overrides), trust, tell)
    run = identify_replay(source, config)
    wanted = source.seeds if seeds is None else seeds
    stored = set(source.seeds)
    # The first will do: a count may stand for a thousand million of them.
    if (missing := next((seed for seed in wanted if seed not in stored), None)) is not None:
        raise UsageError(
            f"seed {missing} of {source.name} is not stored: use some of {source.seeds}, or fly it "
            "with infoplan run"
        )
    if n_jobs == 0:
        raise UsageError("n_jobs=0 runs nothing: give a number of workers, or -1 for all cores")
    prepare(results_dir)
    if note := kernel_note():
        tell(f"WARNING: {note}")
    todo = [
        seed
        for seed in wanted
        if not (resume and inspect(results_dir, run.name, seed).state == "done")
    ]
    start = time.monotonic()
    replayed = Replay(run, source, [seed for seed in wanted if seed not in todo])
    with (
        parallel_config(backend="loky", n_jobs=n_jobs, inner_max_num_threads=1),
        _locked(results_dir, run.name, todo, tell) as mine,
    ):
        for seed in sorted(set(todo) - set(mine)):
            tell(f"{run.name} seed {seed}  is being replayed by another infoplan")
        tasks = [Task(run, seed, number) for number, seed in enumerate(mine)]
        pool = Parallel(return_as="generator_unordered", batch_size=1)
        for outcome in pool(delayed(_replay_seed)(results_dir, source.name, t) for t in tasks):
            _store(results_dir, outcome, replayed, tell)
    replayed.seeds.sort()
    replayed.seconds = time.monotonic() - start
    return replayed


@contextmanager
def _locked(
    results_dir: Path, run: str, seeds: Sequence[int], tell: Callable[[str], object]
) -> Iterator[list[int]]:
    """Hold the locks of missions; gives those that no other process holds."""
    locks: dict[int, Lock | None] = {}
    for seed in seeds:
        try:
            lock = acquire(results_dir, run, seed)
        except NoLocksError as error:
            if None not in locks.values():
                tell(f"WARNING: {no_locks(results_dir, error)}")
            locks[seed] = None
        else:
            if lock:
                locks[seed] = lock
    try:
        yield list(locks)
    finally:
        for lock in locks.values():
            if lock:
                lock.release()


def _store(
    results_dir: Path, outcome: Outcome, replayed: Replay, tell: Callable[[str], object]
) -> None:
    """Store what a replay gave, or why it failed."""
    run, seed, tables = outcome.task.run, outcome.task.seed, outcome.tables
    label = f"{run.name} seed {seed}"
    if tables is None:
        path = save_failure(results_dir, run.name, seed, f"{label}\n\n{outcome.failure}")
        replayed.failed += 1
        tell(f"{label}  FAILED: {outcome.reason} ({path})")
        return
    footer = outcome.footer | {"command": sys.orig_argv, "git": git_state()}
    save_mission(results_dir, run, seed, tables, footer)
    replayed.computed += 1
    replayed.seeds.append(seed)
    tell(f"{label}  RMSE {figure(tables.curves['rmse'][-1].as_py())} {run.terrain.unit}")


def _replay_seed(results_dir: Path, source: str, task: Task) -> Outcome:
    """Replay one mission in a worker."""
    run, started, clock = task.run, datetime.now(UTC), time.perf_counter()
    try:
        samples, maps = (
            read_table(results_dir, name, source, task.seed).to_pandas()
            for name in ("samples", "maps")
        )
        look_again()
        with one_thread():
            mission, rows = replay_mission(run.config, run.terrain, task.seed, samples, maps)
            tables = build_tables(run, mission, rows)
            footer = provenance() | {
                "started": started.isoformat(timespec="milliseconds"),
                "ended": datetime.now(UTC).isoformat(timespec="milliseconds"),
                "seconds": time.perf_counter() - clock,
            }
    except (Exception, SystemExit) as error:  # a method of the user's may call sys.exit
        return failed(task, error)
    return Outcome(task, time.perf_counter() - clock, tables, footer)
