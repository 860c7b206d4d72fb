"""Made-up missions of any numbers, stored in the layout of the result tables."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from infoplan.config import (
    METHODS,
    TERRAIN_SCHEMAS,
    MissionConfig,
    terrain_kind,
)
from infoplan.study.columns import values_digest
from infoplan.study.identity import run_name
from infoplan.study.store import sealed
from infoplan.tables import TABLES

PROVENANCE: dict[str, Any] = {
    "started": "2030-01-02T03:04:05.000+00:00",
    "ended": "2030-01-02T03:05:05.000+00:00",
    "seconds": 60.0,
    "python": "3.11.7",
    "libraries": {"numpy": "2.0.0"},
    "cpu": "a processor",
    "platform": "a system",
    "blas": [],
    "git": None,
    "command": ["infoplan", "run"],
}
"""Where and when missions were made up."""

SIDE = 26
"""Nodes of the made-up query grid along a side of the workspace, 50 units."""


def truth(rows: int = SIDE, columns: int = SIDE) -> np.ndarray:
    """Elevations on the query grid: smooth in the west, rugged in the east, deviation 100."""
    i, j = np.mgrid[:rows, :columns]
    rough = np.where(j > columns // 2, (-1.0) ** (i + j) * 5.0, 0.02 * (i + j))
    return (rough - rough.mean()) / rough.std() * 100.0 + 1000.0


def store(
    folder: Path,
    method: str,
    rho: float = 0.1,
    scope: str = "batch",
    seed: int = 0,
    *,
    collected: Sequence[float] = (100, 1000, 2000),
    rmse: Sequence[float] | None = None,
    counts: Sequence[tuple[int, int, int, int]] | None = None,
    samples: dict[str, Any] | None = None,
    mean: np.ndarray | None = None,
    std: float = 50.0,
    terrain: str = "helens",
    schema_version: int = 1,
    **options: Any,
) -> str:
    """Store one mission, and return its run's name.

    Parameters
    ----------
    folder
        Results folder.
    method, rho, scope, seed
        Which; the method as ``uct-copod``.
    collected, rmse, counts
        The curve (level at 500 if none is given), and its rows' tp, fp, fn, tn.
    samples
        Columns of the samples table that are not the made-up ones.
    mean, std
        Final mean (shape of `truth`) and standard deviation.
    terrain, schema_version
        What the footer says.
    **options
        Options of the configuration; a double underscore stands for the dot.
    """
    configuration = configured(method, rho, scope, terrain, int(collected[-1]), options)
    planner, detector = method.split("-")
    scope = configuration["detector"]["scope"]
    run = run_name(configuration)
    rows = len(collected)
    tp, fp, fn, tn = np.array(counts or [(0, 0, 0, 0)] * rows).T
    curve = {
        "planner": [planner] * rows,
        "detector": [detector] * rows,
        "scope": [scope] * rows,
        "rho": [rho] * rows,
        "terrain": [terrain] * rows,
        "seed": [seed] * rows,
        "epoch": range(rows),
        "collected": collected,
        "rmse": np.full(rows, 500.0) if rmse is None else np.asarray(rmse, dtype=float),
        "tp": tp,
        "fp": fp,
        "fn": fn,
        "tn": tn,
        **{f"{part}_seconds": [0.25] * rows for part in ("plan", "fit", "predict", "detect")},
    }
    grid = configuration["grid"]
    y, x = (axis.ravel() for axis in np.mgrid[0 : 50 : grid[0] * 1j, 0 : 50 : grid[1] * 1j])
    maps = {
        "seed": [seed] * len(x),
        "x1": x,
        "x2": y,
        "truth": truth(*grid).ravel(),
        "mean": (truth(*grid) if mean is None else mean).ravel(),
        "std": np.full(len(x), std),
        "outlier_density": np.zeros(len(x)),
    }
    tables = {"curves": curve, "samples": made_samples(seed, samples or {}), "maps": maps}
    footer = {
        "schema_version": schema_version,
        "mission": f"{run} {seed}",
        "run": run,
        "seed": seed,
        "terrain": {name: configuration["terrain"][name] for name in ("name", "sha256")},
        "configuration": configuration,
        **PROVENANCE,
    }
    for name, columns in tables.items():
        n = len(columns["seed"])
        table = pa.table(
            {
                key: pa.array(columns.get(key, np.zeros(n)), column.field.type, safe=False)
                for key, column in TABLES[name].columns.items()
            }
        )
        footer["values_sha256"] = values_digest(table)
        path = folder / name / f"run={run}" / f"seed={seed}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table.replace_schema_metadata({"infoplan": sealed(footer)}), path)
    return run


def configured(
    method: str, rho: float, scope: str, terrain: str, budget: int, options: dict[str, Any]
) -> dict[str, Any]:
    """Return the nested configuration of a run."""
    planner, detector = method.split("-")
    config = MissionConfig(rho=rho, budget=budget, grid=[SIDE, SIDE])
    for group, name in {"planner": planner, "detector": detector}.items():
        if group not in options:  # what is not built in is given with all its options
            setattr(config, group, METHODS[group][name])
    configuration = asdict(config)
    configuration["detector"]["scope"] = "batch" if detector in ("none", "best") else scope
    schema = TERRAIN_SCHEMAS[terrain_kind(terrain)]
    configuration["terrain"] = {
        item.name: getattr(schema(), item.name)
        for item in fields(schema)
        if item.metadata["science"]
    } | {"name": terrain, "unit": "ft", "sha256": "0" * 64}
    configuration["numerics_version"] = options.pop("numerics_version", 1)
    for name, value in options.items():
        *groups, key = name.split("__")
        place = configuration
        for group in groups:
            place = place[group]
        place[key] = value
    return configuration


def made_samples(seed: int, given: dict[str, Any]) -> dict[str, Any]:
    """Four samples in the middle, one of the pilot, unless others are given."""
    n = len(next(iter(given.values()))) if given else 4
    samples: dict[str, Any] = {
        "seed": [seed] * n,
        "epoch": [0] + [1] * (n - 1),
        "x1": np.linspace(20.0, 30.0, n),
        "x2": np.full(n, 25.0),
        "heading": np.zeros(n),
        "truth": np.full(n, 1000.0),
        "measured": np.linspace(990.0, 1010.0, n),
        "score": np.full(n, np.nan),
        "is_outlier": np.zeros(n, dtype=bool),
        "flagged": np.zeros(n, dtype=bool),
    }
    samples |= given
    samples["used"] = ~np.asarray(samples["flagged"])
    return samples
