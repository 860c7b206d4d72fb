"""A stored mission as a stranger reads it, and how a check says that something is wrong."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.config import is_survey
from infoplan.errors import RunError
from infoplan.study.records import Footer, MisfitError, read_science
from infoplan.study.store import configuration_path, open_table, present_tables
from infoplan.study.terms import as_meant
from infoplan.tables import Column
from infoplan.terrain.relief import CLASSES, RADIUS

Floats = NDArray[np.float64]

Booleans = NDArray[np.bool_]

Integers = NDArray[np.int64]

CHANCE = 1e-6
"""How rarely an honest mission may fail a test of randomness."""

SIGMAS = 6.0
"""Sensor noise, in standard deviations, that is allowed for where it cannot be known."""

ROUNDING = 1e-9
"""Relative difference that the order of a few additions may explain."""

Epochs = int | list[int] | None
"""Which epochs' models are recomputed: a number, evenly spread, a list, or all."""

Judgements = list[tuple[Floats, Booleans] | None]
"""Scores and flags of the samples so far, as they stood after each epoch, if known."""

Judge = Callable[["StoredMission"], Judgements]
"""Repeats the detector of a mission."""


@dataclass(frozen=True)
class Partial:
    """What a check tells that has not recomputed all: what it has, and what not, and why."""

    detail: str
    omitted: str


class FaultError(Exception):
    """A check fails; the message is the finding's detail."""


@dataclass(frozen=True, eq=False)
class StoredMission:
    """A stored mission as it was read."""

    configuration: dict[str, Any]
    tables: dict[str, pd.DataFrame]
    footers: dict[str, Footer]
    digests: dict[str, str]
    run: str
    seed: int
    terrains: Mapping[str, NDArray[Any]]
    epochs: Epochs
    judge: Judge

    @property
    def curves(self) -> pd.DataFrame:
        """One row a decision epoch."""
        return self.tables["curves"]

    @property
    def samples(self) -> pd.DataFrame:
        """One row a sample."""
        return self.tables["samples"]

    @property
    def maps(self) -> pd.DataFrame:
        """One row a node of the query grid."""
        return self.tables["maps"]

    def option(self, name: str) -> Any:
        """Look an option up by its dotted name."""
        value: Any = as_meant(self.configuration)
        for key in name.split("."):
            if not isinstance(value, Mapping) or key not in value:
                raise FaultError(f"the run's YAML has no {name}")
            value = value[key]
        return value

    def is_own(self, group: str) -> bool:
        """Tell whether the planner, detector or model is the user's own."""
        return "function" in self.option(group)

    def place(self, sample: int) -> str:
        """Say where a sample is to be found."""
        return f"sample {sample} (epoch {self.epoch[sample]})"

    @cached_property
    def epoch(self) -> NDArray[np.int64]:
        """Epoch of each sample, shape (n,)."""
        return self.samples["epoch"].to_numpy(dtype=np.int64)

    @cached_property
    def x(self) -> Floats:
        """Positions of the samples, shape (n, 2)."""
        return self.samples[["x1", "x2"]].to_numpy(dtype=np.float64)

    @cached_property
    def told(self) -> Booleans:
        """Whether the sensor has said anything, shape (n,)."""
        return self.samples["measured"].notna().to_numpy()

    @cached_property
    def n_pilot(self) -> int:
        """Number of samples before the first decision."""
        return int(np.sum(self.epoch == 0))

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """Bounds xmin, xmax, ymin, ymax of the workspace."""
        xmin, xmax, ymin, ymax = (float(bound) for bound in self.option("terrain.extent"))
        return xmin, xmax, ymin, ymax

    @cached_property
    def length_tolerance(self) -> float:
        """How far rounding may move a position, workspace units."""
        return ROUNDING * max(1.0, *(abs(bound) for bound in self.extent))

    @cached_property
    def elevation_tolerance(self) -> float:
        """How far rounding may move an elevation, terrain's unit."""
        known = "mean" if is_survey(self.option("terrain.name")) else "truth"
        return ROUNDING * max(1.0, float(np.abs(self.maps[known]).max()))

    @cached_property
    def thirds(self) -> dict[str, Booleans]:
        """Nodes of the query grid in each third by local relief, by its name, shape (n,) each."""
        rows, columns = (int(nodes) for nodes in self.option("grid"))
        truth = self.maps["truth"].to_numpy().reshape(rows, columns)
        xmin, xmax, ymin, ymax = self.extent
        dy, dx = (ymax - ymin) / (rows - 1), (xmax - xmin) / (columns - 1)
        radius = max(RADIUS, dx, dy) * (1 + 1e-9)
        reach = min(int(radius / dy), rows - 1), min(int(radius / dx), columns - 1)
        padded = np.pad(truth, [(r, r) for r in reach], constant_values=np.nan)
        highest, lowest = truth.copy(), truth.copy()
        for i in range(2 * reach[0] + 1):
            for j in range(2 * reach[1] + 1):
                if np.hypot((i - reach[0]) * dy, (j - reach[1]) * dx) <= radius:
                    near = padded[i : i + rows, j : j + columns]
                    highest, lowest = np.fmax(highest, near), np.fmin(lowest, near)
        rank = pd.Series((highest - lowest).ravel()).rank(method="first").to_numpy() - 1
        third = np.floor(rank * len(CLASSES) / truth.size)
        return {name: third == index for index, name in enumerate(CLASSES)}

    @cached_property
    def judgements(self) -> Judgements:
        """Scores and flags of the samples so far as they stood after each epoch, if known."""
        return self.judge(self)


def read_mission(
    results_dir: Path,
    run: str,
    seed: int,
    terrains: Mapping[str, NDArray[Any]],
    epochs: Epochs,
    judge: Judge,
) -> StoredMission:
    """Read the YAML and the tables of a mission; the values' digest is a check of its own."""
    try:
        configuration = read_science(configuration_path(results_dir, run))
    except MisfitError as error:
        raise FaultError(f"runs/{run}.yaml: {error}") from error
    tables, footers, digests = {}, {}, {}
    for name in present_tables(results_dir, run, seed):
        try:
            table, footers[name], digests[name] = open_table(results_dir, name, run, seed)
        except RunError as error:
            raise FaultError(str(error)) from error
        tables[name] = table.to_pandas()
    return StoredMission(
        configuration, tables, footers=footers, digests=digests, run=run, seed=seed,
        terrains=terrains, epochs=epochs, judge=judge,
    )  # fmt: skip


def is_told(table: pd.DataFrame, column: Column) -> bool:
    """Tell whether a table has values in a column that an older version has not written."""
    return not column.may_be_missing or bool(table[column.name].notna().any())


def demand(holds: NDArray[np.bool_], describe: Callable[[int], str]) -> None:
    """Raise the description of the first entry that does not hold."""
    wrong = np.flatnonzero(~np.asarray(holds, dtype=bool))
    if len(wrong):
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        raise FaultError(describe(int(wrong[0])) + more)


def demand_close(name: str, found: Floats, expected: Any, allowed: Any) -> None:
    """Raise the first entry that differs from its expected value by more than is allowed."""
    wanted = np.broadcast_to(np.asarray(expected, dtype=np.float64), found.shape)
    demand(
        np.abs(found - wanted) <= allowed,
        lambda i: f"{name} {i} is {found[i]:.8g}, recomputed {wanted[i]:.8g}",
    )
