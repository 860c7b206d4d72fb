"""Surveys: a log's samples through a detector and a model, stored like any mission."""

import math
import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from infoplan.collapse import spacing_along
from infoplan.config import (
    Config,
    GpResidualConfig,
    MissionConfig,
    SurveyedConfig,
    VecchiaConfig,
)
from infoplan.errors import UsageError
from infoplan.files import user_path
from infoplan.later_logs import Origins
from infoplan.machine import machine_memory, size
from infoplan.mission_cost import PAIR_BYTES, check_mission, memory_of, seconds_of
from infoplan.samples import Samples
from infoplan.study.executor import carry_out
from infoplan.study.identity import identify
from infoplan.study.listening import Listener
from infoplan.study.store import prepare
from infoplan.study.study import Study
from infoplan.survey import SurveyLog
from infoplan.terrain import Terrain
from infoplan.wording import counted, rough

Floats = NDArray[np.float64]

SEED = 0
"""Of what random a detector does: a survey has one mission."""

MARGIN = 0.05
"""How far the map reaches beyond the track, shares of its longer side."""

NODES = 2500
"""About so many nodes has the map, as near to squares as can be, unless ``grid=`` is given."""

PER_LOG = "log"
"""A batch for each log."""

LONGEST = 1.0
"""Hours that a model of all pairs of samples may take, as estimated."""

STEPS_ACROSS = 20
"""A step of the robot that would fly there is so small a part of the shorter side, at most."""


def survey_config(log: SurveyLog, batch: str | None) -> MissionConfig:
    """Configure the mission of a log: what its samples decide, and a survey's own defaults.

    Everything is judged again after each batch (scope historical), by the Gaussian process that is
    linear in the number of samples and the detector that asks it.

    Parameters
    ----------
    log
        As read.
    batch
        As of `batches`.

    Returns
    -------
    MissionConfig
        Nothing is planted: rho is 0. Planner and robot are there for later.
    """
    low, high = log.x.min(axis=0), log.x.max(axis=0)
    margin = max(1.0, MARGIN * float((high - low).max()))
    origin = np.floor(low - margin)
    width, height = (float(side) for side in np.ceil(high + margin) - origin)
    cell = math.sqrt(width * height / NODES)
    if log.parts:
        batch = batch or PER_LOG
    elif batch == PER_LOG:
        batch = None
    config = MissionConfig(
        detector=GpResidualConfig(scope="historical"),
        model=VecchiaConfig(),
        terrain=SurveyedConfig(
            name=f"survey-{log.name}",
            extent=[0.0, width, 0.0, height],
            unit=log.unit,
            crs=log.crs,
            origin=[float(side) for side in origin],
            columns=dict(sorted(log.roles.items())),
            batch=batch,
        ),
        rho=0.0,
        budget=len(log),
        grid=[max(2, round(side / cell) + 1) for side in (height, width)],
    )
    usual = spacing_along(log.x)
    config.robot.speed = round(min(usual, min(width, height) / STEPS_ACROSS), 6)
    config.pilot.samples = int(np.sum(batches(log, batch) == 0))
    return config


def batches(log: SurveyLog, batch: str | None) -> NDArray[np.int64]:
    """Part a log into batches, in order of time.

    The first is the pilot, to which the model's scales and first hyperparameters are fitted.

    Parameters
    ----------
    log
        As read.
    batch
        A number of samples, or of seconds, as in ``30s``; None: at once, which is all but the last
        sample and then that one, whereupon all are judged. Of several logs each begins batches of
        its own; None or ``log``: each is one, and the first is taken at once.

    Returns
    -------
    ndarray, shape (n,)
        The epoch of each sample, counted from 0.

    Raises
    ------
    UsageError
        If it is none of these, the log has no times, or the first batch cannot begin a model.
    """
    if log.parts:
        first, *later = log.parts
        found = [batches(first, None if batch == PER_LOG else batch)]
        for part in later:
            own = _parts(part, None if batch == PER_LOG else batch)
            found.append(found[-1][-1] + 1 + own)
        return np.concatenate(found)
    epochs = _parts(log, None if batch == PER_LOG else batch)
    if epochs[-1] == 0:
        _check_values(log)
        return np.where(np.arange(len(log)) == len(log) - 1, 1, 0)
    first = epochs == 0
    value = log.value[first & ~np.isnan(log.value)]
    if len(value) < 3 or np.ptp(value) == 0 or np.any(np.ptp(log.x[first], axis=0) == 0):
        raise UsageError(
            f"batch={batch} is too short: the first batch has {counted(int(first.sum()), 'sample')}"
            ", and to begin the model with they must differ in value and in position both ways; "
            "make it longer, or leave it out"
        )
    return epochs


def _check_values(log: SurveyLog) -> None:
    """Refuse a log whose values, without the last sample's, have no standard deviation."""
    value = log.value[:-1][~np.isnan(log.value[:-1])]
    if len(value) and np.ptp(value) == 0:
        raise UsageError(
            f"{log.name}: all values of {log.roles['value']} are {value[0]:g}: there is nothing to "
            "map; give a log whose values differ, or say which column to read with "
            "columns={value: ...}"
        )


def _parts(log: SurveyLog, batch: str | None) -> NDArray[np.int64]:
    """Count the batches of a log from 0, sample by sample; None: it is one."""
    if batch is None:
        return np.zeros(len(log), dtype=np.int64)
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?) *(s?)", batch.strip())
    size = float(found[1]) if found else 0.0
    if found is None or not size or not (found[2] or size.is_integer()):
        raise UsageError(
            f"batch={batch} is not possible: give a number of samples like 100, of seconds like "
            "30s, or log"
        )
    if not found[2]:
        parts = np.arange(len(log)) // int(size)
    elif log.time is None:
        raise UsageError(
            f"batch={batch} needs times, and the log has none that are recognised: give a number "
            "of samples, or columns={time: ...}"
        )
    else:
        parts = np.floor((log.time - log.time[0]) / size)
    return np.unique(parts, return_inverse=True)[1].astype(np.int64)


def survey_samples(log: SurveyLog, config: MissionConfig) -> Samples:
    """Give the samples of a log as a mission's, positions from the workspace's origin on."""
    place, n = config.terrain, len(log)
    return Samples(
        epoch=batches(log, place.batch),
        x=log.x - np.array(place.origin),
        heading=np.concatenate([headings(part.x) for part in log.parts or (log,)]),
        truth=np.full(n, np.nan),
        measured=log.value,
        is_outlier=np.zeros(n, dtype=bool),
        flagged=np.zeros(n, dtype=bool),
        score=np.full(n, np.nan),
    )


def _check_size(config: MissionConfig) -> None:
    """Refuse so many samples that a model of all pairs of them is no longer sensible.

    Raises
    ------
    UsageError
        Says from which number on, and what to use instead.
    """
    if config.model.name not in PAIR_BYTES:
        return
    n = np.unique(np.geomspace(10, config.budget, 200).astype(int))
    sized = [
        replace(config, budget=k, pilot=replace(config.pilot, samples=k - 1)) for k in n.tolist()
    ]
    hours = np.array([seconds_of(one) for one in sized]) / 3600
    needed = np.array([memory_of(one) for one in sized])
    sensible = (hours <= LONGEST) & (needed <= machine_memory())
    if sensible[-1]:
        return
    raise UsageError(
        f"model={config.model.name} works with all pairs of samples: {config.budget} take about "
        f"{rough(hours[-1])} hours and {size(needed[-1])} of memory, and beyond about "
        f"{rough(float(n[sensible].max(initial=0)))} it stops being sensible here; use "
        "model=vecchia, whose cost is linear"
    )


def origins_of(log: SurveyLog) -> Origins | None:
    """Say of which log each sample is, and in which row; None if there is one log."""
    if not log.parts:
        return None
    rows = np.concatenate([part.rows for part in log.parts])
    return Origins(tuple(part.name for part in log.parts), log.log_of, rows)


def headings(x: Floats) -> Floats:
    """Give the direction in which each position was reached, radians in [0, 2 pi).

    Where nothing moved it is the one before; until something has, that of the first step.
    """
    steps = np.diff(x, axis=0, prepend=x[:1])
    moved = np.flatnonzero(np.any(steps != 0, axis=1))
    latest = moved[np.maximum(np.searchsorted(moved, np.arange(len(x)), side="right") - 1, 0)]
    turns = np.arctan2(steps[latest, 1], steps[latest, 0])
    return np.asarray(np.mod(turns, 2 * np.pi) % (2 * np.pi), dtype=np.float64)


def check_judging(config: MissionConfig) -> None:
    """Refuse a detector that cannot judge the samples of a survey, or nearly none of them."""
    detector = config.detector
    if detector.name == "best":
        raise UsageError(
            "detector=best needs the true labels, which nobody has of a survey: use another"
        )
    if detector.scope == "batch" and not detector.judge_pilot and config.terrain.batch is None:
        raise UsageError(
            "detector.scope=batch judges each batch but the first alone: survey with batch=, too, "
            "or leave it out and all are judged"
        )


def survey_study(log: SurveyLog, config: Config, listener: Listener) -> Study:
    """Judge and map a log, and store the tables as those of a mission.

    Parameters
    ----------
    log
        As read.
    config
        `survey_config`, with any detector and model; and how to run it.
    listener
        Is told of warnings and progress.

    Returns
    -------
    Study
        Of one run.

    Raises
    ------
    UsageError
        If the detector needs labels, the survey more memory than there is, or the results cannot
        be written.
    RunError
        If a table cannot be stored.
    """
    check_judging(config)
    _check_size(config)
    check_mission(config)
    place = config.terrain
    unknown = np.full((2, 2), np.nan)
    xmin, xmax, ymin, ymax = place.extent
    terrain = Terrain(place.name, unknown, (xmin, xmax, ymin, ymax), log.unit, log.sha256)
    run = identify(config, terrain)
    folder = user_path(config.results_dir)
    prepare(folder)
    samples = survey_samples(log, config)
    study = Study([run.name], [(run, [SEED])], folder, surveyed=samples, origins=origins_of(log))
    study.look()
    carry_out(study, replace(config, backend="sequential", n_jobs=1), listener)
    return study
