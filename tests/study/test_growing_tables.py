"""Tables of another version: with a column or a table less, or with one more."""

import json
import re
import shutil
from dataclasses import fields, make_dataclass, replace
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from flown import fly, tables_of

from infoplan import tables
from infoplan.analyse import find_study, load_curves, load_samples
from infoplan.analyse.audit import audit
from infoplan.analyse.status import look_at_all
from infoplan.draw.report import write_report
from infoplan.errors import RunError
from infoplan.scoring import CurveRow
from infoplan.study.columns import lay_out, values_digest
from infoplan.study.identity import identify
from infoplan.study.mission_tables import build_tables
from infoplan.study.store import (
    inspect,
    list_missions,
    read_table,
    save_mission,
    sealed,
    table_path,
)
from infoplan.study.stored_terrains import stored_terrains
from infoplan.tables import TABLES, Column

STORED = Path(__file__).parent.parent / "data" / "results-0.1.0"
RUNS = list(list_missions(STORED))
EVERY = {name: table for name, table in TABLES.items() if not table.may_be_missing}
"""Tables that every mission has."""


@pytest.fixture
def folder(tmp_path) -> Path:
    return Path(shutil.copytree(STORED, tmp_path / "results"))


def rewrite(path: Path, change) -> None:
    """Change a table as a version that writes it so would have written it."""
    table = pq.read_table(path, partitioning=None)
    changed = change(table)
    footer = json.loads(table.schema.metadata[b"infoplan"])
    footer["values_sha256"] = values_digest(changed)
    pq.write_table(changed.replace_schema_metadata({b"infoplan": sealed(footer)}), path)


def add_column(monkeypatch, table: str, column: Column) -> None:
    """Let this version have a column that those before had not."""
    columns = TABLES[table].columns | {column.name: column}
    monkeypatch.setitem(TABLES, table, replace(TABLES[table], columns=columns))


def demand_sound(folder: Path) -> None:
    found = look_at_all(folder)
    assert (len(found.runs), found.problems) == (len(RUNS), [])
    maps = {terrain.sha256: terrain.elevation for terrain in stored_terrains(folder)}
    assert [finding for finding in audit(folder, terrains=maps) if not finding.holds] == []


@pytest.mark.parametrize("kind", tables.KINDS)
def test_a_column_that_an_older_version_lacks_is_null(folder, monkeypatch, kind):
    honest = {run: read_table(folder, "curves", run, 0) for run in RUNS}
    add_column(monkeypatch, "curves", Column("fresh", kind, "of now", since="0.2.0"))
    for run in RUNS:
        found = read_table(folder, "curves", run, 0)
        assert found["fresh"].null_count == len(found)
        assert found["fresh"].type == tables.KINDS[kind]
        assert found.drop_columns(["fresh"]).equals(honest[run])
        assert inspect(folder, run, 0).state == "done"
    # One run was flown by this version.
    here = table_path(folder, "curves", RUNS[-1], 0)
    values = {"text": "a", "integer": 7, "double": 0.5, "boolean": True}
    gap = [values[kind] if kind == "double" else None]  # the audit asks for finite numbers
    rewrite(here, lambda t: t.append_column("fresh", pa.array(gap + [values[kind]] * (len(t) - 1))))
    frame = load_curves(folder, replay=None).set_index("run")["fresh"]
    assert frame.isna().sum() > 1
    assert set(frame[RUNS[-1]].dropna()) == {values[kind]}
    assert set(frame.dropna()) == {values[kind]}
    if kind == "double":
        demand_sound(folder)


def test_a_column_of_a_version_to_come_is_kept(folder):
    more = {"hour": [3], "label": ["a"], "share": [0.5], "dusk": [True]}
    *newer, older = RUNS
    for run in newer:
        for table in EVERY:
            rewrite(
                table_path(folder, table, run, 0),
                lambda t: pa.table(
                    {n: t[n] for n in t.column_names}
                    | {n: pa.array(v * (len(t) - 1) + [None]) for n, v in more.items()}
                ),
            )
    found = read_table(folder, "samples", RUNS[0], 0)
    assert {name: found[name][0].as_py() for name in more} == {n: v[0] for n, v in more.items()}
    assert [found[name].null_count for name in more] == [1, 1, 1, 1]
    demand_sound(folder)
    frame = load_samples(folder).set_index("run")[list(more)]
    assert frame.loc[older].isna().all(axis=None)
    assert frame.loc[newer[0]].notna().sum().tolist() == [len(found) - 1] * 4
    study = find_study(folder, method=["UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"])
    assert write_report(study).stat().st_size > 10_000


def test_a_null_is_no_other_value_than_zero(folder):
    """The digest tells a null from the value that stands in its place."""
    for null, zero in ((pa.nulls(2, pa.int64()), [0, 0]), (pa.nulls(2, pa.bool_()), [False] * 2),
                       (pa.nulls(2, pa.string()), ["", ""])):  # fmt: skip
        made = [pa.table({"a": column}) for column in (null, pa.array(zero))]
        assert values_digest(made[0]) != values_digest(made[1])
        assert values_digest(made[0]) == values_digest(pa.table({"a": null}))


def test_columns_of_one_name_and_two_kinds_do_not_go_together(folder):
    for run, value in zip(RUNS[:2], ("a", True), strict=True):
        more = [value] * len(read_table(folder, "curves", run, 0))
        change = partial(pa.Table.append_column, field_="more", column=pa.array(more))
        rewrite(table_path(folder, "curves", run, 0), change)
    with pytest.raises(RunError, match=r"curves do not go together.*choose runs with run="):
        load_curves(folder, run=RUNS[:2])
    assert set(load_curves(folder, run=RUNS[0])["more"]) == {"a"}


def test_a_table_that_an_older_version_lacks_may_be_missing(folder, monkeypatch, small, volcano):
    extra = tables.Table(
        "a moment", {"seed": TABLES["maps"].columns["seed"],
                     "tide": Column("tide", "double", "of the sea", since="0.2.0")}, since="0.2.0",
    )  # fmt: skip
    monkeypatch.setitem(TABLES, "moments", extra)
    demand_sound(folder)
    run = identify(small, volcano)
    made = tables_of(run, 0)
    made.moments = lay_out("moments", {"seed": [0, 0], "tide": [1.0, 2.0]})
    save_mission(folder, run, 0, made, {})
    assert read_table(folder, "moments", run.name, 0)["tide"].to_pylist() == [1.0, 2.0]
    assert inspect(folder, run.name, 0).state == "done"
    path = table_path(folder, "moments", run.name, 0)
    path.write_bytes(path.read_bytes()[:-9])
    found = inspect(folder, run.name, 0)
    assert (found.state, str(path) in found.reason) == ("broken", True)


def test_a_row_s_further_fields_become_columns(small, volcano):
    """A column of the curve: in the schema and where it is computed, nowhere else."""
    states = fly(small, volcano)
    rows, last = [state.row for state in states], states[-1]
    longer = make_dataclass(
        "Longer", [("tide", float), ("learned", dict)], bases=(CurveRow,), frozen=True
    )
    told = [
        longer(
            **{item.name: getattr(row, item.name) for item in fields(row)},
            tide=0.5,
            learned={"alpha": 2.0, "beta": row.rmse},
        )
        for row in rows
    ]
    run = identify(small, volcano)
    made = build_tables(run, 0, told, last).curves
    assert made["tide"].to_pylist() == [0.5] * len(rows)
    assert made["alpha"].to_pylist() == [2.0] * len(rows)
    assert made["beta"].equals(made["rmse"])
    assert made.column_names == [*TABLES["curves"].columns, "tide", "alpha", "beta"]
    assert build_tables(run, 0, rows, last).curves.column_names == list(TABLES["curves"].columns)


def test_the_row_of_a_curve_is_what_the_schema_says():
    by_the_run = ["planner", "detector", "scope", "rho", "terrain", "seed"]
    told = by_the_run + [item.name for item in fields(CurveRow)]
    assert told == [*TABLES["curves"].columns, "further"]


def test_a_column_that_every_file_has_cannot_be_left_out():
    with pytest.raises(KeyError, match="x1"):
        lay_out("maps", {"seed": [0]})


def test_files_say_what_their_columns_are(tmp_path, small, volcano):
    run = identify(small, volcano)
    save_mission(tmp_path, run, 0, tables_of(run, 0), {})
    for name, table in EVERY.items():
        schema = pq.read_schema(table_path(tmp_path, name, run.name, 0))
        for column in table.columns.values():
            said = schema.field(column.name).metadata
            assert said[b"doc"].decode() == column.doc
            assert said.get(b"unit", b"").decode() == column.unit


def test_every_column_is_told_well():
    for table in TABLES.values():
        assert table.doc
        for key, column in table.columns.items():
            assert key == column.name
            assert column.doc
            assert column.kind in tables.KINDS
            assert column.at_least < column.at_most
            assert re.fullmatch(r"\d+\.\d+\.\d+", column.since)
    assert tables.DURATIONS == ["plan_seconds", "fit_seconds", "predict_seconds", "detect_seconds"]


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [("curves", "coverage95", 1.5), ("maps", "std", -1.0), ("samples", "heading", 7.0)],
)
def test_the_audit_sees_what_is_impossible(folder, table, column, value):
    def spoil(t):
        values = t[column].to_numpy().copy()
        values[1] = value
        return t.set_column(t.column_names.index(column), column, pa.array(values))

    rewrite(table_path(folder, table, RUNS[0], 0), spoil)
    findings = {finding.check: finding for finding in audit(folder, run=RUNS[0])}
    assert not findings["values"].holds
    assert f"{table}.{column} is {value:g} in row 1" in findings["values"].detail
