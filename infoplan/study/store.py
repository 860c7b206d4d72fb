"""The result tables: a Hive-partitioned Parquet dataset with provenance in the footers."""

import errno
import json
import os
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from infoplan.errors import RunError, UsageError
from infoplan.mission import CurveRow, Mission
from infoplan.study.identity import SCHEMA_VERSION, Run

TABLES = ("curves", "samples", "maps")
FOOTER = b"infoplan"
"""Key of the JSON document in a table's Parquet metadata."""


@dataclass
class MissionTables:
    """The three tables of a finished mission."""

    curves: pa.Table
    samples: pa.Table
    maps: pa.Table


def build_tables(run: Run, mission: Mission, rows: list[CurveRow]) -> MissionTables:
    """Lay a finished mission out as tables; columns as the README lists them."""
    config, seed, n = run.config, mission.seed, len(rows)
    labels = {
        "planner": config.planner.name,
        "detector": config.detector.name,
        "scope": config.detector.scope,
        "rho": config.rho,
        "terrain": run.terrain.name,
    }
    curves = {name: [value] * n for name, value in labels.items()}
    curves["seed"] = [seed] * n
    for item in fields(CurveRow):
        curves[item.name] = [getattr(row, item.name) for row in rows]
    samples = mission.samples
    return MissionTables(
        curves=pa.table(curves),
        samples=pa.table(
            {
                "seed": np.full(len(samples), seed),
                "epoch": samples.epoch,
                "x1": samples.x[:, 0],
                "x2": samples.x[:, 1],
                "heading": samples.heading,
                "truth": samples.truth,
                "measured": samples.measured,
                "score": samples.score,
                "is_outlier": samples.is_outlier,
                "flagged": samples.flagged,
                "used": ~samples.flagged,
            }
        ),
        maps=pa.table(
            {
                "seed": np.full(len(mission.grid), seed),
                "x1": mission.grid[:, 0],
                "x2": mission.grid[:, 1],
                "truth": mission.grid_truth,
                "mean": mission.mean,
                "std": mission.latent_std,
                "outlier_density": mission.outlier_density().ravel(),
            }
        ),
    )


def table_path(results_dir: Path, table: str, run: str, seed: int) -> Path:
    """Path of one table of a mission."""
    return results_dir / table / f"run={run}" / f"seed={seed}.parquet"


def configuration_path(results_dir: Path, run: str) -> Path:
    """Path of a run's resolved configuration."""
    return results_dir / "runs" / f"{run}.yaml"


def is_done(results_dir: Path, run: str, seed: int) -> bool:
    """Whether a mission is finished: its curve, written last, is there."""
    return table_path(results_dir, "curves", run, seed).is_file()


def prepare(results_dir: Path) -> None:
    """Make the results folder and try to write to it.

    Raises
    ------
    UsageError
        If it cannot be written.
    """
    probe = results_dir / f".{uuid.uuid4().hex}"
    try:
        results_dir.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"infoplan")
        probe.unlink()
    except OSError as error:
        with suppress(OSError):
            probe.unlink()
        raise UsageError(
            f"results_dir={results_dir} cannot be written ({os.strerror(error.errno or errno.EIO)})"
            ": name a folder with room that you may write to"
        ) from error


def save_configuration(results_dir: Path, run: Run) -> None:
    """Write ``runs/<run>.yaml``, once."""
    path = configuration_path(results_dir, run.name)
    if not path.exists():
        text = yaml.safe_dump(run.science, sort_keys=False)
        _write_whole(path, lambda scratch: _write_text(scratch, text))


def save_mission(
    results_dir: Path, run: Run, seed: int, tables: MissionTables, footer: dict[str, Any]
) -> None:
    """Store a mission's tables, each whole or not at all, the curve last.

    Parameters
    ----------
    results_dir, run, seed
        Where, and whose.
    tables
        The three tables.
    footer
        Provenance, stored as JSON in each table's Parquet metadata.

    Raises
    ------
    RunError
        If a file cannot be written.
    """
    save_configuration(results_dir, run)
    document = {
        "schema_version": SCHEMA_VERSION,
        "run": run.name,
        "seed": seed,
        "terrain": {"name": run.terrain.name, "sha256": run.terrain.sha256},
        "configuration": run.science,
        **footer,
    }
    metadata = {FOOTER: json.dumps(document).encode()}
    for name in ("samples", "maps", "curves"):
        table: pa.Table = getattr(tables, name)
        table = table.replace_schema_metadata(metadata)
        path = table_path(results_dir, name, run.name, seed)
        _write_whole(path, lambda scratch, table=table: pq.write_table(table, scratch))


def read_footer(path: Path) -> dict[str, Any]:
    """Read the provenance of a table.

    Raises
    ------
    RunError
        If the file is no table of infoplan's.
    """
    try:
        metadata = pq.read_schema(path).metadata or {}
        document: dict[str, Any] = json.loads(metadata[FOOTER])
    except (OSError, pa.ArrowInvalid, KeyError, ValueError) as error:
        raise RunError(
            f"{path} is no readable table of infoplan's: delete it and run its configuration again"
        ) from error
    return document


def _write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write a dot-named file beside the target and move it there when it is complete."""
    scratch = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(scratch)
        with scratch.open("rb") as stream:
            os.fsync(stream.fileno())
        scratch.replace(path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise RunError(
            f"{path} could not be written ({reason}): make room or name another results_dir, "
            "then run the same command again; what is finished is kept"
        ) from error
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
