"""The audit holds for real short missions of every method, and catches tables that were touched."""

import itertools
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from flown import tables_of

from infoplan.analyse.audit import audit_mission
from infoplan.config import CopodConfig, DetectorConfig
from infoplan.study.identity import identify
from infoplan.study.store import save_mission, table_path

METHODS = list(
    itertools.product(["uct", "puct"], ["none", "best", "copod", "paper"], ["batch", "historical"])
)


def store(config, terrain, folder: Path, seed: int = 2) -> str:
    run = identify(config, terrain)
    tables = tables_of(run, seed)
    save_mission(folder, run, seed, tables, {})
    return run.name


def method(config, planner, detector, scope):
    options = CopodConfig(score="paper") if detector == "paper" else CopodConfig()
    if detector in ("none", "best"):
        options = DetectorConfig(name=detector)
    return replace(
        config,
        budget=230,
        rho=0.15,
        planner=replace(config.planner, name=planner),
        detector=replace(options, scope=scope),
    )


@pytest.mark.parametrize(("planner", "detector", "scope"), METHODS)
def test_every_method_holds(small, volcano, tmp_path, planner, detector, scope):
    name = store(method(small, planner, detector, scope), volcano, tmp_path)
    findings = audit_mission(tmp_path, name, 2, {volcano.sha256: volcano.elevation})
    assert len(findings) > 20
    assert not [finding for finding in findings if not finding.holds]


@pytest.mark.parametrize(
    ("table", "column", "check"),
    [
        ("samples", "x1", "steps"),
        ("samples", "heading", "actions"),
        ("samples", "truth", "truth"),
        ("samples", "measured", "scores"),
        ("samples", "flagged", "flags"),
        ("samples", "is_outlier", "spike count"),
        ("curves", "rmse", "final scores"),
        ("curves", "lml", "final model"),
        ("curves", "fp", "confusion"),
        ("maps", "mean", "final model"),
        ("maps", "std", "final model"),
        ("maps", "outlier_density", "outlier density"),
    ],
)
def test_a_touched_table_is_caught(small, volcano, tmp_path, table, column, check):
    name = store(method(small, "puct", "copod", "batch"), volcano, tmp_path)
    path = table_path(tmp_path, table, name, 2)
    metadata = pq.read_schema(path).metadata
    frame = pd.read_parquet(path, partitioning=None)
    row = len(frame) - 2 if table != "curves" else len(frame) - 1
    value = frame.loc[row, column]
    frame.loc[row, column] = (not value) if frame[column].dtype == bool else value * 1.001 + 1
    touched = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(metadata)
    pq.write_table(touched, path)
    findings = audit_mission(tmp_path, name, 2, {volcano.sha256: volcano.elevation})
    assert check in {finding.check for finding in findings if not finding.holds}
