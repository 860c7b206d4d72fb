"""From configurations to a study that is carried out."""

import warnings
from collections.abc import Iterable, Sequence

from infoplan.config import Config, TerrainConfig, seed_list, validate
from infoplan.errors import UsageError
from infoplan.files import user_path
from infoplan.mission_cost import check_mission
from infoplan.study.estimate import learn
from infoplan.study.executor import carry_out
from infoplan.study.identity import Run, identify
from infoplan.study.limits import check_count
from infoplan.study.listening import Listener, Say
from infoplan.study.store import prepare
from infoplan.study.study import Study
from infoplan.terrain import Terrain, load_terrain

SHARED = (
    "n_jobs", "backend", "scheduler", "mission_timeout", "on_error", "results_dir", "resume",
)  # fmt: skip
"""Options that all configurations of a study have in common, because they share one pool."""


def check_study(configs: list[Config]) -> None:
    """Check every configuration, and that they can share a pool.

    Raises
    ------
    UsageError
        Names the first option that is wrong and what it may be.
    """
    for config in configs:
        validate(config)
    for name in SHARED:
        if len(values := {str(getattr(config, name)) for config in configs}) > 1:
            raise UsageError(
                f"{name}={','.join(sorted(values))} cannot be swept: all configurations of a study "
                f"share one pool and one results_dir, so give {name} one value"
            )
    for config in configs:
        check_mission(config)
    check_count(
        sum(len(seed_list(config.seeds)) for config in configs),
        f"seeds={configs[0].seeds}" if len(configs) == 1 else "this sweep",
    )


def plan_study(configs: list[Config], say: Say) -> Study:
    """Find out what a study consists of and what of it is done; nothing is written.

    Parameters
    ----------
    configs
        Valid (`check_study`).
    say
        Takes warnings.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        If a map cannot be had.
    """
    study = identify_study(configs, say)
    study.pace = learn(study.results_dir)
    study.look()
    return study


def identify_study(configs: list[Config], say: Say) -> Study:
    """Find out what a study consists of; parameters and errors as of `plan_study`."""
    terrains = load_terrains([config.terrain for config in configs], say)
    identified = [identify(*pair) for pair in zip(configs, terrains, strict=True)]
    runs = merge_runs(identified, [seed_list(config.seeds) for config in configs])
    results_dir = user_path(configs[0].results_dir)
    return Study([run.name for run in identified], runs, results_dir)


def run_study(configs: list[Config], listener: Listener) -> Study:
    """Run all configurations with all their seeds in one pool, and store the tables.

    Parameters
    ----------
    configs
        Valid or not; they are validated before any work.
    listener
        Is told of warnings and progress.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        If a configuration is wrong, a map cannot be had, or the results cannot be written.
    RunError
        If a table cannot be stored, or the pool is lost; what is finished is kept.
    """
    check_study(configs)
    prepare(user_path(configs[0].results_dir))
    study = plan_study(configs, listener.say)
    carry_out(study, configs[0], listener)
    return study


def load_terrains(wanted: Iterable[TerrainConfig], say: Say) -> list[Terrain]:
    """Load each map once, here in the parent, so that all workers use the same.

    A fallback to another map is shown once, loudly, before any work.
    """
    loaded: dict[str, Terrain] = {}
    terrains = []
    for config in wanted:
        key = repr(config)
        if key not in loaded:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                loaded[key] = load_terrain(**vars(config))
            for warning in caught:
                say(f"WARNING: {warning.message}", "alarm")
        terrains.append(loaded[key])
    return terrains


def merge_runs(runs: list[Run], seeds: list[Sequence[int]]) -> list[tuple[Run, list[int]]]:
    """Make configurations that are the same run one, with all their seeds."""
    merged: dict[str, tuple[Run, dict[int, None]]] = {}
    for run, wanted in zip(runs, seeds, strict=True):
        merged.setdefault(run.name, (run, {}))[1].update(dict.fromkeys(wanted))
    return [(run, list(known)) for run, known in merged.values()]
