"""Quality of detectors by epoch, against scikit-learn and against what missions stored."""

from dataclasses import replace

import numpy as np
import pytest
from flown import tables_of
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import precision_score, recall_score, roc_auc_score

from infoplan.analyse import (
    detector_quality,
    find_study,
    load_curves,
    load_samples,
    rejudge,
    roc_auc,
)
from infoplan.config import Config, CopodConfig, DetectorConfig, TerrainConfig
from infoplan.study.identity import identify
from infoplan.study.store import save_mission

COPOD = {"name": "copod", "scope": "historical", "contamination": 0.1, "score": "pyod"}
COUNTS = ["tp", "fp", "fn", "tn"]


@given(st.lists(st.tuples(st.integers(0, 9), st.booleans()), min_size=1, max_size=40))
def test_area_under_the_roc_curve_is_scikit_learns(pairs):
    score, outlier = (np.array(column) for column in zip(*pairs, strict=True))
    if outlier.all() or not outlier.any():
        assert np.isnan(roc_auc(score, outlier))
    else:
        assert roc_auc(score, outlier) == pytest.approx(roc_auc_score(outlier, score))


def test_there_is_no_area_without_scores():
    assert np.isnan(roc_auc([np.nan, 1.0], [True, False]))


@pytest.fixture(scope="module")
def study(tmp_path_factory, volcano):
    """Short real missions of COPOD under both scopes, and of BEST."""
    folder = tmp_path_factory.mktemp("detectors")
    config = Config(budget=300, grid=[12, 12], rho=0.15, terrain=TerrainConfig(name="volcano"))
    config.planner = replace(config.planner, iterations=20)
    config.model = replace(config.model, pilot_iterations=10, iterations=1)
    for detector in (
        CopodConfig(scope="batch"),
        CopodConfig(scope="historical"),
        DetectorConfig("best"),
    ):
        run = identify(replace(config, detector=detector), volcano)
        save_mission(folder, run, 1, tables_of(run, 1), {})
    return find_study(folder)


def one(study, method, scope):
    return study.only([study.run(method, 0.15, scope)])


def test_judging_again_gives_the_counts_of_the_mission(study):
    historical = one(study, "PUCT-COPOD", "historical")
    again = rejudge(load_samples(historical), COPOD)
    curve = load_curves(historical)
    assert again[COUNTS].to_numpy().tolist() == curve[COUNTS].iloc[1:].to_numpy().tolist()
    assert again["collected"].to_list() == curve["collected"].to_list()[1:]
    batch = one(study, "PUCT-COPOD", "batch")
    own = rejudge(load_samples(batch), COPOD)[[f"own_{name}" for name in COUNTS]]
    assert own.to_numpy().tolist() == load_curves(batch)[COUNTS].iloc[1:].to_numpy().tolist()


def test_quality_of_a_batch_is_that_of_its_samples(study):
    batch = one(study, "PUCT-COPOD", "batch")
    quality = detector_quality(batch).set_index("epoch")
    samples = load_samples(batch)
    for epoch, own in samples[samples["epoch"] > 0].groupby("epoch"):
        row = quality.loc[epoch]
        outlier, flagged = own["is_outlier"], own["flagged"]
        assert row["roc_auc"] == pytest.approx(roc_auc_score(outlier, own["score"]))
        assert row["recall"] == row["own_recall"] == pytest.approx(recall_score(outlier, flagged))
        assert row["false_alarm_rate"] == pytest.approx(flagged[~outlier].mean())
        if flagged.any():
            assert row["precision"] == pytest.approx(precision_score(outlier, flagged))
        else:
            assert np.isnan(row["precision"])


def test_quality_at_historical_scope_is_over_everything_so_far(study):
    historical = one(study, "PUCT-COPOD", "historical")
    quality = detector_quality(historical)
    samples = load_samples(historical)
    last = quality.iloc[-1]
    assert last["roc_auc"] == pytest.approx(roc_auc_score(samples["is_outlier"], samples["score"]))
    assert last["recall"] == pytest.approx(recall_score(samples["is_outlier"], samples["flagged"]))
    own = samples[samples["epoch"] == samples["epoch"].max()]
    assert last["own_recall"] == pytest.approx(own.loc[own["is_outlier"], "flagged"].mean())


def test_the_true_labels_make_no_mistakes_and_have_no_score(study):
    quality = detector_quality(one(study, "PUCT-BEST", "batch"))
    assert (quality["recall"] == 1.0).all()
    assert (quality["false_alarm_rate"] == 0.0).all()
    assert quality["roc_auc"].isna().all()
