"""Detectors of PyOD by name, against PyOD used directly."""

import importlib

import numpy as np
import pytest
from sklearn.preprocessing import StandardScaler
from track import evidence, track

from infoplan.detect import copod, pyod
from infoplan.detect.any_pyod import build, feature_matrix
from infoplan.errors import UsageError


def samples():
    return evidence(*track(), judged=slice(60, None))


def rng():
    return np.random.default_rng(4)


DIRECT = {
    "ECOD": ("ecod", {}),
    "LOF": ("lof", {"n_neighbors": 7}),
    "KNN": ("knn", {"n_neighbors": 3, "method": "mean"}),
    "HBOS": ("hbos", {"n_bins": 12}),
    "IForest": ("iforest", {"n_estimators": 30}),
    "MCD": ("mcd", {}),
    "INNE": ("inne", {}),
}


@pytest.mark.parametrize("features", [["y"], ["x1", "x2", "y"]])
@pytest.mark.parametrize("name", DIRECT)
def test_it_is_pyod_s_on_standardised_features(name, features):
    module, params = DIRECT[name]
    flagged, score = pyod(
        samples(), None, rng(), model=name, features=features, contamination=0.15, params=params
    )
    kind = getattr(importlib.import_module(f"pyod.models.{module}"), name)
    x, y, _ = track()
    columns = {"x1": x[:, 0], "x2": x[:, 1], "y": y}
    values = StandardScaler().fit_transform(np.column_stack([columns[f] for f in features]))
    seed = int(rng().integers(2**31 - 1))
    seeded = {"random_state": seed} if name in ("IForest", "MCD", "INNE") else {}
    reference = kind(contamination=0.15, **params, **seeded).fit(values)
    np.testing.assert_allclose(score, reference.decision_scores_, rtol=1e-6)
    np.testing.assert_array_equal(flagged, reference.labels_ == 1)


def test_copod_is_the_paper_s_detector():
    one, other = pyod(samples(), None, rng(), model="COPOD"), copod(samples(), None, rng())
    np.testing.assert_array_equal(one[0], other[0])
    np.testing.assert_allclose(one[1], other[1], rtol=1e-9)


@pytest.mark.parametrize("name", ["IForest", "LODA", "KDE", "Sampling"])
def test_the_same_generator_gives_the_same_verdict(name):
    one = pyod(samples(), None, rng(), model=name)
    before = np.random.get_state()[1].tolist()  # noqa: NPY002
    other = pyod(samples(), None, rng(), model=name)
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002
    np.testing.assert_array_equal(one[1], other[1])


def test_another_generator_gives_other_scores():
    one = pyod(samples(), None, rng(), model="IForest")[1]
    assert (one != pyod(samples(), None, np.random.default_rng(5), model="IForest")[1]).any()


def test_a_constant_feature_is_zero():
    x, y, is_outlier = track(9, spikes=())
    x[:, 1] = 0.1
    values = feature_matrix(evidence(x, y, is_outlier, judged=slice(None)), ["x2", "y"])
    assert (values[:, 0] == 0).all()
    assert values[:, 1].std() == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("ecod", {}, "did you mean 'ECOD'"),
        ("Isolation", {}, "is no detector of PyOD"),
        ("BaseDetector", {}, "is no detector of PyOD"),
        ("LOF", {"n_neighbours": 3}, "did you mean 'n_neighbors'"),
        ("LOF", {"contamination": 0.2}, "set detector.contamination"),
        ("IForest", {"random_state": 0}, "follows from the mission's seed"),
        ("LSCP", {}, "refuses"),
    ],
)
def test_what_pyod_does_not_take_is_one_sentence(name, params, words):
    with pytest.raises(UsageError, match=words) as caught:
        pyod(samples(), None, rng(), model=name, params=params)
    assert "\n" not in str(caught.value)


def test_every_tabular_detector_is_found():
    for name in ("ABOD", "CBLOF", "COF", "GMM", "INNE", "KPCA", "LOCI", "OCSVM", "PCA", "QMCD"):
        assert type(build(name, 0.1, {}, 0)).__name__ == name
