"""The result tables: a Hive-partitioned Parquet dataset with provenance in the footers.

A mission's tables become visible one after the other when all of them are on the disk, its
curve last: a curve means that the mission is done. `inspect` tells whether what is there is whole.
"""

import errno
import json
import math
import os
import re
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import yaml

from infoplan.config import is_survey
from infoplan.errors import RunError, UsageError
from infoplan.files import read_regular, remedy, writing
from infoplan.study.columns import canonical, completed, values_digest
from infoplan.study.identity import Run
from infoplan.study.mission_tables import MissionTables
from infoplan.study.provenance import git_state, provenance
from infoplan.study.records import Footer, MisfitError, footer_digest, read_document
from infoplan.tables import (
    DURATIONS,
    MAX_BYTES,
    MAX_COLUMNS,
    MAX_ROWS,
    MAX_SEED_DIGITS,
    SCHEMA_VERSION,
    TABLES,
)
from infoplan.wording import harmless

FOOTER = b"infoplan"
"""Key of the JSON document in a table's Parquet metadata."""

SCRATCH = ".scratch"
"""Folder of files that are being written: some readers take every file in a table's folder."""

STALE_SECONDS = 3600.0
"""A scratch file that old was left behind by a process that died."""


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
        Provenance of a mission that is done; None of others.
    """

    state: str
    reason: str = ""
    footer: Footer | None = None


def table_path(results_dir: Path, table: str, run: str, seed: int) -> Path:
    """Path of one table of a mission."""
    return results_dir / table / f"run={run}" / f"seed={seed}.parquet"


def configuration_path(results_dir: Path, run: str) -> Path:
    """Path of a run's resolved configuration."""
    return results_dir / "runs" / f"{run}.yaml"


def failure_path(results_dir: Path, run: str, seed: int, what: str = "") -> Path:
    """Path of the traceback of a mission, or of what else was computed of it, that has failed."""
    return results_dir / "failures" / run / f"{what}seed={seed}.txt"


def list_missions(results_dir: Path) -> dict[str, list[int]]:
    """List the runs that have curves, whole or not, with their seeds in order."""
    return _listed(results_dir, "curves/run=*/seed=*.parquet", "run=")


def list_failures(results_dir: Path) -> dict[str, list[int]]:
    """List the runs that have failed missions, with the seeds in order."""
    return _listed(results_dir, "failures/*/seed=*.txt", "")


def list_foreign(results_dir: Path) -> list[Path]:
    """List files in the folders of the tables that are no mission's; readers may trip over them."""
    found = []
    for table in TABLES:
        for path in sorted((results_dir / table).rglob("*")):
            run = path.parent
            ours = run.name.startswith("run=") and run.parent == results_dir / table
            ours = ours and path.suffix == ".parquet" and seed_of(path.stem) is not None
            if not ours and (path.is_symlink() or not path.is_dir()):
                found.append(path)
    return found


def seed_of(stem: str) -> int | None:
    """Seed that the name of a mission's file tells, as in ``seed=3``; None if it is no such."""
    digits = stem.removeprefix("seed=")
    if digits == stem or not re.fullmatch(r"0|[1-9][0-9]*", digits):
        return None
    return int(digits) if len(digits) <= MAX_SEED_DIGITS else None


def inspect(results_dir: Path, run: str, seed: int) -> Stored:
    """Look whether a mission is done and its tables are whole, belong to it and together.

    All values are read and compared with their digest, in a few milliseconds.
    """
    if not os.path.lexists(table_path(results_dir, "curves", run, seed)):
        return Stored("missing")
    footers = {}
    try:
        for name in present_tables(results_dir, run, seed):
            _, footers[name] = _read(results_dir, name, run, seed)
    except RunError as error:
        return Stored("broken", str(error))
    if wrong := disagreement(list(footers.values())):
        return Stored(
            "broken",
            harmless(f"the tables of {run} seed {seed} are not of one mission: their {wrong}"),
        )
    return Stored("done", footer=footers["curves"])


def present_tables(results_dir: Path, run: str, seed: int) -> list[str]:
    """List the tables that a mission must have, and those of the others that it was stored with."""
    return [
        name
        for name, table in TABLES.items()
        if not table.derived
        and (not table.may_be_missing or os.path.lexists(table_path(results_dir, name, run, seed)))
    ]


def inspect_derived(results_dir: Path, name: str, run: str, seed: int) -> Stored:
    """Look whether a derived table is there, whole, and of the mission that is stored now.

    Raises
    ------
    RunError
        If the mission's curve cannot be read.
    """
    if not os.path.lexists(table_path(results_dir, name, run, seed)):
        return Stored("missing")
    of_mission = read_footer(table_path(results_dir, "curves", run, seed))
    try:
        _, footer = _read(results_dir, name, run, seed)
    except RunError as error:
        return Stored("broken", str(error))
    if footer.mission != of_mission.mission:
        return Stored("missing")  # of a flight before
    return Stored("done", footer=footer)


def disagreement(footers: Sequence[Footer]) -> str:
    """Say in what the footers of a mission's tables differ; empty if in nothing."""
    first, *others = (footer.story() for footer in footers)
    differing = [name for name in first if any(other[name] != first[name] for other in others)]
    return f"footers differ in {', '.join(differing)}" if differing else ""


def read_table(results_dir: Path, table: str, run: str, seed: int) -> pa.Table:
    """Read one table of a mission, values and footer compared with their digests.

    Raises
    ------
    RunError
        If the file is missing, damaged or none of infoplan's.
    """
    return _read(results_dir, table, run, seed)[0]


def read_footer(path: Path) -> Footer:
    """Read the provenance of a table; of its values nothing is looked at.

    Raises
    ------
    RunError
        If the file is no table of infoplan's, or of another mission than its path says.
    """
    with _broken(path), _opened(path) as file:
        footer = _footer(file)
        _demand_owner(footer, path)
        return footer


def open_table(results_dir: Path, name: str, run: str, seed: int) -> tuple[pa.Table, Footer, str]:
    """Read one table of a mission and its footer, checked but for the digest of the values.

    Sizes are taken from the file's metadata before anything is unpacked.

    Returns
    -------
    table : pyarrow.Table
        Its columns have the types of `TABLES`, in whatever kindred type they are stored; one that
        the file lacks is null.
    footer : Footer
    digest : str
        `values_digest` of what the file holds.

    Raises
    ------
    RunError
        Names the file, and what is wrong with it.
    """
    path = table_path(results_dir, name, run, seed)
    with _broken(path), _opened(path) as file:
        footer = _footer(file)
        _demand_owner(footer, path)
        _demand_size(file.metadata, name, footer)
        unknown = is_survey(footer.terrain["name"])
        table = canonical(file.read(use_threads=False), name, unknown)
        if not pc.all(pc.equal(table["seed"], seed)).as_py():
            raise MisfitError(f"it holds other rows than those of seed {seed}")
        return completed(table, name), footer, values_digest(table)


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
        reason = os.strerror(error.errno or errno.EIO)
        raise UsageError(
            harmless(f"results_dir={results_dir} cannot be written ({reason}): {remedy(error)}")
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
    with suppress(OSError, UsageError):
        if read_regular(path, len(content)) == content:
            return False
    there = os.path.lexists(path)
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
        All of them.
    footer
        Provenance, stored as JSON in each table's Parquet metadata. What is left out of it is this
        process, now.

    Raises
    ------
    RunError
        If a file cannot be written, or would not be read again.
    """
    save_configuration(results_dir, run)
    document = {
        "schema_version": SCHEMA_VERSION,
        "mission": uuid.uuid4().hex,
        "run": run.name,
        "seed": seed,
        "terrain": {"name": run.terrain.name, "sha256": run.terrain.sha256},
        "configuration": run.science,
        **_here_and_now(tables),
        **footer,
    }
    # The curve comes last: where it is, all of the mission is.
    laid_out = {name: table for name, table in reversed(vars(tables).items()) if table is not None}
    _write_tables(results_dir, laid_out, run.name, seed, document)
    with suppress(OSError):
        failure_path(results_dir, run.name, seed).unlink(missing_ok=True)


def save_derived(results_dir: Path, name: str, run: str, seed: int, table: pa.Table) -> None:
    """Store a table that was computed from a stored mission, under the mission's own footer.

    Raises
    ------
    RunError
        If the mission's curve cannot be read, or the file cannot be written.
    """
    footer = read_footer(table_path(results_dir, "curves", run, seed))
    _write_tables(results_dir, {name: table}, run, seed, footer.story())


def _write_tables(
    results_dir: Path, tables: dict[str, pa.Table], run: str, seed: int, document: dict[str, Any]
) -> None:
    """Write tables of a mission with a footer, all of them before any is seen, in their order."""
    written: dict[Path, Path] = {}
    try:
        for name, table in tables.items():
            path = table_path(results_dir, name, run, seed)
            text = sealed({**document, "values_sha256": values_digest(table)})
            try:
                read_document(text)
            except MisfitError as error:
                raise RunError(
                    f"{run} seed {seed} would not be read again, {error}: it is not stored"
                ) from error
            table = table.replace_schema_metadata({FOOTER: text})
            scratch = written[path] = _scratch(results_dir)
            with _told(path), scratch.open("wb") as stream:
                pq.write_table(table, stream)
                _flush(stream)
        for path, scratch in written.items():
            with _told(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                scratch.replace(path)
    finally:
        for scratch in written.values():
            with suppress(OSError):
                scratch.unlink(missing_ok=True)


def sealed(document: dict[str, Any]) -> bytes:
    """Write a footer down, with the digest of it."""
    return json.dumps({**document, "footer_sha256": footer_digest(document)}).encode()


def _here_and_now(tables: MissionTables) -> dict[str, Any]:
    """Give the provenance of a mission that has just been flown here."""
    curves = tables.curves
    seconds = sum(float(pc.sum(curves[name]).as_py() or 0.0) for name in DURATIONS)
    now = datetime.now(UTC)
    return provenance() | {
        "started": (now - timedelta(seconds=seconds)).isoformat(timespec="milliseconds"),
        "ended": now.isoformat(timespec="milliseconds"),
        "seconds": seconds,
        "git": git_state(),
        "command": sys.orig_argv,
    }


def save_failure(results_dir: Path, run: str, seed: int, text: str, what: str = "") -> Path:
    """Keep the traceback of a failed mission, as `failure_path` names it; returns its path.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    path = failure_path(results_dir, run, seed, what)
    _write(results_dir, path, text.encode())
    return path


def _read(results_dir: Path, name: str, run: str, seed: int) -> tuple[pa.Table, Footer]:
    """Read a table and its footer, and check its values."""
    table, footer, digest = open_table(results_dir, name, run, seed)
    with _broken(table_path(results_dir, name, run, seed)):
        if footer.values_sha256 != digest:
            raise MisfitError("it does not hold the values that were written")
    return table, footer


@contextmanager
def _broken(path: Path) -> Iterator[None]:
    """Turn whatever is wrong with a table into one sentence about its file."""
    again = "run its configuration again"
    try:
        yield
    except FileNotFoundError as error:
        if path.is_symlink():
            raise RunError(harmless(f"{path} is a link to nowhere: {again}")) from error
        raise RunError(harmless(f"{path} is missing: {again}")) from error
    except UsageError as error:
        # What stands in a table's place cannot be written over if it is a folder.
        reason = str(error).removesuffix(": name a file").removeprefix(f"{path} ")
        raise RunError(harmless(f"{path} {reason}: move it elsewhere and {again}")) from error
    except MisfitError as error:
        raise RunError(harmless(f"{path} is broken: {error}: {again}")) from error
    except (
        OSError, pa.ArrowException, ValueError, LookupError, OverflowError, MemoryError
    ) as error:  # fmt: skip
        number = getattr(error, "errno", None)
        reason = os.strerror(number) if number else "it is no whole Parquet file"
        raise RunError(harmless(f"{path} cannot be read ({reason}): {again}")) from error


@contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a table; given to Arrow as bytes, since it takes some paths for addresses."""
    content = pa.BufferReader(read_regular(path, MAX_BYTES))
    metadata = pq.read_metadata(content)
    columns = [metadata.schema.column(i) for i in range(metadata.num_columns)]
    # Texts are kept apart from the rows that repeat them, however often they do.
    texts = [column.path for column in columns if column.physical_type == "BYTE_ARRAY"]
    with pq.ParquetFile(content, metadata=metadata, read_dictionary=texts) as file:
        yield file


def _footer(file: pq.ParquetFile) -> Footer:
    """Read the footer of an open table."""
    metadata = file.metadata.metadata or {}
    if FOOTER not in metadata:
        raise MisfitError("it is no table of infoplan's")
    try:
        return read_document(metadata[FOOTER])
    except MisfitError as error:
        raise MisfitError(f"its footer does not fit, {error}") from error


def _demand_owner(footer: Footer, path: Path) -> None:
    """Check that a table is the one that its path says."""
    run, seed = path.parent.name.removeprefix("run="), seed_of(path.stem)
    if (footer.run, footer.seed) != (run, seed):
        raise MisfitError(f"it belongs to {footer.run} seed {footer.seed}")


def _demand_size(metadata: pq.FileMetaData, name: str, footer: Footer) -> None:
    """Check by a file's metadata that it has no more than the mission can have left."""
    science, rows = footer.configuration, metadata.num_rows
    least, most = {
        "curves": (1, science["budget"]),
        "samples": (1, science["budget"]),
        "maps": (math.prod(science["grid"]), math.prod(science["grid"])),
    }.get(name, (0, MAX_ROWS))
    if not least <= rows <= most:
        raise MisfitError(f"it has {rows} rows, the configuration allows {least} to {most}")
    if metadata.num_columns > MAX_COLUMNS:
        raise MisfitError(f"it has {metadata.num_columns} columns, more than {MAX_COLUMNS}")
    groups = range(min(metadata.num_row_groups, rows))
    unpacked = sum(metadata.row_group(i).total_byte_size for i in groups)
    if metadata.num_row_groups > rows or unpacked > metadata.num_columns * (rows * 16 + (1 << 16)):
        raise MisfitError(f"it unpacks to {unpacked} bytes, far more than its rows take")


def _listed(results_dir: Path, pattern: str, prefix: str) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for path in sorted(results_dir.glob(pattern)):
        if (seed := seed_of(path.stem)) is not None:
            found.setdefault(path.parent.name.removeprefix(prefix), []).append(seed)
    return {run: sorted(seeds) for run, seeds in found.items()}


def _scratch(results_dir: Path) -> Path:
    return results_dir / SCRATCH / uuid.uuid4().hex


def _write(results_dir: Path, path: Path, content: bytes) -> None:
    scratch = _scratch(results_dir)
    try:
        with _told(path):
            scratch.parent.mkdir(parents=True, exist_ok=True)
            with scratch.open("wb") as stream:
                stream.write(content)
                _flush(stream)
            path.parent.mkdir(parents=True, exist_ok=True)
            scratch.replace(path)
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)


def _flush(stream: BinaryIO) -> None:
    stream.flush()
    os.fsync(stream.fileno())


def _told(path: Path) -> AbstractContextManager[None]:
    return writing(path, ", then run the same command again; what is finished is kept")
