"""What is stored is whole, belongs together, and is never trusted when it is not."""

import contextlib
import os
import resource
import shutil
import subprocess
import sys
from dataclasses import replace

import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from studies import OPTIONS, assert_same_numbers, curves, quick, study

from infoplan.config import CopodConfig
from infoplan.errors import RunError, UsageError
from infoplan.study.identity import identify
from infoplan.study.store import (
    SCRATCH,
    STALE_SECONDS,
    inspect,
    list_foreign,
    list_missions,
    prepare,
    read_footer,
    read_table,
    save_configuration,
    table_path,
)
from infoplan.tables import TABLES as KNOWN

TABLES = {name: table for name, table in KNOWN.items() if not table.may_be_missing}
"""Tables that every mission has."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Two runs with two seeds each."""
    folder = tmp_path_factory.mktemp("sound")
    config = replace(quick(), seeds=2, backend="sequential", detector=CopodConfig())
    for rho in (0.1, 0.2):
        study(replace(config, rho=rho), folder)
    return folder, config


@pytest.fixture
def stored(sound, tmp_path):
    """A copy to spoil: folder, configuration, and the name of the run with rho 0.1."""
    folder = tmp_path / "results"
    shutil.copytree(sound[0], folder)
    names = list(list_missions(folder))
    return folder, sound[1], next(name for name in names if "rho0.1" in name)


def test_tables_have_the_documented_columns_and_footers(sound):
    folder, _ = sound
    for run, seeds in list_missions(folder).items():
        assert seeds == [0, 1]
        written = yaml.safe_load((folder / "runs" / f"{run}.yaml").read_text())
        for table, laid_down in TABLES.items():
            for seed in seeds:
                path = table_path(folder, table, run, seed)
                assert pq.read_schema(path).names == list(laid_down.columns)
                footer = read_footer(path)
                assert footer.configuration == written
                assert (footer.run, footer.seed) == (run, seed)
                assert footer.started < footer.ended
                assert footer.seconds > 0
                assert footer.terrain["name"] == "volcano"
                assert len(footer.terrain["sha256"]) == 64
                assert footer.command == sys.orig_argv
                assert {"numpy", "scipy", "numba", "infoplan"} <= set(footer.libraries)
                assert all(blas["num_threads"] == 1 for blas in footer.blas)
                assert footer.blas
                assert footer.python
                assert footer.cpu
                assert set(footer.git) == {"commit", "dirty"}


def test_other_tools_read_the_curves_as_one_table(sound):
    folder, _ = sound
    frame = pd.read_parquet(folder / "curves")
    rows = len(frame)
    assert set(frame["seed"]) == {0, 1}
    assert frame["run"].nunique() == 2
    query = f"SELECT run, seed, count(*) FROM '{folder}/curves/**/*.parquet' GROUP BY run, seed"
    by_duckdb = duckdb.sql(query).fetchall()
    assert sum(count for _, _, count in by_duckdb) == rows
    assert {(run, seed) for run, seed, _ in by_duckdb} == {
        (str(run), seed) for run, seed in zip(frame["run"], frame["seed"], strict=True)
    }
    for source in (folder / "curves", f"{folder}/curves/**/*.parquet"):
        by_polars = pl.read_parquet(source, hive_partitioning=True)
        assert len(by_polars) == rows
        assert set(by_polars["seed"]) == {0, 1}
        assert by_polars["run"].n_unique() == 2


def spoil_truncated(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def spoil_empty(path):
    path.write_bytes(b"")


def spoil_text(path):
    path.write_text("seed,epoch\n0,0\n")


def spoil_foreign(path):
    """A table that some other tool has written."""
    pq.write_table(pa.table({"seed": [1], "epoch": [0], "rmse": [1.0]}), path)


def spoil_rewritten(path):
    """The same numbers by another tool: the footer is lost."""
    pd.read_parquet(path, partitioning=None).to_parquet(path)


def spoil_flipped_bit(path):
    """A bit that changes a value, and leaves file and footer readable."""
    content, honest = path.read_bytes(), pd.read_parquet(path, partitioning=None)
    for position in range(4, len(content)):
        path.write_bytes(flipped(content, position))
        with contextlib.suppress(OSError, pa.ArrowException, ValueError):
            if not pd.read_parquet(path, partitioning=None).equals(honest):
                return
    raise AssertionError("no bit changes a value")


def flipped(content, position):
    changed = bytearray(content)
    changed[position] ^= 1 << position % 8
    return bytes(changed)


def spoil_shorter(path):
    table = pq.read_table(path, partitioning=None)
    pq.write_table(table.slice(0, len(table) // 2), path)


def spoil_fewer_columns(path):
    table = pq.read_table(path, partitioning=None)
    pq.write_table(table.drop_columns([table.column_names[-1]]), path)


def spoil_other_seed(path):
    shutil.copy(path.with_name("seed=0.parquet"), path)


def spoil_other_run(path):
    other = next(entry for entry in path.parent.parent.iterdir() if entry != path.parent)
    shutil.copy(other / path.name, path)


def spoil_other_schema(path):
    table = pq.read_table(path, partitioning=None)
    metadata = table.schema.metadata
    text = metadata[b"infoplan"].replace(b'"schema_version": 1', b'"schema_version": 99')
    pq.write_table(table.replace_schema_metadata({b"infoplan": text}), path)


def spoil_missing(path):
    path.unlink()


EVERY = (
    spoil_truncated, spoil_empty, spoil_text, spoil_foreign, spoil_rewritten, spoil_flipped_bit,
    spoil_fewer_columns, spoil_other_seed, spoil_other_run, spoil_other_schema,
)  # fmt: skip
SPOILT = [(spoil, table) for spoil in EVERY for table in TABLES]
SPOILT += [
    (spoil, table) for spoil in (spoil_missing, spoil_shorter) for table in ("samples", "maps")
]


@pytest.mark.parametrize(("spoil", "table"), SPOILT)
def test_a_spoilt_table_is_named_and_computed_again(spoil, table, stored, sound):
    folder, config, run = stored
    path = table_path(folder, table, run, 1)
    before = path.read_bytes()
    spoil(path)
    assert not path.exists() or path.read_bytes() != before
    found = inspect(folder, run, 1)
    assert found.state == "broken"
    assert str(path) in found.reason
    assert inspect(folder, run, 0).state == "done"
    done, said = study(config, folder)
    assert (done.computed, done.kept) == (1, 1)
    assert [line for line in said.splitlines() if str(path) in line and "WARNING" in line]
    assert inspect(folder, run, 1).state == "done"
    assert_same_numbers(folder, sound[0])


@pytest.mark.parametrize("spoil", [spoil_truncated, spoil_text, spoil_flipped_bit, spoil_foreign])
def test_readers_refuse_a_spoilt_table(spoil, stored):
    folder, _, run = stored
    path = table_path(folder, "samples", run, 1)
    spoil(path)
    with pytest.raises(RunError, match=f"{path.name}.*run its configuration again"):
        read_table(folder, "samples", run, 1)
    assert len(read_table(folder, "samples", run, 0)) == 160


def test_no_flipped_bit_gives_other_values(stored):
    folder, _, run = stored
    for table in TABLES:
        path = table_path(folder, table, run, 1)
        content, honest = path.read_bytes(), read_table(folder, table, run, 1).to_pandas()
        for position in range(0, len(content), 61):
            path.write_bytes(flipped(content, position))
            with contextlib.suppress(RunError):
                assert read_table(folder, table, run, 1).to_pandas().equals(honest)
        path.write_bytes(content)


def test_tables_of_two_missions_do_not_pass_for_one(stored):
    folder, config, run = stored
    path = table_path(folder, "maps", run, 0)
    old = path.read_bytes()
    study(config, folder, resume=False)
    path.write_bytes(old)
    assert inspect(folder, run, 0).state == "broken"
    assert inspect(folder, run, 1).state == "done"


def test_without_its_curve_a_mission_is_missing(stored):
    folder, config, run = stored
    table_path(folder, "curves", run, 0).unlink()
    assert inspect(folder, run, 0).state == "missing"
    done, said = study(config, folder)
    assert (done.computed, done.kept) == (1, 1)
    assert "WARNING" not in said


def test_a_spoilt_configuration_is_written_again(stored, sound):
    folder, config, run = stored
    path = folder / "runs" / f"{run}.yaml"
    right = path.read_bytes()
    path.write_text("rho: 0.7\n")
    done, said = study(config, folder)
    assert done.computed == 0
    assert "WARNING" in said
    assert path.read_bytes() == right
    _, said = study(config, folder)
    assert "WARNING" not in said


def test_the_configuration_does_not_change_from_call_to_call(tmp_path, small, volcano):
    run = identify(small, volcano)
    assert not save_configuration(tmp_path, run)
    path = tmp_path / "runs" / f"{run.name}.yaml"
    first = path.stat().st_mtime_ns
    assert not save_configuration(tmp_path, run)
    assert path.stat().st_mtime_ns == first
    assert yaml.safe_load(path.read_text()) == run.science


def test_files_that_are_no_missions_are_listed(stored):
    folder, _, run = stored
    assert list_foreign(folder) == []
    strangers = [
        folder / "curves" / "mine.parquet",
        folder / "curves" / f"run={run}" / "seed=x.parquet",
        folder / "maps" / f"run={run}" / "notes.txt",
        folder / "samples" / "deep" / f"run={run}" / "seed=0.parquet",
    ]
    for path in strangers:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"?")
    assert set(list_foreign(folder)) == set(strangers)
    assert list_missions(folder)[run] == [0, 1]


def test_what_a_dead_writer_left_is_swept_out(tmp_path):
    prepare(tmp_path)
    old, new = tmp_path / SCRATCH / "old", tmp_path / SCRATCH / "new"
    for path in (old, new):
        path.write_bytes(b"half a table")
    os.utime(old, (0, old.stat().st_mtime - 2 * STALE_SECONDS))
    prepare(tmp_path)
    assert not old.exists()
    assert new.exists()


@contextlib.contextmanager
def unprivileged():
    """Root may write everywhere: be somebody else for a while."""
    if os.geteuid() == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(os.getuid())


def test_a_read_only_folder_is_refused_before_any_work(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    folder.chmod(0o555)
    with (
        unprivileged(),
        pytest.raises(UsageError, match=r"cannot be written \(Permission denied\)"),
    ):
        study(quick(), folder)
    assert list(folder.iterdir()) == []


def test_a_folder_that_becomes_read_only_ends_the_study(tmp_path):
    folder = tmp_path / "results"
    study(quick(), folder, seeds=1, backend="sequential")
    # Root ignores permissions: a file where a folder is needed fails for everybody.
    name = next(iter(list_missions(folder)))
    shutil.rmtree(folder / "maps")
    (folder / "maps").write_text("in the way")
    with pytest.raises(RunError, match=rf"maps.*{name}.*could not be written"):
        study(quick(), folder, seeds=2, backend="sequential", resume=False)
    assert list((folder / SCRATCH).iterdir()) == []


def run_with_little_room(folder, seeds: int, room: int) -> subprocess.CompletedProcess[str]:
    """Run the console command where no file may grow above a size, as on a disk that is full."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    return subprocess.run(
        [sys.executable, "-m", "infoplan.cli", "run", *OPTIONS, "detector=copod", f"seeds={seeds}",
         "n_jobs=1", f"results_dir={folder}"],
        capture_output=True, text=True, preexec_fn=limit, timeout=300,
    )  # fmt: skip


def test_a_full_disk_ends_the_study_and_keeps_what_is_finished(stored):
    folder, config, run = stored
    sizes = {table: table_path(folder, table, run, 0).stat().st_size for table in TABLES}
    assert len(curves(folder)) == 4
    # Room for two of the three tables: none may appear.
    done = run_with_little_room(folder, seeds=3, room=sorted(sizes.values())[1] + 500)
    assert done.returncode == 1
    errors = [line for line in done.stderr.splitlines() if line]
    assert len(errors) == 1
    assert "could not be written (File too large)" in errors[0]
    assert "what is finished is kept" in errors[0]
    assert not any(table_path(folder, table, run, 2).exists() for table in TABLES)
    assert list((folder / SCRATCH).iterdir()) == []
    again, _ = study(config, folder, seeds=3)
    assert (again.computed, again.kept) == (1, 2)
    assert inspect(folder, run, 2).state == "done"
