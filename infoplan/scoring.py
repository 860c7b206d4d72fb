"""What a belief is worth: its predictions against the truth, its verdicts against the labels."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import number_of
from infoplan.belief import Belief
from infoplan.collapse import has_collapsed, spacing_of
from infoplan.config import OwnModelConfig
from infoplan.errors import RunError
from infoplan.methods import method_label
from infoplan.samples import Batch, Samples
from infoplan.scores import (
    by_third,
    continuous_ranked_probability,
    path_length,
    standardised_log_loss,
    standardised_square,
)
from infoplan.tables import TABLES

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CurveRow:
    """The state of a mission after an epoch: a row of its learning curve.

    Errors and scores compare the noise-free truth on the query grid with the model's latent mean
    and standard deviation, and are NaN where the terrain is unknown; hyperparameters are in scaled
    units, elevations in the terrain's. What the model has not (one of the user's) is NaN;
    `collapsed` and `rate_limited` are then None. `further` holds, by name, what else the kernel has
    learned: a column each.
    """

    epoch: int
    collected: int
    accepted: int
    rmse: float
    mae: float
    nlpd: float
    coverage95: float
    tp: int
    fp: int
    fn: int
    tn: int
    amplitude: float
    lengthscale_1: float
    lengthscale_2: float
    noise_std: float
    jitter: float
    lml: float
    plan_seconds: float
    fit_seconds: float
    predict_seconds: float
    detect_seconds: float
    crps: float
    smse: float
    msll: float
    rmse_flat: float
    rmse_middle: float
    rmse_rugged: float
    path_length: float
    collapsed: bool | None
    rate_limited: bool | None
    further: Mapping[str, float] = field(default_factory=dict, kw_only=True)


@dataclass(frozen=True)
class Maps:
    """The query grid, row-major; every array has one entry a node, elevations in terrain's unit.

    Attributes
    ----------
    x
        Location, shape (n, 2), workspace units.
    truth
        Elevation; NaN where nobody knows it.
    mean, std
        The model's latent ones.
    outlier_density
        Smoothed outlier matrix.
    """

    x: Floats
    truth: Floats
    mean: Floats
    std: Floats
    outlier_density: Floats


@dataclass(frozen=True)
class StretchScore:
    """How well a stretch of a survey's track is predicted without its samples, after an epoch.

    Errors are root mean squares over the samples of the stretch that are in the model, terrain's
    unit; NaN where there is none, or none elsewhere.

    Attributes
    ----------
    epoch, stretch
        Which; stretches are counted from 0 along the track.
    samples
        How many of its samples are in the model.
    rmse
        Predicted from the samples of the other stretches that are in the model.
    rmse_unfiltered
        Likewise, from those that were flagged, too.
    loo_rmse
        Each predicted from all others in the model, the same stretch among them.
    """

    epoch: int
    stretch: int
    samples: int
    rmse: float
    rmse_unfiltered: float
    loo_rmse: float


@dataclass(frozen=True)
class State:
    """A mission after an epoch: its row of the curve, all samples as judged now, the maps.

    Of a survey `stretches` score it instead of the truth.
    """

    row: CurveRow
    samples: Samples
    maps: Maps
    stretches: tuple[StretchScore, ...] = ()


def assess(
    belief: Belief, collected: Batch, grid_truth: Floats, grid_third: NDArray[np.intp]
) -> State:
    """Compare a belief with the truth.

    Parameters
    ----------
    belief
        As it is now.
    collected
        All samples that it was taught, with what their source knows of them.
    grid_truth
        Elevation at the nodes of the query grid, shape (n,); NaN where nobody knows it.
    grid_third
        Third of the grid by relief that each node is in, shape (n,).

    Raises
    ------
    RunError
        If an error overflows: such a prediction is no result.
    """
    labels = collected.is_outlier
    samples = Samples(
        epoch=belief.epochs,
        x=collected.x,
        heading=collected.heading,
        truth=collected.truth,
        measured=collected.measured,
        is_outlier=np.zeros(len(collected), dtype=bool) if labels is None else labels,
        flagged=belief.flagged,
        score=belief.score,
    )
    learned = getattr(belief.model, "hyperparameters", None)
    row = CurveRow(
        epoch=belief.epoch,
        collected=belief.collected,
        accepted=int(np.sum(~belief.flagged)),
        **_errors(belief, collected.measured[~belief.flagged], grid_truth, grid_third),
        **count_confusion(samples[belief.judged]),
        amplitude=number_of(learned, "amplitude"),
        lengthscale_1=number_of(learned, "lengthscale_1"),
        lengthscale_2=number_of(learned, "lengthscale_2"),
        noise_std=number_of(learned, "noise_std"),
        jitter=number_of(belief.model, "jitter"),
        lml=belief.lml,
        plan_seconds=belief.seconds["plan"],
        fit_seconds=belief.seconds["fit"],
        predict_seconds=belief.seconds["predict"],
        detect_seconds=belief.seconds["detect"],
        path_length=path_length(collected.x),
        collapsed=_collapsed(belief, learned),
        rate_limited=belief.rate_limited,
        further=_further(learned),
    )
    density = belief.outlier_density().ravel()
    return State(row, samples, Maps(belief.nodes, grid_truth, belief.mean, belief.std, density))


def count_confusion(judged: Samples) -> dict[str, int]:
    """Count true and false positives and negatives of the detector; positive means outlier."""
    flagged, outlier = judged.flagged, judged.is_outlier
    return {
        "tp": int(np.sum(flagged & outlier)),
        "fp": int(np.sum(flagged & ~outlier)),
        "fn": int(np.sum(~flagged & outlier)),
        "tn": int(np.sum(~flagged & ~outlier)),
    }


def _collapsed(belief: Belief, learned: Any) -> bool | None:
    """Tell whether the model has collapsed; one of the user's may scale its inputs as it likes."""
    if isinstance(belief.config.model, OwnModelConfig):
        return None
    lengthscales = [number_of(learned, name) for name in ("lengthscale_1", "lengthscale_2")]
    readings = belief.readings
    pilot = readings.x[(belief.epochs == 0) & ~np.isnan(readings.measured)]
    return has_collapsed(lengthscales, pilot, spacing_of(belief.config, pilot))


def _further(learned: Any) -> dict[str, float]:
    """Hyperparameters that no column of `TABLES` holds, by name."""
    told = vars(learned) if isinstance(learned, SimpleNamespace) else {}
    known = {"run", *TABLES["curves"].columns}
    return {name: value for name, value in told.items()
            if name not in known and isinstance(value, float)}  # fmt: skip


def _errors(
    belief: Belief, measured: Floats, truth: Floats, third: NDArray[np.intp]
) -> dict[str, Any]:
    """Compare the prediction, which comes from these measurements, with the truth."""
    mean, std = belief.mean, belief.std
    with np.errstate(over="ignore", invalid="ignore"):
        error = mean - truth
        standardised = error / std
        log_density = -0.5 * standardised**2 - np.log(std) - 0.5 * np.log(2 * np.pi)
        inside = np.where(np.isnan(error), np.nan, np.abs(standardised) <= 1.959964)
        nlpd = float(-np.mean(log_density))
        errors = {
            "rmse": float(np.sqrt(np.mean(error**2))),
            "mae": float(np.mean(np.abs(error))),
            "nlpd": nlpd,
            "coverage95": float(np.mean(inside)),
            "crps": float(np.mean(continuous_ranked_probability(mean, std, truth))),
            "smse": standardised_square(error, truth),
            "msll": standardised_log_loss(nlpd, truth, measured),
            **by_third(error, third),
        }
    if overflown := [name for name, value in errors.items() if np.isinf(value)]:
        raise RunError(
            f"the {overflown[0]} of the model {method_label(belief.config.model)} overflows: it "
            f"predicts {mean.min():.3g} to {mean.max():.3g} with deviations from {std.min():.3g}, "
            f"where the terrain has {truth.min():.3g} to {truth.max():.3g}; look at its data and "
            "its numerical precision"
        )
    return errors
