"""Quality of a detector, epoch by epoch."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from infoplan.analyse.curves import missions, ratios
from infoplan.analyse.tables import Selection, load_curves, load_samples
from infoplan.methods import OF_THE_MISSION

LABELS = ("run", "seed", "method", "scope", "rho")
COUNTS = ("tp", "fp", "fn", "tn")
REPEATABLE = ("none", "best", "copod", "local")
"""Detectors that judge by the samples alone: no model, no random numbers, no code of the user's."""


def roc_auc(score: ArrayLike, is_outlier: ArrayLike) -> float:
    """Area under the ROC curve: how often an outlier scores above a clean sample, ties half.

    Parameters
    ----------
    score
        The detector's, higher for outliers, shape (n,).
    is_outlier
        True labels, shape (n,).

    Returns
    -------
    float
        NaN if a score is NaN or a class is empty.
    """
    from scipy.stats import rankdata

    scores, outlier = np.asarray(score, dtype=float), np.asarray(is_outlier, dtype=bool)
    positives, negatives = int(outlier.sum()), int((~outlier).sum())
    if not positives or not negatives or np.isnan(scores).any():
        return float("nan")
    rank_sum = rankdata(scores)[outlier].sum() - positives * (positives + 1) / 2
    return float(rank_sum / (positives * negatives))


def rejudge(samples: pd.DataFrame, detector: Mapping[str, Any]) -> pd.DataFrame:
    """Let the detector judge a mission again, epoch by epoch, on the samples collected so far.

    The tables keep the last judgement of each sample. At scope historical, where samples are judged
    again and again, the earlier ones are worked out here, for the detectors in `REPEATABLE`, which
    are functions of the samples so far.

    Parameters
    ----------
    samples
        One mission's samples.
    detector
        Its options: ``name`` and what else that detector takes; what says
        which samples it judges is ignored.

    Returns
    -------
    DataFrame
        One row an epoch from 1 on: ``epoch``, ``collected``; confusion counts and ``roc_auc`` over
        everything collected so far; the same of the epoch's own batch, named ``own_...``.
    """
    from infoplan.detect import DETECTORS, Evidence

    options = {
        name: value for name, value in detector.items() if name not in OF_THE_MISSION["detector"]
    }
    judge = DETECTORS[detector["name"]]
    samples = samples[samples["measured"].notna()]  # no detector is asked about the others
    epoch = samples["epoch"].to_numpy()
    x = samples[["x1", "x2"]].to_numpy()
    y, outlier = samples["measured"].to_numpy(), samples["is_outlier"].to_numpy(dtype=bool)
    rows = []
    for now in range(1, int(epoch[-1]) + 1):
        n = int(np.searchsorted(epoch, now, side="right"))
        nothing, everything = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
        evidence = Evidence(x[:n], y[:n], epoch[:n], nothing, everything, outlier[:n])
        flagged, score = judge(evidence, None, np.random.default_rng(0), **options)
        own = epoch[:n] == now
        rows.append(
            {"epoch": now, "collected": n}
            | _counts(flagged, outlier[:n])
            | {"roc_auc": roc_auc(score, outlier[:n])}
            | {f"own_{k}": v for k, v in _counts(flagged[own], outlier[:n][own]).items()}
            | {"own_roc_auc": roc_auc(score[own], outlier[:n][own])}
        )
    return pd.DataFrame(rows)


def detector_quality(selection: Selection) -> pd.DataFrame:
    """Quality of the detector at each epoch of each mission.

    Parameters
    ----------
    selection
        From `find_study`, narrowed with `Selection.only` to what is of interest.

    Returns
    -------
    DataFrame
        One row an epoch from 1 on: run, seed, method, scope, rho, epoch, collected; tp, fp, fn, tn,
        precision, recall, false_alarm_rate and roc_auc over what was judged at the epoch (scope
        batch: its own batch; historical: everything so far); own_recall, the recall of the epoch's
        own batch. NaN where there is nothing to divide by, or no score; at scope historical the
        last two are NaN for detectors that are not in `REPEATABLE`.
    """
    curves = dict(missions(load_curves(selection)))
    frames = []
    for key, samples in missions(load_samples(selection)):
        curve = curves[key]
        curve = curve[curve["epoch"] > 0].reset_index(drop=True)
        frame = curve[
            ["run", "seed", "method", "scope", "rho", "epoch", "collected", *COUNTS]
        ].copy()
        values = [ratios(*counts) for counts in frame[list(COUNTS)].to_numpy()]
        frame = frame.join(pd.DataFrame(values, index=frame.index))
        detector = detector_options(selection, key[0])
        if curve["scope"].iloc[0] == "historical" and detector["name"] in REPEATABLE:
            again = rejudge(samples, detector)
            frame["roc_auc"] = again["roc_auc"]
            frame["own_recall"] = again["own_tp"] / (again["own_tp"] + again["own_fn"])
        elif curve["scope"].iloc[0] == "historical":
            frame["roc_auc"] = frame["own_recall"] = float("nan")
        else:
            batches = samples[samples["epoch"] > 0].groupby("epoch")
            aucs = {epoch: roc_auc(own["score"], own["is_outlier"]) for epoch, own in batches}
            frame["roc_auc"] = frame["epoch"].map(aucs)
            frame["own_recall"] = frame["recall"]
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def detector_options(selection: Selection, run: str) -> dict[str, Any]:
    """Options of a run's detector, ``name`` among them."""
    prefix = "detector."
    flat = selection.options[run]
    return {name.removeprefix(prefix): v for name, v in flat.items() if name.startswith(prefix)}


def _counts(flagged: np.ndarray, outlier: np.ndarray) -> dict[str, int]:
    return {
        "tp": int(np.sum(flagged & outlier)),
        "fp": int(np.sum(flagged & ~outlier)),
        "fn": int(np.sum(~flagged & outlier)),
        "tn": int(np.sum(~flagged & ~outlier)),
    }
