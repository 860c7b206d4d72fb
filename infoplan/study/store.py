"""The result tables: a Hive-partitioned Parquet dataset with provenance in the footers.

A mission's three tables become visible one after the other when all three are on the disk, its
curve last: a curve means that the mission is done. `inspect` tells whether what is there is whole.
"""

import errno
import hashlib
import json
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from infoplan.errors import RunError, UsageError
from infoplan.methods import method_label
from infoplan.study.identity import SCHEMA_VERSION, Run, digest

if TYPE_CHECKING:
    from infoplan.mission import CurveRow, Mission

COLUMNS: dict[str, tuple[str, ...]] = {
    "curves": (
        "planner", "detector", "scope", "rho", "terrain", "seed", "epoch", "collected", "accepted",
        "rmse", "mae", "nlpd", "coverage95", "tp", "fp", "fn", "tn", "amplitude", "lengthscale_1",
        "lengthscale_2", "noise_std", "jitter", "lml", "plan_seconds", "fit_seconds",
        "predict_seconds", "detect_seconds",
    ),
    "samples": (
        "seed", "epoch", "x1", "x2", "heading", "truth", "measured", "score", "is_outlier",
        "flagged", "used",
    ),
    "maps": ("seed", "x1", "x2", "truth", "mean", "std", "outlier_density"),
}  # fmt: skip
"""Columns that each table has at least."""

FOOTER = b"infoplan"
"""Key of the JSON document in a table's Parquet metadata."""

SCRATCH = ".scratch"
"""Folder of files that are being written: some readers take every file in a table's folder."""

STALE_SECONDS = 3600.0
"""A scratch file that old was left behind by a process that died."""


@dataclass
class MissionTables:
    """The three tables of a finished mission."""

    curves: pa.Table
    samples: pa.Table
    maps: pa.Table


@dataclass(frozen=True)
class Stored:
    """What is there of a mission.

    Attributes
    ----------
    state
        ``done``; ``missing``: there is no curve; ``broken``: there is one that cannot be trusted.
    reason
        Of a broken mission: which file, and what is wrong with it.
    footer
        Provenance of a mission that is done.
    """

    state: str
    reason: str = ""
    footer: dict[str, Any] = field(default_factory=dict)


def build_tables(run: Run, mission: "Mission", rows: "list[CurveRow]") -> MissionTables:
    """Lay a finished mission out as tables; columns as the README lists them."""
    config, seed, n = run.config, mission.seed, len(rows)
    labels = {
        "planner": method_label(config.planner),
        "detector": method_label(config.detector),
        "scope": config.detector.scope,
        "rho": config.rho,
        "terrain": run.terrain.name,
    }
    curves = {name: [value] * n for name, value in labels.items()}
    curves["seed"] = [seed] * n
    for item in fields(rows[0]):
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


def failure_path(results_dir: Path, run: str, seed: int) -> Path:
    """Path of the traceback of a mission that failed and has not succeeded since."""
    return results_dir / "failures" / run / f"seed={seed}.txt"


def list_missions(results_dir: Path) -> dict[str, list[int]]:
    """List the runs that have curves, whole or not, with their seeds in order."""
    return _listed(results_dir, "curves/run=*/seed=*.parquet", "run=")


def list_failures(results_dir: Path) -> dict[str, list[int]]:
    """List the runs that have failed missions, with the seeds in order."""
    return _listed(results_dir, "failures/*/seed=*.txt", "")


def list_foreign(results_dir: Path) -> list[Path]:
    """List files in the folders of the tables that are no mission's; readers may trip over them."""
    found = []
    for table in COLUMNS:
        for path in sorted((results_dir / table).rglob("*")):
            run, seed = path.parent.name, path.name
            ours = run.startswith("run=") and path.parent.parent == results_dir / table
            ours = ours and seed.startswith("seed=") and seed[5:].removesuffix(".parquet").isdigit()
            if path.is_file() and not (ours and seed.endswith(".parquet")):
                found.append(path)
    return found


def inspect(results_dir: Path, run: str, seed: int) -> Stored:
    """Look whether a mission is done and its three tables are whole, belong to it and together.

    All values are read and compared with their digest, in about two milliseconds.
    """
    if not table_path(results_dir, "curves", run, seed).is_file():
        return Stored("missing")
    tables, footers = {}, {}
    for name in COLUMNS:
        path = table_path(results_dir, name, run, seed)
        try:
            tables[name], footers[name] = _read(path)
        except RunError as error:
            return Stored("broken", str(error))
        wrong = _disagreement(name, tables[name], footers[name], run, seed)
        if wrong:
            return Stored("broken", f"{path} {wrong}")
    if len({footer.get("mission") for footer in footers.values()}) > 1:
        return Stored("broken", f"the tables of {run} seed {seed} are not of one mission")
    return Stored("done", footer=footers["curves"])


def read_table(results_dir: Path, table: str, run: str, seed: int) -> pa.Table:
    """Read one table of a mission, its values compared with their digest.

    Raises
    ------
    RunError
        If the file is missing, damaged or none of infoplan's.
    """
    return _read(table_path(results_dir, table, run, seed))[0]


def values_digest(table: pa.Table) -> str:
    """SHA-256 of all names and values of a table, whatever way a file stores them."""
    hashed = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns, strict=True):
        hashed.update(name.encode())
        if pa.types.is_string(column.type):
            hashed.update("\0".join(map(str, column.to_pylist())).encode())
        else:
            hashed.update(column.to_numpy().tobytes())
    return hashed.hexdigest()


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
    except (OSError, pa.ArrowException, KeyError, ValueError) as error:
        raise RunError(
            f"{path} is no readable table of infoplan's: delete it and run its configuration again"
        ) from error
    return document


def prepare(results_dir: Path) -> None:
    """Make the results folder, try to write to it, and sweep out what dead processes left.

    Raises
    ------
    UsageError
        If it cannot be written.
    """
    scratch = results_dir / SCRATCH
    probe = scratch / uuid.uuid4().hex
    try:
        scratch.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"infoplan")
        probe.unlink()
    except OSError as error:
        with suppress(OSError):
            probe.unlink()
        raise UsageError(
            f"results_dir={results_dir} cannot be written ({os.strerror(error.errno or errno.EIO)})"
            ": name a folder with room that you may write to"
        ) from error
    for leftover in scratch.iterdir():
        with suppress(OSError):  # another process may be quicker
            if time.time() - leftover.stat().st_mtime > STALE_SECONDS:
                leftover.unlink()


def save_configuration(results_dir: Path, run: Run) -> bool:
    """Write ``runs/<run>.yaml`` unless it is there.

    Returns
    -------
    bool
        Whether a file was there that held something else, and was replaced.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    path = configuration_path(results_dir, run.name)
    content = yaml.safe_dump(run.science, sort_keys=False).encode()
    with suppress(OSError):
        if path.read_bytes() == content:
            return False
    there = path.exists()
    _write(results_dir, path, content)
    return there


def save_mission(
    results_dir: Path, run: Run, seed: int, tables: MissionTables, footer: dict[str, Any]
) -> None:
    """Store a mission's tables, all or none, and forget its earlier failure.

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
        "mission": uuid.uuid4().hex,
        "run": run.name,
        "seed": seed,
        "terrain": {"name": run.terrain.name, "sha256": run.terrain.sha256},
        "configuration": run.science,
        **footer,
    }
    written: dict[Path, Path] = {}
    try:
        for name in ("samples", "maps", "curves"):
            path = table_path(results_dir, name, run.name, seed)
            table: pa.Table = getattr(tables, name)
            footer = {**document, "values_sha256": values_digest(table)}
            table = table.replace_schema_metadata({FOOTER: json.dumps(footer).encode()})
            scratch = written[path] = _scratch(results_dir)
            with _told(path):
                pq.write_table(table, scratch)
                _flush(scratch)
        for path, scratch in written.items():
            with _told(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                scratch.replace(path)
    finally:
        for scratch in written.values():
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
    with suppress(OSError):
        failure_path(results_dir, run.name, seed).unlink(missing_ok=True)


def save_failure(results_dir: Path, run: str, seed: int, text: str) -> Path:
    """Keep the traceback of a failed mission; returns its path.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    path = failure_path(results_dir, run, seed)
    _write(results_dir, path, text.encode())
    return path


def _read(path: Path) -> tuple[pa.Table, dict[str, Any]]:
    """Read a table and its footer, and check its values."""
    again = "run its configuration again"
    try:
        with pq.ParquetFile(path) as file:
            table = file.read(use_threads=False)
        digest_now = values_digest(table)
    except FileNotFoundError as error:
        raise RunError(f"{path} is missing: {again}") from error
    except (OSError, pa.ArrowException, ValueError) as error:  # ValueError: mangled text
        number = getattr(error, "errno", None)
        reason = os.strerror(number) if number else "it is no whole Parquet file"
        raise RunError(f"{path} cannot be read ({reason}): {again}") from error
    try:
        footer = json.loads((table.schema.metadata or {})[FOOTER])
    except (KeyError, ValueError) as error:
        raise RunError(f"{path} is no table of infoplan's: {again}") from error
    if footer.get("values_sha256") != digest_now:
        raise RunError(f"{path} does not hold the values that were written: {again}")
    return table, footer


def _disagreement(name: str, table: pa.Table, footer: dict[str, Any], run: str, seed: int) -> str:
    """Say what is wrong with a readable table; empty if nothing is."""
    if footer.get("schema_version") != SCHEMA_VERSION:
        return f"has schema version {footer.get('schema_version')} instead of {SCHEMA_VERSION}"
    if (footer.get("run"), footer.get("seed")) != (run, seed):
        return f"belongs to {footer.get('run')} seed {footer.get('seed')}"
    if digest(footer.get("configuration", {})) != run.rsplit("-", 1)[-1]:
        return "holds another configuration than its run's"
    if absent := [column for column in COLUMNS[name] if column not in table.column_names]:
        return f"has no column {absent[0]}"
    if len(table) == 0 or set(table["seed"].to_numpy()) != {seed}:
        return f"holds other rows than those of seed {seed}"
    return ""


def _listed(results_dir: Path, pattern: str, prefix: str) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for path in sorted(results_dir.glob(pattern)):
        seed = path.stem.removeprefix("seed=")
        if seed.isdigit():
            found.setdefault(path.parent.name.removeprefix(prefix), []).append(int(seed))
    return {run: sorted(seeds) for run, seeds in found.items()}


def _scratch(results_dir: Path) -> Path:
    return results_dir / SCRATCH / uuid.uuid4().hex


def _write(results_dir: Path, path: Path, content: bytes) -> None:
    scratch = _scratch(results_dir)
    try:
        with _told(path):
            scratch.parent.mkdir(parents=True, exist_ok=True)
            scratch.write_bytes(content)
            _flush(scratch)
            path.parent.mkdir(parents=True, exist_ok=True)
            scratch.replace(path)
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    with path.open("rb+") as stream:
        os.fsync(stream.fileno())


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn a failure of the file system into one sentence about the file that was meant."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise RunError(
            f"{path} could not be written ({reason}): make room or name another results_dir, "
            "then run the same command again; what is finished is kept"
        ) from error
