"""Missions from Python: configure, fly, step by hand, and see the tables as data frames."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoplan.belief import Belief
from infoplan.config import Config, MissionConfig, validate
from infoplan.culprit import culprit_named
from infoplan.errors import UsageError
from infoplan.extent import checked_extent
from infoplan.html_table import html_facts
from infoplan.methods import method_label
from infoplan.mission import explore
from infoplan.mission_cost import check_mission
from infoplan.obstacles import obstacles_of
from infoplan.samples import Batch, Samples, joined
from infoplan.scoring import CurveRow, State, assess
from infoplan.simulator import Simulator
from infoplan.terrain import Terrain, load_terrain
from infoplan.terrain.surface import array_digest
from infoplan.text_options import as_value, renamed
from infoplan.wording import counted, figure, harmless

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

    def _repr_html_(self) -> str:
        """Sum up the mission in a notebook; `infoplan.plot_mission` draws it."""
        last = self.curves.iloc[-1]
        flagged = self.samples["flagged"].astype(bool)
        outlier = self.samples["is_outlier"]
        found = ""
        if outlier.notna().all():
            spikes = outlier.astype(bool)
            hits, missed = (flagged & spikes).sum(), (spikes & ~flagged).sum()
            found = f", {hits} of them outliers; {missed} outliers missed"
        facts = {
            "mission": f"planner {last['planner']}, detector {last['detector']} "
                       f"({last['scope']}), rho {last['rho']:g}, {last['terrain']}, "
                       f"seed {last['seed']}",
            "samples": f"{last['collected']} collected, {last['accepted']} in the model",
            "RMSE": figure(float(last["rmse"])) or "unknown",
            "flags": f"{flagged.sum()} samples{found}",
        }  # fmt: skip
        return html_facts(repr(self), facts)


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

    named = {renamed(name): value for name, value in options.items()}
    written = [*overrides, *(f"{name}={as_value(name, value)}" for name, value in named.items())]
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
    rows = []
    for state in explore(config, Simulator(config, terrain, seed), seed):
        rows.append(state.row)
    return _frames(config, terrain, seed, rows, state)


class Mission:
    """A mission stepped by hand, as ask and tell: you, or a robot of yours, bring the samples.

    In turn: `start` with the pilot's samples, then `plan` and `observe` until the budget is spent;
    `evaluate` at any time after the start.

    Parameters
    ----------
    config
        From `configure`.
    terrain
        The ground truth, of a `workspace` if nobody knows it.
    seed
        Of all random streams.

    Raises
    ------
    UsageError
        If the mission needs more memory than the machine has.
    """

    def __init__(self, config: MissionConfig, terrain: Terrain, seed: int):
        check_mission(config)
        self.config = config
        self.terrain = terrain
        self.seed = seed
        self._simulator = Simulator(config, terrain, seed)
        self._told: tuple[Belief, Batch] | None = None

    def __repr__(self) -> str:
        """Sum up in a line."""
        return harmless(
            f"Mission({method_label(self.config.planner)}, {method_label(self.config.detector)} on "
            f"{self.terrain.name}, seed {self.seed}: {self.collected} of {self.config.budget} "
            f"samples, {counted(self.epoch, 'epoch')})"
        )

    def _repr_html_(self) -> str:
        """Show in a notebook how far it is."""
        config = self.config
        facts = {
            "planner": method_label(config.planner),
            "detector": f"{method_label(config.detector)} ({config.detector.scope})",
            "model": method_label(config.model),
            "terrain": self.terrain.name,
            "samples": f"{self.collected} of {config.budget}",
            "epochs": self.epoch,
        }
        return html_facts(f"Mission, seed {self.seed}", facts)

    @property
    def collected(self) -> int:
        """Number of samples collected so far, the pilot's included."""
        return self._told[0].collected if self._told else 0

    @property
    def epoch(self) -> int:
        """Number of plans whose samples are in."""
        return self._told[0].epoch if self._told else 0

    @property
    def samples(self) -> Samples:
        """All samples so far, with the verdicts on them."""
        return self._state().samples

    def pilot_path(self) -> Floats:
        """Poses along the Bezier curve that circles the workspace, shape (n, 3)."""
        return self._simulator.pilot_path()

    def sample(self, trajectory: Floats) -> Batch:
        """Sense the terrain along poses, shape (n, 3), with noise and outliers, in the simulator.

        Before the start they are the pilot's, then the next epoch's.
        """
        return self._simulator.sample(self.epoch + 1 if self._told else 0, trajectory)

    def start(self, pilot: Batch) -> None:
        """Fit the scalers and the model's hyperparameters to the pilot samples.

        Raises
        ------
        UsageError
            If the mission has been started, or a method of the user's own cannot be had.
        RunError
            If a measurement is beyond 1e100, or the model cannot take the pilot.
        """
        if self._told:
            raise UsageError("this mission has been started: give further samples to observe()")
        with culprit_named(self.config, "on the pilot samples"):
            belief = Belief(
                self.config,
                self.terrain.extent,
                self.seed,
                pilot.readings(),
                self.terrain.obstacles,
            )
        self._told = belief, pilot

    def plan(self) -> Floats:
        """Plan the next trajectory from where the last sample was taken.

        Returns
        -------
        ndarray, shape (n, 3)
            Poses x1, x2, heading at the samples, cut to the remaining budget.
        """
        belief, _ = self._started()
        with culprit_named(self.config, f"in epoch {belief.epoch + 1}"):
            return belief.plan()

    def observe(self, batch: Batch) -> None:
        """Detect the outliers of an epoch, drop them, and teach the model the clean data.

        Raises
        ------
        RunError
            If a measurement is beyond 1e100, the detector gives no verdict, or the model fails.
        """
        belief, collected = self._started()
        with culprit_named(self.config, f"in epoch {belief.epoch + 1}"):
            belief.learn(batch.readings())
        self._told = belief, joined(collected, batch)

    def evaluate(self) -> CurveRow:
        """Score the model's prediction of the query grid against the truth.

        Raises
        ------
        RunError
            If it is so far off that its errors overflow.
        """
        return self._state().row

    def _state(self) -> State:
        belief, collected = self._started()
        truth, third = self._simulator.grid_truth, self._simulator.grid_third
        return assess(belief, collected, truth, third)

    def _started(self) -> tuple[Belief, Batch]:
        """Return what was learned and told, or refuse what comes before the start."""
        if self._told is None:
            raise UsageError("this mission has no samples yet: give start() the pilot's first")
        return self._told


def frames(mission: Mission, rows: "Sequence[CurveRow]") -> Frames:
    """Lay out a mission stepped by hand as data frames, at any point after its start.

    Parameters
    ----------
    mission
        Stepped by hand.
    rows
        What `Mission.evaluate` returned.
    """
    return _frames(mission.config, mission.terrain, mission.seed, rows, mission._state())


def _frames(
    config: MissionConfig, terrain: Terrain, seed: int, rows: "Sequence[CurveRow]", last: State
) -> Frames:
    from infoplan.study.identity import Run
    from infoplan.study.mission_tables import build_tables

    run = Run("", config, terrain, {})  # tables that are not stored need no name
    tables = build_tables(run, seed, rows, last)
    return Frames(*(getattr(tables, name).to_pandas() for name in ("curves", "samples", "maps")))


def workspace(
    extent: "Sequence[float]",
    unit: str = "m",
    name: str = "field",
    obstacles: "Sequence[Sequence[Sequence[float]]]" = (),
) -> Terrain:
    """Terrain of unknown elevation, for missions whose samples come from elsewhere.

    Parameters
    ----------
    extent
        xmin, xmax, ymin, ymax, workspace units.
    unit
        Of the measurements.
    name
        What tables call it.
    obstacles
        Polygons that the robot must not touch: the vertices of each, at least three pairs x, y.

    Returns
    -------
    Terrain
        Its elevation is NaN everywhere, and so are the errors of a mission on it.

    Raises
    ------
    UsageError
        If the extent is no rectangle, or an obstacle no polygon.
    """
    unknown = np.full((2, 2), np.nan)
    return Terrain(
        name, unknown, checked_extent(extent), unit, array_digest(unknown),
        obstacles=obstacles_of(obstacles),
    )  # fmt: skip


def as_samples(
    mission: Mission,
    x: ArrayLike,
    measured: ArrayLike,
    *,
    heading: ArrayLike | None = None,
    is_outlier: ArrayLike | None = None,
) -> Batch:
    """Make what a robot or a log brought into a batch of a mission's samples.

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
        True labels, shape (n,), where they are known; None: the confusion counts call every flag a
        false positive, and the detector ``best`` has nothing to go by.

    Returns
    -------
    Batch

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
    before = mission.samples if mission.collected else None
    given = {
        "measured": np.array(measured, dtype=np.float64),
        "heading": _directions(x, None if before is None else before.x[-1])
        if heading is None
        else np.array(heading, dtype=np.float64) % (2 * np.pi),
    }
    for name, values in given.items():
        if values.shape != (n,):
            raise UsageError(f"{name} has shape {values.shape}: give one number a sample, {n}")
    for name, values in {"x": x, **given}.items():
        if not np.all(np.isfinite(values)):
            raise UsageError(f"{name} holds a number that is not finite: leave such samples out")
    labels = None if is_outlier is None else np.array(is_outlier, dtype=bool)
    if labels is not None and labels.shape != (n,):
        raise UsageError(f"is_outlier has shape {labels.shape}: give one label a sample, {n}")
    xmin, xmax, ymin, ymax = mission.terrain.extent
    outside = (x < [xmin, ymin]).any(axis=1) | (x > [xmax, ymax]).any(axis=1)
    if outside.any():
        first = x[np.argmax(outside)]
        raise UsageError(
            f"sample {np.argmax(outside)} at ({first[0]:g}, {first[1]:g}) lies outside of the "
            f"workspace {list(mission.terrain.extent)}: leave it out, or widen the workspace"
        )
    left = mission.config.budget - mission.collected
    if n > left:
        raise UsageError(f"{n} samples are more than the {left} that budget= leaves: raise it")
    truth = mission.terrain.elevation_at(x[:, 0], x[:, 1])
    return Batch(x, given["heading"], given["measured"], labels, truth)


def _directions(x: Floats, before: Floats | None) -> Floats:
    """Direction of the step to each sample, in [0, 2 pi); of the next one where there is none."""
    start = x[:1] if before is None else before[None]
    step = np.diff(np.concatenate([start, x]), axis=0)
    if before is None and len(x) > 1:
        step[0] = step[1]
    return np.arctan2(step[:, 1], step[:, 0]) % (2 * np.pi)
