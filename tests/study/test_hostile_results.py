"""Results are data: whatever stands in a folder is read within bounds, named, and never run."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from command import infoplan as command
from flown import fly, tables_of
from studies import SABOTEUR, quick, study

from infoplan.analyse import find_missions
from infoplan.analyse.audit import audit, audit_mission
from infoplan.analyse.status import look_at_all
from infoplan.cli import main
from infoplan.errors import RunError, UsageError
from infoplan.study import store as stored
from infoplan.study.columns import values_digest
from infoplan.study.estimate import learn
from infoplan.study.identity import identify, run_name
from infoplan.study.mission_tables import build_tables
from infoplan.study.records import MisfitError, read_science
from infoplan.study.store import (
    configuration_path,
    inspect,
    list_foreign,
    list_missions,
    read_footer,
    read_table,
    save_mission,
    sealed,
    table_path,
)
from infoplan.study.stored_terrains import stored_terrains


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    study(quick(), folder, seeds=2, backend="sequential")
    return folder


@pytest.fixture
def folder(sound, tmp_path):
    return Path(shutil.copytree(sound, tmp_path / "results"))


@pytest.fixture
def run(sound):
    return next(iter(list_missions(sound)))


def rewrite(path: Path, change=lambda table: table, **footer) -> None:
    """Write a table anew, changed, its digests made to fit."""
    table = change(pq.ParquetFile(path).read())
    document = json.loads(table.schema.metadata[b"infoplan"]) | footer
    pq.write_table(table.replace_schema_metadata({b"infoplan": sealed(document)}), path)


def set_footer(path: Path, text: bytes) -> None:
    table = pq.ParquetFile(path).read()
    pq.write_table(table.replace_schema_metadata({b"infoplan": text}), path)


def demand_broken(folder: Path, run: str, path: Path) -> None:
    """Every reader names the mission broken and goes on; a run computes it anew."""
    assert inspect(folder, run, 1).state == "broken"
    assert str(path) in inspect(folder, run, 1).reason
    assert inspect(folder, run, 0).state == "done"
    [of_run] = look_at_all(folder).runs
    assert (of_run.done, of_run.broken) == ([0], [1])
    with pytest.raises(RunError, match=r"seed=1\.parquet"):
        find_missions(folder)
    assert learn(folder).measured
    findings = [finding for finding in audit(folder, epochs=1) if not finding.holds]
    assert {finding.seed for finding in findings} == {1}


BAD_FOOTERS = [
    b"[]", b"5", b"null", b'"text"', b"", b"{", b"[" * 100 + b"]" * 100, b"[" * 100_000,
    b'{"a":' * 100 + b"1" + b"}" * 100, b"\xff\xfe", b" " * 300_000,
]  # fmt: skip


@pytest.mark.parametrize("text", BAD_FOOTERS, ids=lambda text: text[:12].decode("latin-1"))
def test_a_footer_of_another_shape_is_broken(folder, run, text):
    path = table_path(folder, "curves", run, 1)
    set_footer(path, text)
    demand_broken(folder, run, path)


def test_a_broken_footer_is_computed_anew(folder, run):
    path = table_path(folder, "curves", run, 1)
    set_footer(path, b"[]")
    done, said = study(quick(), folder, seeds=2, backend="sequential")
    assert (done.computed, done.kept) == (1, 1)
    assert f"{path} is broken" in said
    assert inspect(folder, run, 1).state == "done"


def retyped(column, values):
    def change(table):
        where = table.column_names.index(column)
        return table.set_column(where, column, values(table[column].to_pylist()))

    return change


WRONG_COLUMNS = {
    "rmse as text": retyped("rmse", lambda v: pa.array([str(x) for x in v])),
    "rmse as whole numbers": retyped("rmse", lambda v: pa.array([int(x) for x in v])),
    "rmse in single precision": retyped("rmse", lambda v: pa.array(v, pa.float32())),
    "rmse nested": retyped("rmse", lambda v: pa.array([[x] for x in v])),
    "rmse as mappings": retyped("rmse", lambda v: pa.array([{"a": x} for x in v])),
    "rmse missing": retyped("rmse", lambda v: pa.array([None, *v[1:]], pa.float64())),
    "planner as number": retyped("planner", lambda v: pa.array([1.0] * len(v))),
    "epoch too large": retyped("epoch", lambda v: pa.array([2**63] * len(v), pa.uint64())),
    "of another seed": retyped("seed", lambda v: pa.array([2] * len(v))),
    "without rows": lambda table: table.slice(0, 0),
    "without a column": lambda table: table.drop_columns(["lml"]),
    "with a nested column": lambda t: t.append_column("more", pa.array([[1]] * len(t))),
    "with its partition": lambda t: t.append_column("run", pa.array(["x"] * len(t))),
    "a column twice": lambda t: t.append_column("rmse", t["rmse"]),
    "many columns": lambda t: pa.table(
        {**{n: t[n] for n in t.column_names}, **{f"c{i}": t["rmse"] for i in range(99)}}
    ).replace_schema_metadata(t.schema.metadata),
    "too many rows": lambda t: pa.concat_tables([t] * 200),
}


@pytest.mark.parametrize("wrong", WRONG_COLUMNS)
def test_columns_of_another_kind_are_broken(folder, run, wrong):
    path = table_path(folder, "curves", run, 1)
    rewrite(path, WRONG_COLUMNS[wrong])
    demand_broken(folder, run, path)


def test_kindred_types_are_read_rightly(folder, run):
    path = table_path(folder, "curves", run, 1)
    honest = read_table(folder, "curves", run, 1)
    for change in (
        retyped("planner", lambda v: pa.array(v).dictionary_encode()),
        retyped("planner", lambda v: pa.array(v, pa.large_string())),
        retyped("epoch", lambda v: pa.array(v, pa.int8())),
        retyped("epoch", lambda v: pa.array(v, pa.uint32())),
    ):
        rewrite(path, change)
        assert read_table(folder, "curves", run, 1).equals(honest)
        assert inspect(folder, run, 1).state == "done"


def test_a_bomb_is_refused_by_its_metadata(folder, run):
    path = table_path(folder, "samples", run, 1)
    table = pq.ParquetFile(path).read()
    n = 50_000_000
    column = pa.chunked_array([pa.array(np.zeros(n // 50))] * 50)
    bomb = pa.table({"seed": column}).replace_schema_metadata(table.schema.metadata)
    pq.write_table(bomb, path, compression="zstd")
    assert path.stat().st_size < 300_000
    assert "50000000 rows" in inspect(folder, run, 1).reason


def test_a_long_text_in_every_row_is_refused(folder, run):
    path = table_path(folder, "curves", run, 1)
    rewrite(path, retyped("planner", lambda v: pa.array(["x" * 2**20] * len(v))))
    assert inspect(folder, run, 1).state == "broken"


def in_place(kind: str, path: Path) -> None:
    path.unlink()
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "endless link":
        path.symlink_to(path)
    elif kind == "link to nowhere":
        path.symlink_to("nowhere")
    else:
        path.symlink_to("/proc/self/mem")


KINDS = ["pipe", "folder", "device", "endless link", "link to nowhere", "memory"]


@pytest.mark.parametrize("table", ["curves", "maps"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_file_is_broken(folder, run, kind, table):
    path = table_path(folder, table, run, 1)
    in_place(kind, path)
    assert inspect(folder, run, 1).state == "broken"
    assert str(path) in inspect(folder, run, 1).reason
    findings = audit_mission(folder, run, 1)
    assert [(finding.check, finding.holds) for finding in findings] == [("files", False)]
    if kind != "folder":
        done, _ = study(quick(), folder, seeds=2, backend="sequential")
        assert done.computed == 1
        assert inspect(folder, run, 1).state == "done"
    else:
        with pytest.raises(RunError, match="move what is in the way elsewhere"):
            study(quick(), folder, seeds=2, backend="sequential")


@pytest.mark.parametrize("kind", KINDS)
def test_a_configuration_that_is_no_file_is_named(folder, run, kind):
    path = configuration_path(folder, run)
    in_place(kind, path)
    with pytest.raises(MisfitError):
        read_science(path)
    assert stored_terrains(folder) == []
    [finding] = audit_mission(folder, run, 1)
    assert (finding.check, finding.holds) == ("files", False)


BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{','.join([f'*{a}'] * 10)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD_YAML = {
    "deep": "[" * 10_000, "deep mapping": "{a: " * 5_000, "bomb": BOMB, "itself": "&a [*a]",
    "list": "[1, 2]", "number": "5", "nothing": "", "object": "!!python/object/apply:os.abort []",
    "long": "#" * 300_000, "bytes": "\x00", "a date": "rho: 2020-01-01", "keys": "1: 2",
}  # fmt: skip


@pytest.mark.parametrize("what", BAD_YAML)
def test_a_yaml_of_another_kind_is_named(folder, run, what):
    path = configuration_path(folder, run)
    path.write_text(BAD_YAML[what])
    with pytest.raises(MisfitError):
        read_science(path)
    assert stored_terrains(folder) == []
    [finding] = audit_mission(folder, run, 1)
    assert f"runs/{run}.yaml" in finding.detail
    done, said = study(quick(), folder, seeds=2, backend="sequential")
    assert done.computed == 0
    assert "WARNING" in said


WRONG_OPTIONS = {
    "grid": [[8, 10**9], [0, 5], "12", None, [12, 12.5], [[12], 12], [12]],
    "budget": [10**9, -1, "160", True, 2**70], "rho": [[0.1], float("nan"), 2.0, "0.1", None],
    "terrain": [None, [], {"name": "volcano"}],
    "terrain.extent": [[0.0, 0.0, 0.0, 0.0], [0.0, 1e-9, 0.0, 50.0], [0, 1], "x"],
    "terrain.name": ["everest", 3, ["volcano"]], "terrain.sha256": [None, 5],
    "planner.smoothing": ["2", -1.0, float("inf"), None], "planner.name": [None, "nobody"],
    "detector.scope": ["sometimes", None], "model.iterations": [1.5, "often", [3]],
    "outliers.amplitude": [[[1, 2], [3]], [1.0], "ab"], "numerics_version": ["1", None],
    "pilot.control_points": [[1.0, 2.0], [[0.1]], None], "replay": [3],
}  # fmt: skip


@pytest.mark.parametrize("option", WRONG_OPTIONS)
def test_a_configuration_that_does_not_fit_is_named(folder, run, option):
    path = table_path(folder, "curves", run, 1)
    science = read_footer(path).configuration
    for value in WRONG_OPTIONS[option]:
        changed = json.loads(json.dumps(science))
        *groups, key = option.split(".")
        place = changed
        for group in groups:
            place = place[group]
        place[key] = value
        set_footer(path, sealed(vars(read_footer(table_path(folder, "curves", run, 0))) | {
            "seed": 1, "configuration": changed,
        }))  # fmt: skip
        assert inspect(folder, run, 1).state == "broken", value
        assert look_at_all(folder).problems
        with pytest.raises(RunError, match=r"seed=1\.parquet"):
            find_missions(folder)


ODD = ["seed=²", "seed=x", "seed=", "seed=-1", "seed=01", "seed=1.5", "seed=" + "9" * 40, "1"]


def test_odd_names_are_foreign_files(folder, run):
    place = table_path(folder, "curves", run, 0).parent
    for name in ODD:
        shutil.copy(place / "seed=0.parquet", place / f"{name}.parquet")
    (place / "seed=0.txt").write_text("x")
    (folder / ".locks").mkdir(exist_ok=True)
    (folder / ".locks" / "x.seed=²").write_text("")
    assert list_missions(folder) == {run: [0, 1]}
    assert {path.stem for path in list_foreign(folder)} == {*ODD, "seed=0"}
    assert len(look_at_all(folder).problems) == len(ODD) + 1
    done, _ = study(quick(), folder, seeds=2, backend="sequential")
    assert done.computed == 0


FOLDERS = [
    "run-12:30", "100%", "a=b", "a b", "a,b", "[a]", "*", "?", "%2F", "-x", "s3:", "file:", "ü-雪",
    "{a}", "'", '"', "#", "~", "x" * 200, b"\xff\xfe".decode("utf-8", "surrogateescape"), "$HOME",
]  # fmt: skip


@pytest.mark.parametrize("name", FOLDERS, ids=ascii)
def test_any_folder_will_do(sound, run, tmp_path, name):
    folder = tmp_path / name
    done, _ = study(quick(), folder, seeds=1, backend="sequential")
    assert done.computed == 1
    assert inspect(folder, run, 0).state == "done"
    assert list_missions(folder) == {run: [0]}
    assert list_foreign(folder) == []
    assert len(find_missions(folder).missions) == 1
    assert all(finding.holds for finding in audit(folder, epochs=1))
    found = look_at_all(folder)
    assert found.runs[0].done == [0]


def test_control_characters_of_a_footer_are_never_printed(folder, run, capfd):
    path = table_path(folder, "curves", run, 1)
    rewrite(path, seconds="\x1b[2Jmine")
    assert "\x1b" not in inspect(folder, run, 1).reason
    assert "mine" in inspect(folder, run, 1).reason
    assert main(["audit", f"results_dir={folder}", "epochs=1"]) == 1
    assert "\x1b[2J" not in capfd.readouterr().out


def test_a_file_is_on_the_disk_before_it_is_seen(tmp_path, volcano, small, monkeypatch):
    """What is renamed into place without fsync may be empty after a loss of power."""
    done = []
    flush, rename = os.fsync, Path.replace
    monkeypatch.setattr(
        os, "fsync", lambda d: (done.append(os.readlink(f"/proc/self/fd/{d}")), flush(d))
    )

    def replace_file(self, target):
        assert str(self) in done
        done.append(str(target))
        return rename(self, target)

    monkeypatch.setattr(Path, "replace", replace_file)
    run = identify(small, volcano)
    save_mission(tmp_path, run, 0, tables_of(run, 0), {})
    stored.save_failure(tmp_path, run.name, 1, "it failed")
    written = [path for path in done if "seed=" in path or path.endswith(".yaml")]
    assert [Path(path).suffix for path in written] == [".yaml", *[".parquet"] * 3, ".txt"]
    # All three are on the disk before the first is seen.
    first = done.index(str(table_path(tmp_path, "samples", run.name, 0)))
    assert sum(".scratch" in path for path in done[:first]) == 4


def test_an_infinite_error_is_a_failed_mission(tmp_path, volcano, small):
    run = identify(small, volcano)
    states = fly(run.config, volcano)
    rows, last = [state.row for state in states], states[-1]
    for wrong in (np.inf, np.nan):
        spoilt = [*rows[:-1], replace(rows[-1], rmse=wrong)]
        with pytest.raises(
            RunError, match=rf"model gp .* epoch {rows[-1].epoch} \(rmse is {wrong}"
        ):
            build_tables(run, 0, spoilt, last)
    unknown = replace(last.maps, truth=np.full_like(last.maps.truth, np.nan))
    assert build_tables(run, 0, spoilt, replace(last, maps=unknown))


# Functions of somebody else's

MARKED = """
from pathlib import Path
Path({mark!r}).touch()

def jumps(samples, model, rng, *, threshold: float = 3.0):
    return samples.measured > threshold * 1e9, samples.measured

def hill():
    Path({mark!r}).touch()
    import os
    os.abort()
"""


@pytest.fixture
def theirs(tmp_path, volcano, small, monkeypatch):
    """A stored mission with a detector of somebody's, who leaves a mark when imported."""
    place = tmp_path / "theirs"
    place.mkdir()
    mark, module = place / "imported", place / "theirs.py"
    module.write_text(MARKED.format(mark=str(mark)))
    monkeypatch.chdir(place)
    monkeypatch.syspath_prepend(place)
    sys.modules.pop("theirs", None)
    small.detector = replace(_own(), function="theirs.jumps")
    run = identify(small, volcano)
    save_mission(place / "results", run, 0, tables_of(run, 0), {})
    del sys.modules["theirs"]
    mark.unlink()
    yield run.name, mark, module
    sys.modules.pop("theirs", None)


def _own():
    from infoplan.config import METHODS

    return METHODS["detector"]["own"]


READING = [
    ["audit"], ["status"], ["show"], ["leaderboard"], ["claims"], ["report"], ["figures", "fig6"],
]  # fmt: skip


@pytest.mark.parametrize("arguments", READING, ids=" ".join)
def test_reading_never_imports(theirs, arguments, capfd):
    _, mark, _ = theirs
    main([*arguments, "results_dir=results"])
    assert not mark.exists()
    assert "theirs" not in sys.modules


def test_a_replay_without_trust_is_refused(theirs, capfd):
    run, mark, module = theirs
    assert main(["replay", run, "n_jobs=1", "results_dir=results"]) == 2
    said = capfd.readouterr().err
    assert "theirs.jumps" in said
    assert "trust=true" in said
    assert str(module) in said
    assert not mark.exists()
    assert "theirs" not in sys.modules


def test_an_animation_without_trust_shows_what_the_tables_hold(theirs, capfd):
    run, mark, _ = theirs
    assert main(["animate", f"run={run}", "results_dir=results"]) == 0
    said = capfd.readouterr().out
    assert "only the maps of the end are shown" in said
    assert "theirs.jumps, without trust=true" in said
    assert Path("results", "figures", f"{run}-seed0.gif").exists()
    assert not mark.exists()
    assert "theirs" not in sys.modules


@pytest.mark.parametrize("arguments", [["replay", "{}", "n_jobs=1"], ["animate", "run={}"]])
def test_a_trusted_function_needs_its_digest(theirs, arguments, capfd):
    run, mark, module = theirs
    line = [part.format(run) for part in arguments] + ["results_dir=results"]
    honest = module.read_text()
    module.write_text(honest + "# changed\n")
    assert main([*line, "trust=true"]) == 2
    said = capfd.readouterr().err
    assert "is not what it was flown with" in said
    assert not mark.exists()
    module.write_text(honest)
    main([*line, "trust=true"])
    assert f"importing theirs.jumps from {module}" in capfd.readouterr().out
    assert mark.exists()


@pytest.mark.parametrize("arguments", [["replay", "{}", "n_jobs=1"], ["animate", "run={}"]])
def test_the_command_line_may_name_the_function_itself(theirs, arguments, capfd):
    run, mark, module = theirs
    line = [part.format(run) for part in arguments] + ["results_dir=results"]
    main([*line, "detector.function=theirs.jumps"])
    assert f"importing theirs.jumps from {module}" in capfd.readouterr().out
    assert mark.exists()


def test_a_stored_terrain_s_function_is_never_called(theirs, folder, run, capfd):
    _, mark, _ = theirs
    path = configuration_path(folder, run)
    science = yaml.safe_load(path.read_text())
    science["terrain"] = {
        "name": "own-hill", "extent": [0.0, 50.0, 0.0, 50.0], "unit": "ft", "orientation": 0,
        "function": "theirs.hill", "options": {}, "sha256": "0" * 64,
    }  # fmt: skip
    forged = run_name(science)
    configuration_path(folder, forged).write_text(yaml.safe_dump(science))
    for table in ("curves", "samples", "maps"):
        old, new = table_path(folder, table, run, 0), table_path(folder, table, forged, 0)
        new.parent.mkdir()
        shutil.copy(old, new)

        def named(stored, table=table):
            if table != "curves":
                return stored
            return retyped("terrain", lambda v: pa.array(["own-hill"] * len(v)))(stored)

        rewrite(new, named)
        values = values_digest(pq.ParquetFile(new).read())
        rewrite(
            new, run=forged, configuration=science, values_sha256=values,
            terrain={"name": "own-hill", "sha256": "0" * 64},
        )  # fmt: skip
    assert inspect(folder, forged, 0).state == "done"
    assert main(["audit", f"run={forged}", f"results_dir={folder}", "epochs=1"]) == 0
    assert "is made by a function, and none that a results folder names" in capfd.readouterr().out
    assert not mark.exists()


# Locks that fail


@pytest.mark.parametrize(
    "error",
    ["EIO", "EBADF"]
    + [pytest.param(name, marks=pytest.mark.long) for name in ("EACCES", "ENOLCK", "ESTALE")],
)
def test_locks_that_fail_are_told_once_and_done_without(tmp_path, error):
    options = [
        "terrain=volcano", "budget=110", "grid=[5,5]", "seeds=2", "backend=sequential",
        "planner.iterations=2", "model.pilot_iterations=1", "model.iterations=0", "detector=none",
        f"results_dir={tmp_path}",
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "infoplan.cli", "run", *options], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": SABOTEUR, "FLOCK_FAILS": error}, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0
    said = " ".join((done.stdout + done.stderr).split())
    assert said.count("no locks can be had") == 1
    [seeds] = list_missions(tmp_path).values()
    assert seeds == [0, 1]


def test_the_command_line_refuses_epochs_that_are_none(folder):
    done = command("audit", f"results_dir={folder}", "epochs=none", check=False)
    assert done.returncode == 2
    assert "epochs=none" in done.stderr


def test_the_extent_of_a_map_is_checked_before_it_is_made(folder, run):
    path = configuration_path(folder, run)
    science = yaml.safe_load(path.read_text())
    science["terrain"] = {
        "name": "random_field-seed3", "extent": [0.0, 50.0, 0.0, 50.0], "unit": "m",
        "orientation": 0, "seed": 3, "shape": [10**6, 10**6], "lengthscale": [6.0, 6.0],
        "amplitude": 300.0, "mean": 1000.0, "sha256": "0" * 64,
    }  # fmt: skip
    configuration_path(folder, run_name(science)).write_text(yaml.safe_dump(science))
    assert {terrain.name for terrain in stored_terrains(folder)} == {"volcano"}


def test_a_run_that_is_not_there_is_named(folder):
    with pytest.raises(UsageError):
        find_missions(folder, run="nothing")
