"""Missions from Python: configure, fly, step by hand, and see the tables as data frames."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.config import Config, MissionConfig, validate
from infoplan.errors import UsageError
from infoplan.extent import checked_extent
from infoplan.mission import CurveRow, Mission, Samples
from infoplan.terrain import Terrain, load_terrain
from infoplan.terrain.surface import array_digest
from infoplan.text_options import as_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

Floats = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Frames:
    """The tables of a mission, with the columns of the result tables.

    Attributes
    ----------
    curves
        One row an evaluation.
    samples
        One row a sample, in order of collection.
    maps
        One row a node of the query grid, row-major, as of the last evaluation.
    """

    curves: "pd.DataFrame"
    samples: "pd.DataFrame"
    maps: "pd.DataFrame"

    def __repr__(self) -> str:
        """Sum up in a line."""
        rows = ", ".join(f"{name}: {len(table)} rows" for name, table in vars(self).items())
        return f"Frames({rows})"


def configure(*overrides: str, **options: Any) -> MissionConfig:
    """Compose a mission's configuration from the same options as ``infoplan run``.

    Parameters
    ----------
    *overrides
        As on the command line: ``"planner=uct"``, ``"detector.scope=historical"``.
    **options
        Options as Python values: ``rho=0.1``, ``grid=[20, 20]``.

    Returns
    -------
    MissionConfig
        Complete and valid.

    Raises
    ------
    UsageError
        If an option is unknown or has no possible value.
    """
    from infoplan.hydra_front.compose import compose

    written = [*overrides, *(f"{name}={as_value(name, value)}" for name, value in options.items())]
    names = [item.name for item in fields(MissionConfig)]
    for override in written:
        name = override.partition("=")[0].lstrip("+")
        if name in {item.name for item in fields(Config)} - set(names):
            raise UsageError(f"{override} is no option of a single mission: leave it out")
    config = compose(written)
    validate(config)
    if config.sweep:
        raise UsageError(
            f"{' '.join(written)} stands for several configurations: configure each by its options"
        )
    return MissionConfig(**{name: getattr(config, name) for name in names})


def fly(config: MissionConfig, seed: int = 0, terrain: Terrain | None = None) -> Frames:
    """Fly one mission here and now.

    Parameters
    ----------
    config
        From `configure`.
    seed
        Of all random streams.
    terrain
        The ground truth; None: the one that the configuration names.

    Returns
    -------
    Frames
        The numbers that ``infoplan run`` stores for this seed.

    Raises
    ------
    UsageError
        If the terrain cannot be had, or the mission needs more memory than the machine has.
    RunError
        If the mission breaks down.
    """
    if terrain is None:
        from infoplan.study.identity import resolve

        terrain = load_terrain(**vars(config.terrain))
        config = resolve(config, terrain)
    mission = Mission(config, terrain, seed)
    return frames(mission, list(mission.run()))


def frames(mission: Mission, rows: "Sequence[CurveRow]") -> Frames:
    """Lay out a mission as data frames, at any point after its first evaluation.

    Parameters
    ----------
    mission
        Flown, or stepped by hand.
    rows
        What `Mission.run` yielded, or `Mission.evaluate` returned.
    """
    from infoplan.study.identity import Run
    from infoplan.study.store import build_tables

    run = Run("", mission.config, mission.terrain, {})  # tables that are not stored need no name
    tables = build_tables(run, mission, list(rows))
    return Frames(*(getattr(tables, name).to_pandas() for name in ("curves", "samples", "maps")))


def workspace(extent: "Sequence[float]", unit: str = "m", name: str = "field") -> Terrain:
    """Terrain of unknown elevation, for missions whose samples come from elsewhere.

    Parameters
    ----------
    extent
        xmin, xmax, ymin, ymax, workspace units.
    unit
        Of the measurements.
    name
        What tables call it.

    Returns
    -------
    Terrain
        Its elevation is NaN everywhere, and so are the errors of a mission on it.

    Raises
    ------
    UsageError
        If the extent is no rectangle.
    """
    unknown = np.full((2, 2), np.nan)
    return Terrain(name, unknown, checked_extent(extent), unit, array_digest(unknown))


def as_samples(
    mission: Mission,
    x: ArrayLike,
    measured: ArrayLike,
    *,
    heading: ArrayLike | None = None,
    is_outlier: ArrayLike | None = None,
) -> Samples:
    """Make what a robot or a log brought into samples of a mission's current epoch.

    They are for `Mission.start` before the first plan, and for `Mission.observe` after each plan.

    Parameters
    ----------
    mission
        Its terrain gives the truth, NaN where unknown.
    x
        Where the samples were taken, shape (n, 2), workspace units, in order. They need not be
        where the plan put them.
    measured
        What the sensor said, shape (n,), terrain's unit.
    heading
        After each sample, radians, shape (n,); None: the direction from the sample before.
    is_outlier
        True labels, shape (n,), where they are known; None: no sample is called an outlier, so that
        the confusion counts call every flag a false positive.

    Returns
    -------
    Samples

    Raises
    ------
    UsageError
        If shapes do not fit, a number is not finite, a sample lies outside of the workspace, or
        there are more than the budget allows.
    """
    x = np.array(x, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 2 or len(x) == 0:
        raise UsageError(f"x has shape {x.shape}: give one row (x1, x2) a sample, at least one")
    n = len(x)
    before = getattr(mission, "samples", None)
    given = {
        "measured": np.array(measured, dtype=np.float64),
        "heading": _directions(x, None if before is None else mission.pose)
        if heading is None
        else np.array(heading, dtype=np.float64) % (2 * np.pi),
    }
    for name, values in given.items():
        if values.shape != (n,):
            raise UsageError(f"{name} has shape {values.shape}: give one number a sample, {n}")
    for name, values in {"x": x, **given}.items():
        if not np.all(np.isfinite(values)):
            raise UsageError(f"{name} holds a number that is not finite: leave such samples out")
    labels = np.zeros(n, dtype=bool) if is_outlier is None else np.array(is_outlier, dtype=bool)
    if labels.shape != (n,):
        raise UsageError(f"is_outlier has shape {labels.shape}: give one label a sample, {n}")
    xmin, xmax, ymin, ymax = mission.terrain.extent
    outside = (x < [xmin, ymin]).any(axis=1) | (x > [xmax, ymax]).any(axis=1)
    if outside.any():
        first = x[np.argmax(outside)]
        raise UsageError(
            f"sample {np.argmax(outside)} at ({first[0]:g}, {first[1]:g}) lies outside of the "
            f"workspace {list(mission.terrain.extent)}: leave it out, or widen the workspace"
        )
    left = mission.config.budget - (0 if before is None else len(before))
    if n > left:
        raise UsageError(f"{n} samples are more than the {left} that budget= leaves: raise it")
    return Samples(
        epoch=np.full(n, mission.epoch),
        x=x,
        heading=given["heading"],
        truth=mission.terrain.elevation_at(x[:, 0], x[:, 1]),
        measured=given["measured"],
        is_outlier=labels,
        flagged=np.zeros(n, dtype=bool),
        score=np.full(n, np.nan),
    )


def _directions(x: Floats, pose: Floats | None) -> Floats:
    """Direction of the step to each sample, in [0, 2 pi); of the next one where there is none."""
    start = x[:1] if pose is None else pose[None, :2]
    step = np.diff(np.concatenate([start, x]), axis=0)
    if pose is None and len(x) > 1:
        step[0] = step[1]
    return np.arctan2(step[:, 1], step[:, 0]) % (2 * np.pi)
