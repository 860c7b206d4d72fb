"""Samples along a track, some of them spikes, for tests of detectors that know space."""

import numpy as np

from infoplan.detect import Evidence
from infoplan.model import GaussianProcess


def track(n=80, spikes=(47, 60, 61, 75), height=80.0, seed=0):
    """Return positions of shape (n, 2), measurements and true labels along a winding track."""
    rng = np.random.default_rng(seed)
    way = np.linspace(0, 9, n)
    x = np.column_stack([10 + 8 * np.cos(way) + way / 3, 10 + 8 * np.sin(1.3 * way)])
    y = 40 * np.sin(x[:, 0] / 4) + 30 * np.cos(x[:, 1] / 5) + rng.standard_normal(n)
    is_outlier = np.isin(np.arange(n), spikes)
    return x, y + height * is_outlier * rng.choice([-1.0, 1.0], n), is_outlier


def evidence(x, y, is_outlier, *, judged, flagged=()):
    """Pack samples, of which the slice `judged` is asked for, and `flagged` were dropped before."""
    n = np.arange(len(y))
    return Evidence(
        x=x,
        measured=y,
        epoch=np.zeros(len(y), int),
        flagged=np.isin(n, flagged),
        judged=np.isin(n, n[judged]),
        is_outlier=is_outlier,
    )


def fitted(x, y, kind=GaussianProcess, **options):
    """Return a model that has learned from the first half of the samples."""
    half = len(y) // 2
    model = kind(x[:half], y[:half], noise_variance=1e-3, **options)
    model.optimize(60)
    return model
