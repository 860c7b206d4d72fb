"""Stored missions whose hyperparameters are fit anew, in one pool."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from infoplan.config import Config, GuardedConfig
from infoplan.errors import UsageError
from infoplan.methods import method_label
from infoplan.study.executor import carry_out
from infoplan.study.identity import Run
from infoplan.study.listening import Listener
from infoplan.study.replay import FlownRun
from infoplan.study.store import prepare
from infoplan.study.study import Study
from infoplan.terrain import Terrain


def refit_study(
    results_dir: Path,
    wanted: Sequence[tuple[FlownRun, Sequence[int]]],
    config: Config,
    listener: Listener,
) -> Study:
    """Refit the hyperparameters of stored missions in one pool; what is stored is kept.

    Parameters
    ----------
    results_dir
        Where the missions' tables are, and their refits go.
    wanted
        Runs, and which of their missions.
    config
        How to run: workers, backend, what to do on an error, what to keep.
    listener
        Is told of warnings and progress.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        If a model's hyperparameters are not at an optimum of what its samples alone tell.
    RunError
        If a table cannot be written, or the pool is lost.
    """
    for source, _ in wanted:
        demand_refittable(source)
    prepare(results_dir)
    runs = [(_run_of(source), list(seeds)) for source, seeds in wanted]
    study = Study([run.name for run, _ in runs], runs, results_dir, refit=True)
    study.look()
    carry_out(study, config, listener)
    return study


def demand_refittable(source: FlownRun) -> None:
    """Refuse models whose hyperparameters no likelihood of all samples given tells.

    Raises
    ------
    UsageError
        Says why.
    """
    if not isinstance(source.config.model, GuardedConfig):
        raise UsageError(
            f"{source.name} has the model {method_label(source.config.model)}, which is not fit "
            "by a likelihood of all samples that it is given, so none can be refit: explain runs "
            "of model=gp, vecchia or student_t"
        )


def _run_of(source: FlownRun) -> Run:
    """Name a stored run as tasks do; of its map no elevations are known, nor needed."""
    stored = source.science["terrain"]
    unknown = np.full((2, 2), np.nan)
    terrain = Terrain(
        stored["name"], unknown, tuple(stored["extent"]), stored["unit"], stored["sha256"]
    )
    return Run(source.name, source.config, terrain, source.science)
