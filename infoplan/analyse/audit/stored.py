"""A stored mission as a stranger reads it, and how a check says that something is wrong."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Booleans = NDArray[np.bool_]

COLUMNS: dict[str, dict[str, str]] = {
    "curves": {
        **dict.fromkeys(["planner", "detector", "scope", "terrain"], "text"),
        **dict.fromkeys(["seed", "epoch", "collected", "accepted"], "integer"),
        **dict.fromkeys(["tp", "fp", "fn", "tn"], "integer"),
        **dict.fromkeys(["rho", "rmse", "mae", "nlpd", "coverage95", "lml"], "double"),
        **dict.fromkeys(["amplitude", "lengthscale_1", "lengthscale_2"], "double"),
        **dict.fromkeys(["noise_std", "jitter"], "double"),
        **dict.fromkeys(["plan_seconds", "fit_seconds"], "double"),
        **dict.fromkeys(["predict_seconds", "detect_seconds"], "double"),
    },
    "samples": {
        **dict.fromkeys(["seed", "epoch"], "integer"),
        **dict.fromkeys(["x1", "x2", "heading", "truth", "measured", "score"], "double"),
        **dict.fromkeys(["is_outlier", "flagged", "used"], "boolean"),
    },
    "maps": {
        "seed": "integer",
        **dict.fromkeys(["x1", "x2", "truth", "mean", "std", "outlier_density"], "double"),
    },
}
"""Columns that every table must have, and what they hold; more may follow."""

CHANCE = 1e-6
"""How rarely an honest mission may fail a test of randomness."""

SIGMAS = 6.0
"""Sensor noise, in standard deviations, that is allowed for where it cannot be known."""

ROUNDING = 1e-9
"""Relative difference that the order of a few additions may explain."""

OF_THE_MODEL = (
    "amplitude", "lengthscale_1", "lengthscale_2", "noise_std", "jitter", "lml",
)  # fmt: skip
"""Columns of the curve that a model of the user's own need not have."""


class FaultError(Exception):
    """A check fails; the message is the finding's detail."""


@dataclass(frozen=True)
class StoredMission:
    """A stored mission as it was read."""

    configuration: dict[str, Any]
    curves: pd.DataFrame
    samples: pd.DataFrame
    maps: pd.DataFrame
    footers: dict[str, dict[str, Any]]
    run: str
    seed: int
    terrains: Mapping[str, NDArray[Any]]

    def option(self, name: str) -> Any:
        """Look an option up by its dotted name."""
        value: Any = self.configuration
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
        return ROUNDING * max(1.0, float(np.abs(self.maps["truth"]).max()))

    @cached_property
    def judgements(self) -> list[tuple[Floats, Booleans] | None]:
        """Scores and flags of the samples so far as they stood after each epoch, if known."""
        from infoplan.analyse.audit.detector import replay_detector

        return replay_detector(self)


def stored_missions(results_dir: Path) -> list[tuple[str, int]]:
    """Find the run and seed of every finished mission: one whose curve is there."""
    missions = []
    for path in results_dir.glob("curves/run=*/seed=*.parquet"):
        seed = path.stem.removeprefix("seed=")
        if seed.isdecimal():
            missions.append((path.parent.name.removeprefix("run="), int(seed)))
    return sorted(missions)


def read_mission(
    results_dir: Path, run: str, seed: int, terrains: Mapping[str, NDArray[Any]]
) -> StoredMission:
    """Read the YAML and the three tables of a mission, and check their columns."""
    path = results_dir / "runs" / f"{run}.yaml"
    try:
        configuration = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FaultError(f"runs/{path.name} cannot be read ({type(error).__name__})") from error
    if not isinstance(configuration, dict):
        raise FaultError(f"runs/{path.name} is no mapping of options")
    tables, footers = {}, {}
    for table in COLUMNS:
        tables[table], footers[table] = _read_table(results_dir, table, run, seed)
    return StoredMission(
        configuration, **tables, footers=footers, run=run, seed=seed, terrains=terrains
    )


def _read_table(
    results_dir: Path, name: str, run: str, seed: int
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read a table and the JSON document in its footer (empty if there is none)."""
    path = results_dir / name / f"run={run}" / f"seed={seed}.parquet"
    try:
        # The file alone: reading it as a data set would add the partition's columns.
        with pq.ParquetFile(path) as file:
            table = file.read()
        footer = json.loads((table.schema.metadata or {}).get(b"infoplan", b"{}"))
    except (OSError, pa.ArrowException, ValueError) as error:
        raise FaultError(f"{name} cannot be read ({type(error).__name__})") from error
    if "run" in table.column_names:
        raise FaultError(f"{name} holds a column run, which is a partition and no column")
    for column, kind in COLUMNS[name].items():
        if table.column_names.count(column) != 1:
            raise FaultError(f"{name} has not exactly one column {column}")
        if not _is_kind(table.schema.field(column).type, kind):
            found = table.schema.field(column).type
            raise FaultError(f"{name}.{column} holds {found}, not {kind}")
        # A score that was never given is NaN, which some writers store as a missing value.
        if table[column].null_count and column != "score":
            raise FaultError(f"{name}.{column} has {table[column].null_count} missing values")
    if table.num_rows == 0:
        raise FaultError(f"{name} has no rows")
    return table.to_pandas(), footer if isinstance(footer, dict) else {}


def _is_kind(found: Any, kind: str) -> bool:
    """Tell whether an Arrow type holds what a column must hold."""
    if pa.types.is_dictionary(found):
        found = found.value_type
    if kind == "text":
        return bool(pa.types.is_string(found) or pa.types.is_large_string(found))
    if kind == "integer":
        return bool(pa.types.is_integer(found))
    return bool(found == (pa.float64() if kind == "double" else pa.bool_()))


def demand(holds: NDArray[np.bool_], describe: Callable[[int], str]) -> None:
    """Raise the description of the first entry that does not hold."""
    wrong = np.flatnonzero(~np.asarray(holds, dtype=bool))
    if len(wrong):
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        raise FaultError(describe(int(wrong[0])) + more)


def demand_close(name: str, found: Floats, expected: Any, allowed: float) -> None:
    """Raise the first entry that differs from its expected value by more than is allowed."""
    wanted = np.broadcast_to(np.asarray(expected, dtype=np.float64), found.shape)
    demand(
        np.abs(found - wanted) <= allowed,
        lambda i: f"{name} {i} is {found[i]:.8g}, recomputed {wanted[i]:.8g}",
    )
