"""A stored mission that is to be shown again: which, its tables, its states epoch by epoch."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.configurations import stored_options
from infoplan.analyse.relief import on_grid
from infoplan.analyse.stretches import load_scored_curves
from infoplan.analyse.tables import find_missions
from infoplan.config import MissionConfig, is_survey, validate
from infoplan.errors import RunError, UsageError
from infoplan.extent import checked_extent
from infoplan.method_identity import PAPERS_OWN, method_of
from infoplan.plan import count_flags, smooth
from infoplan.scoring import CurveRow, Maps, State
from infoplan.study.replayed import explore_again, stand_in, stored_samples
from infoplan.study.run_names import find_run, stored_runs
from infoplan.study.store import list_missions, read_footer, read_table, table_path
from infoplan.text_options import as_command

Floats = NDArray[np.float64]

SAME_RMSE = 1e-6
"""Relative difference up to which a recomputed RMSE is the stored one: rounding of other BLAS."""


@dataclass(frozen=True)
class Recording:
    """A stored mission.

    Attributes
    ----------
    run, seed
        Which.
    method
        Its name, as in all drawings.
    config
        Its configuration.
    science
        The same as it is stored.
    samples, curve, maps
        Its tables, one row a sample, an epoch, a node of the query grid.
    truth
        Elevation at the nodes of the query grid, shape ``config.grid``, terrain's unit.
    errors
        RMSE of each epoch; of a survey the cross-validated one.
    """

    run: str
    seed: int
    method: str
    config: MissionConfig
    science: dict[str, Any]
    samples: pd.DataFrame
    curve: pd.DataFrame
    maps: pd.DataFrame
    truth: Floats
    errors: "pd.Series[float]"

    @property
    def surveyed(self) -> bool:
        """Whether nobody knows the truth."""
        return is_survey(self.config.terrain.name)


def run_to_show(results_dir: Path, run: str | None) -> str:
    """Find the run to animate.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    run
        A stored run, as `find_run` takes it; None: the only run, else the paper's own method
        (PUCT-COPOD at rho 0.1 and scope batch), if only one run is such.

    Raises
    ------
    UsageError
        If it is not stored, or several could be meant.
    """
    stored = stored_runs(results_dir)
    if not stored:
        raise UsageError(
            f"results_dir={results_dir} holds no finished mission to animate: fly one with "
            f"{as_command('infoplan run', results_dir)}, or name the folder that holds curves/"
        )
    if run is None:
        paper = [name for name in stored if _is_papers_own(results_dir, name)]
        candidates = stored if len(stored) == 1 else paper
        if len(candidates) != 1:
            raise UsageError(
                f"results_dir={results_dir} holds several runs: say which with "
                f"run={' or run='.join(candidates or stored)}"
            )
        return candidates[0]
    return find_run(results_dir, run)


def read_recording(results_dir: Path, run: str, seed: int) -> Recording:
    """Read a stored mission.

    Raises
    ------
    UsageError
        If it is not stored, or by another schema version.
    RunError
        If a table cannot be read.
    """
    selection = find_missions(results_dir, run=run, seed=seed)
    missions, errors = selection.missions, load_scored_curves(selection)["rmse"]
    footer = read_footer(table_path(results_dir, "curves", run, seed))
    curve, samples, maps = (
        read_table(results_dir, name, run, seed).to_pandas()
        for name in ("curves", "samples", "maps")
    )
    truth = on_grid(maps, "truth")
    if truth.shape != tuple(footer.config.grid):
        raise RunError(
            f"the map of {run} seed {seed} has {truth.shape[0]} x {truth.shape[1]} nodes, not the "
            f"{footer.config.grid} of its configuration: run it again"
        )
    method = str(missions["method"].iloc[0])
    return Recording(
        run, seed, method, footer.config, footer.configuration, samples, curve, maps, truth,
        errors.reset_index(drop=True),
    )  # fmt: skip


def check_named(recording: Recording, named: Mapping[str, str | None]) -> None:
    """Refuse a function of the command line that is not the recording's.

    Parameters
    ----------
    recording
        The mission.
    named
        Functions by group; None where the command line names none.

    Raises
    ------
    UsageError
        If one is another than the recording's.
    """
    for group, path in named.items():
        used = getattr(getattr(recording.config, group), "function", None)
        if path is not None and path != used:
            raise UsageError(
                f"{group}.function={path} is not the {group} of {recording.run}: "
                f"{f'that is {used}' if used else 'that is none of a user'}"
            )


def cannot_replay(config: MissionConfig, trust: bool, given: Collection[str] = ()) -> str:
    """Say why the states of a mission are not recomputed; empty if they are.

    Parameters
    ----------
    config
        The mission's.
    trust
        Whether functions that it names may be imported.
    given
        Groups whose function the command line itself names.
    """
    own = [getattr(config, group) for group in ("detector", "model") if group not in given]
    named = [options.function for options in own if getattr(options, "function", None)]
    if named and not trust:
        return (
            f"nothing of a results folder is imported, such as {' and '.join(named)}, "
            "without trust=true"
        )
    try:
        # Of the stored terrain no file is known, which a terrain that is to be loaded needs.
        terrain = replace(MissionConfig().terrain, extent=config.terrain.extent)
        validate(replace(config, terrain=terrain, planner=stand_in(config)))
    except UsageError as error:
        return f"its configuration is none that could be flown: {error}"
    return ""


def from_tables(recording: Recording) -> Iterator[State]:
    """Give the states that the tables tell: the maps are those of the end, and of no epoch before.

    Samples are shown as they were judged at the end.

    Yields
    ------
    State
        After the pilot and after each epoch.
    """
    config, table = recording.config, stored_samples(recording.samples)
    extent, maps = checked_extent(config.terrain.extent), recording.maps
    x, truth, *believed = (
        maps[name].to_numpy() for name in (["x1", "x2"], "truth", "mean", "std", "outlier_density")
    )
    last, unknown = Maps(x, truth, *believed), np.full(len(truth), np.nan)
    columns = [item.name for item in fields(CurveRow) if item.name in recording.curve]
    rows = [
        dict(zip(columns, row, strict=True)) for row in recording.curve[columns].to_numpy(object)
    ]
    for epoch, row in enumerate(rows):
        samples = table[table.epoch <= epoch]
        if epoch < len(rows) - 1:
            flags = count_flags(samples.x[samples.flagged], extent, recording.truth.shape)
            density = smooth(flags, config.planner.smoothing, extent).ravel()
            known = replace(last, mean=unknown, std=unknown, outlier_density=density)
        else:
            known = last
        yield State(CurveRow(**row), samples, known)


def replay(recording: Recording) -> Iterator[State]:
    """Recompute the state after every epoch by teaching a belief the mission's own samples.

    Yields
    ------
    State
        After the pilot and after each epoch.
    """
    return explore_again(recording.config, recording.seed, recording.samples, recording.maps)


def difference_from_curve(states: Sequence[State], recording: Recording) -> str:
    """Say how the recomputed RMSE differs from the stored curve; empty if it does not."""
    stored = recording.curve["rmse"].to_numpy()
    recomputed = np.array([state.row.rmse for state in states])
    same = np.isclose(recomputed, stored, rtol=SAME_RMSE, atol=0.0, equal_nan=True)
    if same.all():
        return ""
    with np.errstate(invalid="ignore"):
        epoch = int(np.argmax(np.where(same, -1.0, np.nan_to_num(np.abs(recomputed - stored)))))
    return (
        f"the recomputed RMSE of {recording.run} seed {recording.seed} is not the stored one "
        f"({recomputed[epoch]:.4g} instead of {stored[epoch]:.4g} after epoch {epoch}), as with "
        "another version of the code: the animation shows the recomputed mission"
    )


def _is_papers_own(results_dir: Path, run: str) -> bool:
    """Whether a run is the paper's own method at rho 0.1."""
    seed = list_missions(results_dir)[run][0]
    options = stored_options(
        read_footer(table_path(results_dir, "curves", run, seed)).configuration
    )
    return method_of(options) == PAPERS_OWN and options["rho"] == 0.1
