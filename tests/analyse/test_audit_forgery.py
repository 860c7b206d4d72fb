"""Every column and every field of a footer is tampered with, one at a time.

Whoever changes a file alone leaves a digest behind that no longer fits. Whoever forges the digests,
too, is caught by what can be recomputed; what cannot is listed here, and nothing else escapes.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_run import SEED, fly, hills, store, with_options

from infoplan.analyse.audit import audit, audit_mission
from infoplan.errors import UsageError
from infoplan.study import store as stored_tables
from infoplan.study.columns import values_digest
from infoplan.study.identity import run_name
from infoplan.study.store import inspect, sealed
from infoplan.tables import TABLES as KNOWN

TABLES = {name: table for name, table in KNOWN.items() if not table.may_be_missing}
CONFIGURATION = with_options(budget=100)
RUN = run_name(CONFIGURATION)
EVERY = [(table, column) for table, laid_down in TABLES.items() for column in laid_down.columns]
SECONDS = ("plan_seconds", "fit_seconds", "predict_seconds", "detect_seconds")


@pytest.fixture(scope="module")
def honest(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("honest")
    tables = fly(CONFIGURATION)
    # Times that differ from epoch to epoch: so that exchanging two of them is a change.
    for i, part in enumerate(SECONDS):
        tables["curves"][part] = 0.1 + 0.01 * i + 0.001 * np.arange(len(tables["curves"]))
    store(folder, CONFIGURATION, tables)
    return folder


def table_path(folder: Path, name: str) -> Path:
    return stored_tables.table_path(folder, name, RUN, SEED)


def halved(values):
    return values / 2 if values.dtype.kind == "f" else values // 2


def negated(values):
    return -values


def without(values):
    return np.where(np.arange(len(values)) == len(values) // 2, np.nan, values)


def exchanged(values):
    """Exchange the last two values that differ."""
    changed = values.copy()
    rows = [i for i in range(len(values) - 1) if values[i] != values[i + 1]]
    rows = [i for i in rows if not (values[i] != values[i] and values[i + 1] != values[i + 1])]
    if rows:
        changed[rows[-1]], changed[rows[-1] + 1] = values[rows[-1] + 1], values[rows[-1]]
    return changed


def forge(folder: Path, table: str, column: str, change, redo: bool) -> bool:
    """Change the middle of a column; with the digests, too, or not. Tells whether it did."""
    path = table_path(folder, table)
    stored = pq.ParquetFile(path).read()
    values = stored[column].to_numpy()
    if pa.types.is_boolean(stored.schema.field(column).type) and values.dtype.kind == "O":
        # With nulls.
        turned = np.array([None if value is None else not value for value in values])
        changed = {exchanged: exchanged(values), negated: turned}.get(change, values)
    elif values.dtype.kind == "O":
        changed = np.array([f"{text}x" for text in values]) if change is halved else values
    elif values.dtype.kind == "b":
        changed = exchanged(values) if change is exchanged else values
        changed = ~values if change is negated else changed
    elif change is exchanged:
        changed = exchanged(values)
    elif change is without:
        changed = without(values) if values.dtype.kind == "f" else values
    else:
        # One row alone: the last that is not zero and no gap.
        row = np.flatnonzero(np.nan_to_num(values))[-1:]
        changed = values.copy()
        changed[row] = change(values[row])
    same = changed == values if values.dtype.kind != "f" else np.array_equal(
        changed, values, equal_nan=True
    )  # fmt: skip
    if np.all(same):
        return False
    field = stored.schema.field(column)
    where = stored.column_names.index(column)
    metadata = stored.schema.metadata
    stored = stored.set_column(where, field, pa.array(changed, field.type))
    if redo:
        footer = json.loads(metadata[b"infoplan"]) | {"values_sha256": values_digest(stored)}
        metadata = {b"infoplan": sealed(footer)}
    pq.write_table(stored.replace_schema_metadata(metadata), path)
    return True


@pytest.fixture
def folder(honest, tmp_path) -> Path:
    return Path(shutil.copytree(honest, tmp_path / "results"))


def failing(folder: Path, epochs=None) -> set[str]:
    findings = audit_mission(folder, RUN, SEED, {"0" * 64: hills()}, epochs)
    return {finding.check for finding in findings if not finding.holds}


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("change", [halved, negated, without, exchanged])
def test_a_change_without_its_digest_is_caught(folder, table, change):
    path = table_path(folder, table)
    honest, changed = path.read_bytes(), 0
    for column in TABLES[table].columns:
        if forge(folder, table, column, change, redo=False):
            changed += 1
            assert inspect(folder, RUN, SEED).state == "broken"
            last = path.read_bytes()
        path.write_bytes(honest)
    assert changed
    path.write_bytes(last)
    assert failing(folder) & {"digests", "files"}


FORGEABLE = {
    *(("curves", part, change) for part in SECONDS for change in (halved, exchanged)),
}
"""Shorter times, and those of other epochs: nothing else is known of them."""


@pytest.mark.parametrize(("table", "column"), EVERY)
@pytest.mark.parametrize("change", [halved, negated, without, exchanged])
def test_a_change_with_a_forged_digest_is_caught_by_recomputing(folder, table, column, change):
    if forge(folder, table, column, change, redo=True):
        found = failing(folder)
        assert "digests" not in found
        assert bool(found) != ((table, column, change) in FORGEABLE)


OTHER = {
    "schema_version": 2, "mission": "another", "run": "another", "seed": SEED + 1,
    "terrain": {"name": "file-hills", "sha256": "1" * 64},
    "configuration": CONFIGURATION | {"rho": 0.2},
    "started": "2030-01-02T03:04:06.000+00:00", "ended": "2030-01-02T03:05:06.000+00:00",
    "seconds": 61.0, "python": "3.11.8", "libraries": {"numpy": "2.0.1"}, "cpu": "another",
    "platform": "another", "blas": [
        {"internal_api": "openblas", "version": "1", "architecture": "x", "num_threads": 1}
    ],
    "git": {"commit": "1" * 40, "dirty": True}, "command": ["infoplan", "audit"],
    "values_sha256": "0" * 64,
}  # fmt: skip
"""Another possible value of each field of a footer."""

NO_FIELD = [
    None, [], {}, "x", 5, True, float("nan"), float("inf"), -1, [[["deep"]]], {"name": 3}, 2**70,
]  # fmt: skip
"""What hardly any field can hold."""


def rewrite(folder: Path, change, redo: bool, tables=TABLES) -> None:
    """Change the footers of some tables; with their digests, or not."""
    for name in tables:
        path = table_path(folder, name)
        stored = pq.ParquetFile(path).read()
        old = json.loads(stored.schema.metadata[b"infoplan"])
        footer = change(dict(old))
        text = sealed(footer) if redo else json.dumps(footer).encode()
        pq.write_table(stored.replace_schema_metadata({b"infoplan": text}), path)


@pytest.mark.parametrize("field", OTHER)
def test_another_footer_is_caught(folder, honest, field):
    for redo, tables in ((False, ["curves"]), (False, list(TABLES)), (True, ["maps"])):
        rewrite(folder, lambda footer: footer | {field: OTHER[field]}, redo, tables)
        assert failing(folder) & {"digests", "files"}
        for name in TABLES:
            table_path(folder, name).write_bytes(table_path(honest, name).read_bytes())
    assert failing(folder) == set()


UNTOLD = {"mission", "python", "libraries", "cpu", "platform", "blas", "git", "command"}
"""Fields of which nothing else is known: forged in all three tables, digests and all."""


@pytest.mark.parametrize("field", OTHER)
def test_a_footer_forged_in_all_tables_is_caught_where_more_is_known(folder, field):
    rewrite(folder, lambda footer: footer | {field: OTHER[field]}, redo=True)
    # Times a second off are those of another clock.
    plausible = UNTOLD | {"started", "ended", "seconds"}
    assert bool(failing(folder)) != (field in plausible)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("started", "2030-01-02T03:14:05.000+00:00", "before it started"),
        ("ended", "2030-01-02T04:05:05.000+00:00", "lie between start and end"),
        ("seconds", 1.0, "the epochs took"),
        ("seconds", 600.0, "lie between start and end"),
    ],
)
def test_forged_times_are_caught(folder, field, value, words):
    rewrite(folder, lambda footer: footer | {field: value}, redo=True)
    findings = audit_mission(folder, RUN, SEED)
    assert [words in finding.detail for finding in findings if not finding.holds] == [True]


@pytest.mark.parametrize("value", NO_FIELD, ids=str)
@pytest.mark.parametrize("field", OTHER)
def test_a_field_of_another_shape_is_named(folder, field, value):
    fits = {("git", None), ("blas", str([])), ("libraries", str({})), ("command", str([]))}
    fits |= {("seconds", 5), ("seconds", True), ("python", "x"), ("cpu", "x"), ("platform", "x")}
    fits |= {("mission", "x")}
    key = value if isinstance(value, int | str | None) else str(value)
    if (field, key) in fits and value is not True:
        return
    rewrite(folder, lambda footer: footer | {field: value}, redo=True)
    [finding] = audit_mission(folder, RUN, SEED)
    assert not finding.holds
    assert finding.check == "files"


def test_a_halved_error_of_any_epoch_is_caught_by_default(folder):
    path = table_path(folder, "curves")
    honest = path.read_bytes()
    last = len(pq.ParquetFile(path).read()) - 1
    assert last > 3
    for epoch in (1, 3, last):
        stored = pq.ParquetFile(path).read()
        for column in ("rmse", "mae"):
            values = stored[column].to_numpy().copy()
            values[epoch] /= 2
            where = stored.column_names.index(column)
            stored = stored.set_column(where, column, pa.array(values))
        footer = json.loads(stored.schema.metadata[b"infoplan"])
        footer["values_sha256"] = values_digest(stored)
        pq.write_table(stored.replace_schema_metadata({b"infoplan": sealed(footer)}), path)
        at_the_end = {"final scores", "final model"} if epoch == last else set()
        assert failing(folder) == {"bounds"} | (at_the_end or {"earlier models"})
        # What follows from other columns is looked at in epochs that are not recomputed, too.
        assert failing(folder, [0]) == {"bounds"} | at_the_end
        path.write_bytes(honest)


def test_what_was_not_recomputed_is_said(folder):
    by_check = {finding.check: finding for finding in audit(folder, epochs=[0, 2])}
    last = len(pq.ParquetFile(table_path(folder, "curves")).read()) - 1
    earlier = by_check["earlier models"]
    assert earlier.detail == "epochs 0, 2 give their rows"
    assert earlier.omitted == f"epochs 1, 3-{last - 1}"
    everything = {finding.check: finding for finding in audit(folder, epochs="all")}
    assert everything["earlier models"].omitted == ""
    [halves] = [f for f in audit(folder, epochs=2) if f.check == "earlier models"]
    assert halves.detail == f"epochs 0, {last // 2} give their rows"


@pytest.mark.parametrize("epochs", [0, -1, "some", [1, -2], 1.5, True, [True], {"a": 1}])
def test_epochs_that_are_none_are_refused(folder, epochs):
    with pytest.raises(UsageError, match=r"epochs=.*use all"):
        audit(folder, epochs=epochs)
