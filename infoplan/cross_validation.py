"""A belief whose truth nobody knows, against its own samples: cross-validation along the track."""

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.belief import LEAST, Belief
from infoplan.methods import find
from infoplan.scoring import StretchScore
from infoplan.threads import one_thread

Floats = NDArray[np.float64]

STRETCHES = 10
"""So many stretches, equally long in samples, is a track cut into."""

MOST_LEFT_OUT = 5000
"""Samples of which each is left out alone, if that takes a matrix of their number squared."""


def cross_validate(belief: Belief) -> tuple[StretchScore, ...]:
    """Predict each stretch of a track from the others, under the hyperparameters as they are.

    Samples that follow each other have much in common, and often one place: a stretch without any
    of them says what the model knows elsewhere, one sample without itself hardly more than the
    sensor's noise.

    Parameters
    ----------
    belief
        Its model stays as it is, but for one of the user's without ``adopt``: that holds other
        data on the way, and at the end those that it is to hold.

    Returns
    -------
    tuple of StretchScore
        Of all stretches, in order.
    """
    readings, kept = belief.readings, ~belief.flagged
    told = ~np.isnan(readings.measured)
    x, y, stretch = readings.x, readings.measured, stretches_of(len(readings))
    with one_thread():
        model = _second_model(belief)
        left_out = _left_out(belief, kept)
        scores = []
        for number in range(STRETCHES):
            here = kept & (stretch == number)
            errors = [
                predicted_errors(model, x, y, source & (stretch != number), here)
                for source in (kept, told)
            ]
            means = [_root_mean_square(found) for found in (*errors, left_out[here])]
            scores.append(StretchScore(belief.epoch, number, int(here.sum()), *means))
        if model is belief.model:
            model.replace(x[kept], y[kept])
    return tuple(scores)


def _second_model(belief: Belief) -> Any:
    """Make a model with the scalers and hyperparameters of the belief's."""
    if not hasattr(belief.model, "adopt"):
        return belief.model
    pilot = (belief.epochs == 0) & ~np.isnan(belief.readings.measured)
    model = find("model", belief.config.model)(
        belief.readings.x[pilot], belief.readings.measured[pilot]
    )
    model.adopt(belief.model)
    return model


def stretches_of(n: int) -> NDArray[np.int64]:
    """Cut a track of n samples into stretches, counted from 0, shape (n,)."""
    return np.arange(n) * STRETCHES // n


def predicted_errors(
    model: Any, x: Floats, y: Floats, source: NDArray[np.bool_], asked: NDArray[np.bool_]
) -> Floats:
    """Give the errors of predictions at some samples from others, which the model then holds.

    Parameters
    ----------
    model
        Fitted; its hyperparameters stay.
    x, y
        All samples, shapes (n, 2) and (n,).
    source, asked
        From which, and at which, shape (n,).

    Returns
    -------
    ndarray
        One error a sample that is asked; empty where there are too few to predict from.
    """
    if source.sum() < LEAST or not asked.any():
        return np.empty(0)
    model.replace(x[source], y[source])
    mean, _ = model.predict(x[asked])
    return np.asarray(mean, dtype=np.float64) - y[asked]


def _left_out(belief: Belief, kept: NDArray[np.bool_]) -> Floats:
    """Errors of each sample in the model predicted from the others, in closed form, shape (n,).

    NaN where it is not in the model, and everywhere for a model of the user's, whose scale is
    unknown, and for too many samples.
    """
    errors, n = np.full(len(kept), np.nan), int(kept.sum())
    is_sparse = hasattr(belief.model, "weights_and_sparse_inverse")
    if belief.config.model.name == "own" or n < LEAST or (n > MOST_LEFT_OUT and not is_sparse):
        return errors
    readings, pilot = belief.readings, belief.epochs == 0
    conditioned = (
        belief.model.weights_and_sparse_inverse if is_sparse else belief.model.weights_and_inverse
    )
    weights, inverse = conditioned(readings.x[kept], readings.measured[kept], np.arange(n))
    scale = np.nanstd(readings.measured[pilot])  # the model's unit (`Scaler.of_pilot`)
    errors[kept] = scale * weights / inverse.diagonal()
    return errors


def _root_mean_square(errors: Floats) -> float:
    return sqrt(np.mean(errors**2)) if len(errors) else float("nan")
