"""What several detectors say of each sample of a survey, and what the others let one expect."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.detector_check import asked_detectors, judge_at_once
from infoplan.belief import LEAST
from infoplan.config import CopodConfig, DetectorConfig, MissionConfig, QartodConfig
from infoplan.cross_validation import MOST_LEFT_OUT
from infoplan.methods import find, method_label
from infoplan.threads import one_thread
from infoplan.wording import counted

Booleans = NDArray[np.bool_]
Floats = NDArray[np.float64]

MOST_PAIRED = 3000
"""Samples up to which gp_residual is asked of a model that holds all pairs of them: seconds."""


@dataclass(frozen=True)
class Verdict:
    """What one detector says of the samples of a survey.

    Attributes
    ----------
    flagged, score
        Shape (n,); a score is NaN where there is none.
    expected
        What the model, holding all samples that the detector keeps but for the one in question,
        predicts there: the unit of the values, shape (n,); NaN where it is not known.
    threshold
        Scores above it are flagged, all others kept; None where there is no such number.
    """

    flagged: Booleans
    score: Floats
    expected: Floats
    threshold: float | None


def survey_verdicts(
    samples: pd.DataFrame, last: Mapping[str, Any], config: MissionConfig
) -> tuple[dict[str, Verdict], list[str]]:
    """Tell the verdicts of a survey's own detector, as stored, and of others, asked now.

    The others have their defaults and judge all samples at once. All of them, and all expected
    values, have the hyperparameters with which the survey has ended.

    Parameters
    ----------
    samples
        The survey's table, those that have a value.
    last
        The last row of its curve.
    config
        Its mission.

    Returns
    -------
    verdicts : dict of Verdict
        By the detector's name, the survey's own first.
    remarks : list of str
        Sentences on what is left out, and why.
    """
    x, y = samples[["x1", "x2"]].to_numpy(dtype=float), samples["measured"].to_numpy(dtype=float)
    own = method_label(config.detector)
    flagged, score = samples["flagged"].to_numpy(dtype=bool), samples["score"].to_numpy(dtype=float)
    others = {name: one for name, one in asked_detectors(config).items() if name != own}
    remarks, left_out = [], []
    exact = config.model.name not in ("own", "vecchia")
    if exact and len(y) > MOST_PAIRED and "gp_residual" in others:
        left_out = ["gp_residual"]
        remarks.append(
            f"gp_residual is left out: with model={config.model.name} it looks at all pairs of "
            f"samples, of which more than {MOST_PAIRED} have too many"
        )
    if config.model.name == "own":
        left_out = [*left_out, "gp_residual"]
        remarks.append(
            "the hyperparameters of a model of one's own are not stored: no values are expected, "
            "and gp_residual is not asked"
        )
    others = {name: one for name, one in others.items() if name not in left_out}
    with one_thread():
        model = None if config.model.name == "own" else _as_it_ended(samples, last, config)
        found = {own: (flagged, score)} | judge_at_once(x, y, model, others)
        pilot = samples["epoch"].to_numpy() == 0
        scale = float(np.std(y[pilot]))  # the model's unit (`Scaler.of_pilot`)
        verdicts = {
            name: Verdict(
                flags, scores, expected_values(model, x, y, ~flags, scale),
                _threshold(config.detector if name == own else others[name], flags, scores),
            )
            for name, (flags, scores) in found.items()
        }  # fmt: skip
    if exact and max(int((~one.flagged).sum()) for one in verdicts.values()) > MOST_LEFT_OUT:
        remarks.append(
            f"with model={config.model.name}, expected values of more than "
            f"{counted(MOST_LEFT_OUT, 'sample')} take long: only those of flagged ones are told"
        )
    return verdicts, remarks


def expected_values(model: Any, x: Floats, y: Floats, kept: Booleans, scale: float) -> Floats:
    """Predict each sample from those that are kept, itself left out.

    Parameters
    ----------
    model
        Holds the kept ones afterwards; None: nothing is expected.
    x, y
        All samples, shapes (n, 2) and (n,).
    kept
        Which of them are predicted from, shape (n,).
    scale
        Unit of the model's scaled values.

    Returns
    -------
    ndarray, shape (n,)
        NaN everywhere if too few are kept, and at the kept ones for a model of which all at once
        would take too long.
    """
    expected, n = np.full(len(y), np.nan), int(kept.sum())
    if model is None or n < LEAST:
        return expected
    model.replace(x[kept], y[kept])
    if n < len(y):
        expected[~kept] = model.predict(x[~kept])[0]
    sparse = getattr(model, "weights_and_sparse_inverse", None)
    if sparse is None and n > MOST_LEFT_OUT:
        return expected
    # Rasmussen & Williams, eq. 5.12.
    weights, inverse = (sparse or model.weights_and_inverse)(x[kept], y[kept], np.arange(n))
    expected[kept] = y[kept] - scale * weights / inverse.diagonal()
    return expected


def _as_it_ended(samples: pd.DataFrame, last: Mapping[str, Any], config: MissionConfig) -> Any:
    """Make a model with the scalers and the hyperparameters of the survey's last one."""
    pilot = samples[samples["epoch"] == 0]
    model = find("model", config.model)(
        pilot[["x1", "x2"]].to_numpy(dtype=float), pilot["measured"].to_numpy(dtype=float)
    )
    model.recall({name: float(last[name]) for name in vars(model.hyperparameters)})
    return model


def _threshold(options: DetectorConfig, flagged: Booleans, score: Floats) -> float | None:
    """Find the number above which a detector flags; None if its flags do not follow one."""
    limit = getattr(options, "threshold", None)
    if isinstance(options, CopodConfig):  # its percentile, as `infoplan.detect.copod` takes it
        limit = float(np.percentile(score, 100 * (1 - options.contamination)))
    elif isinstance(options, QartodConfig):
        limit = 1.0
    follows = limit is not None and np.array_equal(flagged, score > limit)
    return float(limit) if limit is not None and follows else None
