"""What a stored survey has taught: its belief once more, as at its end, on a map of any extent."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from infoplan.belief import Belief
from infoplan.config import MissionConfig, is_survey
from infoplan.culprit import culprit_named
from infoplan.errors import UsageError
from infoplan.extent import Extent
from infoplan.obstacles import Obstacles
from infoplan.samples import Samples
from infoplan.source import StoredSource
from infoplan.study.replay import FlownRun, find_flown
from infoplan.study.replayed import stand_in, stored_samples
from infoplan.study.run_names import listed, stored_runs
from infoplan.study.store import read_table
from infoplan.text_options import as_command


def find_survey(results_dir: Path, named: str) -> FlownRun:
    """Find the stored survey that a name, a hash, or the beginning of either stands for.

    Raises
    ------
    UsageError
        If there is none, or several, or it is no survey.
    RunError
        If its configuration does not fit this version, or it is not whole.
    """
    found = find_flown(results_dir, named)
    if not is_survey(found.config.terrain.name):
        surveys = [run for run in stored_runs(results_dir) if run.startswith("survey-")]
        there = (
            listed(surveys, results_dir)
            if surveys
            else (f"one that {as_command('infoplan survey', results_dir)} has stored")
        )
        raise UsageError(f"run={named} is no survey but a simulated mission: name {there}")
    return found


def surveyed_samples(results_dir: Path, source: FlownRun) -> Samples:
    """Read the samples of a stored survey, with the verdicts on them.

    Raises
    ------
    RunError
        If the table cannot be read.
    """
    return stored_samples(
        read_table(results_dir, "samples", source.name, source.seeds[0]).to_pandas()
    )


def recall(
    source: FlownRun, samples: Samples, extent: Extent, grid: list[int], obstacles: Obstacles
) -> Belief:
    """Teach a belief a survey's samples once more, batch by batch.

    Detector and model are the survey's, so that verdicts and hyperparameters are its own.

    Parameters
    ----------
    source
        The survey.
    samples
        Its samples.
    extent, grid
        Workspace and nodes of the map that is predicted, which need not be the survey's.
    obstacles
        Where it must not be gone.

    Returns
    -------
    Belief

    Raises
    ------
    UsageError
        If a detector or model of the user's own cannot be had.
    RunError
        If a detector or model fails, or gives what it should not.
    """
    config: MissionConfig = replace(
        source.config, planner=stand_in(source.config), grid=grid, budget=len(samples)
    )
    unknown = np.empty(0)
    stored = StoredSource(samples, extent, unknown, unknown.astype(np.intp), labelled=False)
    with culprit_named(config, "on the pilot samples"):
        belief = Belief(config, extent, source.seeds[0], stored.pilot().readings(), obstacles)
    while belief.collected < len(samples):
        epoch = belief.epoch + 1
        with culprit_named(config, f"in epoch {epoch}"):
            belief.learn(stored.sample(epoch, None).readings())
    return belief
