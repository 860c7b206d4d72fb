"""The audit repeats the detectors and models that were added to the paper's, and catches changes.

That it holds for all of them, in every combination, is tried in tests/test_plugins.py.
"""

import json
from dataclasses import replace

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from flown import tables_of

from infoplan.analyse.audit import audit_mission
from infoplan.config import KERNELS, METHODS
from infoplan.model.kernels import as_kernel
from infoplan.study.columns import values_digest
from infoplan.study.identity import identify
from infoplan.study.store import (
    save_mission,
    sealed,
    table_path,
)


def store(config, terrain, folder, **groups):
    for group, (choice, changes) in groups.items():
        setattr(config, group, replace(METHODS[group][choice], **changes))
    config.model = replace(config.model, pilot_iterations=20, iterations=2)
    config.budget, config.rho = 220, 0.15
    run = identify(config, terrain)
    save_mission(folder, run, 2, tables_of(run, 2), {})
    return run.name


def touch(folder, table, name, column, change, among=None):
    """Change the last value that there is in a column, where another is true."""
    path = table_path(folder, table, name, 2)
    schema = pq.read_schema(path)
    footer = json.loads(schema.metadata[b"infoplan"])
    frame = pd.read_parquet(path, partitioning=None)
    chosen = frame[column].where(frame[among]) if among else frame[column]
    row = chosen.last_valid_index()
    frame.loc[row, column] = change(frame.loc[row, column])
    texts = [key for key in frame if frame[key].dtype.kind not in "bif"]
    columns = {key: pa.array(frame[key].to_numpy()) for key in frame if key not in texts}
    columns |= {key: pa.array(frame[key].tolist(), schema.field(key).type) for key in texts}
    touched = pa.table({key: columns[key] for key in frame})
    text = sealed(footer | {"values_sha256": values_digest(touched)})
    pq.write_table(touched.replace_schema_metadata({b"infoplan": text}), path)


def failing(folder, name):
    return {finding.check for finding in audit_mission(folder, name, 2) if not finding.holds}


DETECTORS = {
    "forest": ("pyod", {"model": "IForest", "features": ["x1", "x2", "y"]}),
    "neighbours": ("pyod", {"model": "KNN", "params": {"n_neighbors": 3}, "scope": "historical"}),
    "residual": ("gp_residual", {"threshold": 2.0}),
    "residual, all at once": ("gp_residual", {"threshold": 1.0, "one_by_one": False}),
    "residual, historical": ("gp_residual", {"threshold": 2.0, "scope": "historical"}),
    "local": ("local", {"threshold": 2.0}),
    "local, historical": ("local", {"neighbours": 5, "scope": "historical"}),
    "hampel": ("hampel", {"threshold": 2.0}),
    "qartod, historical": ("qartod", {"spike": 3.0, "scope": "historical"}),
}


@pytest.mark.parametrize("scope", ["batch", "historical"])
@pytest.mark.parametrize("model", ["gp", "vecchia"])
def test_verdicts_on_a_judged_pilot_are_repeated(small, volcano, tmp_path, model, scope):
    small.pilot = replace(small.pilot, outliers=True)
    detector = ("copod", {"judge_pilot": True, "scope": scope})
    name = store(small, volcano, tmp_path, detector=detector, model=(model, {}))
    assert failing(tmp_path, name) == set()
    touch(tmp_path, "samples", name, "flagged", lambda flag: not flag, "is_outlier")
    assert failing(tmp_path, name) >= {"flags"}


@pytest.mark.parametrize("scope", ["batch", "historical"])
@pytest.mark.parametrize(
    "detector", [("gp_residual", {"threshold": 2.0}), ("pyod", {"model": "KNN"})]
)
def test_of_a_judged_pilot_what_is_not_stored_is_told(small, volcano, tmp_path, detector, scope):
    small.pilot = replace(small.pilot, outliers=True)
    choice, options = detector
    detector = (choice, {**options, "judge_pilot": True, "scope": scope})
    name = store(small, volcano, tmp_path, detector=detector)
    assert failing(tmp_path, name) == set()
    [scores] = [found for found in audit_mission(tmp_path, name, 2) if found.check == "scores"]
    assert ("a model of the whole pilot" in scores.omitted) == (choice == "gp_residual")


def test_spikes_that_share_their_draw_are_checked(small, volcano, tmp_path):
    small.pilot = replace(small.pilot, outliers=True)
    name = store(small, volcano, tmp_path, fault=("spike", {"draw": "batch"}))
    assert failing(tmp_path, name) == set()
    path = table_path(tmp_path, "samples", name, 2)
    frame = pd.read_parquet(path, partitioning=None)
    first = frame.index[frame["is_outlier"]][0]
    mirrored = frame["measured"].where(frame.index != first, 2 * frame["truth"] - frame["measured"])
    spoil(path, "measured", lambda _: mirrored)
    told = quickly_failing(tmp_path, name)
    assert told["spike draws"] == "the spikes of epoch 0 point both ways, fault.draw=batch"


@pytest.mark.parametrize("detector", DETECTORS)
def test_scores_and_flags_of_a_detector_are_repeated(small, volcano, tmp_path, detector):
    name = store(small, volcano, tmp_path, detector=DETECTORS[detector])
    assert failing(tmp_path, name) == set()
    touch(tmp_path, "samples", name, "score", lambda score: score * 1.001)
    assert failing(tmp_path, name) == {"scores"}
    touch(tmp_path, "samples", name, "flagged", lambda flag: not flag)
    assert failing(tmp_path, name) >= {"scores", "flags"}


@pytest.mark.parametrize(
    ("table", "column", "check"),
    [("curves", "lml", "final model"), ("maps", "mean", "final model"),
     ("maps", "std", "final model"), ("curves", "noise_std", "final model")],
)  # fmt: skip
def test_the_student_t_process_is_recomputed(small, volcano, tmp_path, table, column, check):
    name = store(small, volcano, tmp_path, model=("student_t", {"dof": 3.0}))
    assert failing(tmp_path, name) == set()
    touch(tmp_path, table, name, column, lambda value: value * 1.01)
    assert check in failing(tmp_path, name)


@pytest.mark.parametrize(
    ("model", "kernel"),
    [*(pytest.param("gp", kernel, marks=pytest.mark.long) for kernel in KERNELS[1:-1]),
     ("gp", KERNELS[-1]), ("student_t", KERNELS[-1]), ("vecchia", KERNELS[-1])],
)  # fmt: skip
def test_every_kernel_is_recomputed(small, volcano, tmp_path, model, kernel):
    name = store(small, volcano, tmp_path, model=(model, {"kernel": kernel}))
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    own = [one.name for one in as_kernel(kernel).hyperparameters][-1]
    touch(tmp_path, "curves", name, own, lambda value: value * 1.1)
    assert "final model" in failing(tmp_path, name)


@pytest.mark.parametrize(
    "options", [{}, {"centre_neighbours": None, "criterion": "plain", "outlier_fraction": 0.3}]
)
def test_the_robust_conjugate_process_is_recomputed(small, volcano, tmp_path, options):
    name = store(small, volcano, tmp_path, model=("rcgp", options))
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    models = [finding for finding in findings if finding.check.endswith("models")]
    assert [finding.omitted for finding in models] == [""]
    for table, column in [("curves", "lml"), ("maps", "mean"), ("maps", "std")]:
        touch(tmp_path, table, name, column, lambda value: value * 1.01)
        assert "final model" in failing(tmp_path, name)


@pytest.mark.parametrize(
    "steps", [{}, {"reweighting": 0}, {"reweighting": 0, "concentrating": 0, "shrinking": 1}]
)
def test_of_the_trimming_process_what_is_not_stored_is_told(small, volcano, tmp_path, steps):
    name = store(
        small, volcano, tmp_path, model=("itgp", steps),
        detector=("gp_residual", {"threshold": 2.0}),
    )  # fmt: skip
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    omitted = {finding.check for finding in findings if "trimmed is not" in finding.omitted}
    assert len(omitted) == 2
    # Scores need the consistency factor, which follows from the options.
    touch(tmp_path, "samples", name, "score", lambda score: score * 1.001)
    assert failing(tmp_path, name) == {"scores"}


def test_of_relevance_pursuit_what_is_not_stored_is_told(small, volcano, tmp_path):
    name = store(small, volcano, tmp_path, model=("relevance_pursuit", {}))
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    assert sum("noise of their own is not" in finding.omitted for finding in findings) == 2
    touch(tmp_path, "curves", name, "noise_std", lambda value: -value)
    assert "hyperparameters" in failing(tmp_path, name)


NEAR = {"neighbours": 6, "block": 4, "prediction_neighbours": 30}


@pytest.mark.parametrize("ordering", ["collected", "maxmin", "random"])
@pytest.mark.parametrize("scope", ["batch", pytest.param("historical", marks=pytest.mark.long)])
def test_the_process_of_nearest_neighbours_is_recomputed(small, volcano, tmp_path, ordering, scope):
    name = store(
        small, volcano, tmp_path, model=("vecchia", {**NEAR, "ordering": ordering}),
        detector=("gp_residual", {"threshold": 2.0, "scope": scope}),
    )  # fmt: skip
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    models = [finding for finding in findings if finding.check.endswith("models")]
    assert [finding.omitted for finding in models] == [""]
    for table, column, check in [
        ("curves", "lml", "final model"), ("maps", "mean", "final model"),
        ("samples", "score", "scores"),
    ]:  # fmt: skip
        touch(tmp_path, table, name, column, lambda value: value * 1.001)
        assert check in failing(tmp_path, name)


def test_neighbours_of_a_history_that_is_not_stored_are_passed_over(small, volcano, tmp_path):
    name = store(
        small, volcano, tmp_path, model=("vecchia", NEAR),
        detector=("own", {"function": "own_methods.high", "scope": "historical"}),
    )  # fmt: skip
    findings = {finding.check: finding for finding in audit_mission(tmp_path, name, 2)}
    assert all(finding.holds for finding in findings.values())
    assert "what the model held before" in findings["final model"].omitted


@pytest.mark.parametrize("scope", ["batch", "historical"])
def test_neighbours_are_repeated_where_some_samples_tell_nothing(small, volcano, tmp_path, scope):
    name = store(
        small, volcano, tmp_path, model=("vecchia", NEAR), fault=("dropout", {}),
        detector=("gp_residual", {"threshold": 2.0, "scope": scope}),
    )  # fmt: skip
    findings = audit_mission(tmp_path, name, 2)
    assert [finding.check for finding in findings if not finding.holds] == []
    [scores] = [finding for finding in findings if finding.check == "scores"]
    assert scores.omitted == ""
    touch(tmp_path, "samples", name, "score", lambda score: score * 1.001)
    assert failing(tmp_path, name) == {"scores"}


def test_a_detector_that_the_audit_does_not_know_is_passed_over(
    small, volcano, tmp_path, monkeypatch
):
    name = store(small, volcano, tmp_path, detector=("local", {"threshold": 2.0}))
    monkeypatch.setattr("infoplan.analyse.audit.detector.REPEATED", ("none", "best"))
    findings = {finding.check: finding for finding in audit_mission(tmp_path, name, 2)}
    assert all(finding.holds for finding in findings.values())
    assert findings["scores"].omitted == "the scores: the audit does not know detector=local"


def test_what_cannot_be_repeated_is_passed_over(small, volcano, tmp_path):
    name = store(
        small, volcano, tmp_path,
        detector=("own", {"function": "own_methods.high", "scope": "historical"}),
        planner=("own", {"function": "own_methods.leftmost"}),
    )  # fmt: skip
    findings = audit_mission(tmp_path, name, 2)
    checks = {finding.check for finding in findings if finding.detail}
    assert failing(tmp_path, name) == set()
    assert "scores" not in checks
    [scores] = [finding for finding in findings if finding.check == "scores"]
    assert scores.omitted == "the scores: the detector is the user's own"
    assert {"flags", "confusion", "actions", "final model", "outlier density"} <= checks
    touch(tmp_path, "samples", name, "used", lambda used: not used)
    assert failing(tmp_path, name) >= {"flags"}


FAULTS = {
    "max_range": {},
    "uniform": {},
    "burst": {},
    "stuck": {"length": 4.0},
    "bias": {"length": 6.0},
    "drift": {"length": 6.0},
    "heavy_tail": {},
    "local": {"regions": [0.0, 25.0, 0.0, 50.0]},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_checked(small, volcano, tmp_path, fault):
    small.pilot = replace(small.pilot, outliers=True)  # more samples to judge by
    name = store(small, volcano, tmp_path, fault=(fault, FAULTS[fault]))
    findings = audit_mission(tmp_path, name, 2)
    assert not [finding for finding in findings if not finding.holds]
    told = {finding.check: finding for finding in findings}
    assert told["outlier share"].detail.endswith(fault)
    assert told["outlier errors"].detail.endswith(f"outliers as of {fault}")
    assert not told["outlier errors"].omitted
    assert "spike size" not in told

    path = table_path(tmp_path, "samples", name, 2)
    honest = path.read_bytes()
    if fault != "heavy_tail":  # of which any one value is possible
        touch(tmp_path, "samples", name, "measured", lambda said: said + 1e4, "is_outlier")
        assert "outlier errors" in quickly_failing(tmp_path, name)
        path.write_bytes(honest)
    if fault in ("uniform", "heavy_tail"):
        spoil(path, "measured", lambda frame: frame["truth"].mean() + 2e3 * frame["is_outlier"])
        assert quickly_failing(tmp_path, name)["outlier errors"].endswith("are not as drawn")
        path.write_bytes(honest)
    spoil(path, "is_outlier", lambda frame: frame["epoch"] >= 0)
    assert "outlier share" in quickly_failing(tmp_path, name)


def quickly_failing(folder, name):
    """Do as `failing`, the models of epochs before the last apart."""
    found = audit_mission(folder, name, 2, epochs=[0])
    return {finding.check: finding.detail for finding in found if not finding.holds}


def spoil(path, column, change):
    """Write other numbers into a column of a table, its digests right."""
    footer = json.loads(pq.read_schema(path).metadata[b"infoplan"])
    frame = pd.read_parquet(path, partitioning=None)
    frame[column] = change(frame)
    touched = pa.table({key: pa.array(frame[key].to_numpy()) for key in frame})
    text = sealed(footer | {"values_sha256": values_digest(touched)})
    pq.write_table(touched.replace_schema_metadata({b"infoplan": text}), path)


def test_a_clean_pilot_has_no_outliers(small, volcano, tmp_path):
    name = store(small, volcano, tmp_path, fault=("stuck", {}))
    path = table_path(tmp_path, "samples", name, 2)
    spoil(path, "is_outlier", lambda frame: frame["epoch"] >= 0)
    told = quickly_failing(tmp_path, name)["outlier share"]
    assert told.startswith("sample 0 (epoch 0) is an outlier, but the pilot has none")
