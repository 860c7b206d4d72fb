"""Detectors compared on a survey, without labels: who flags what, and who finds planted spikes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.statistics import Interval, mean_interval
from infoplan.answers import checked_verdict
from infoplan.config import METHODS, DetectorConfig, MissionConfig, SpikeConfig
from infoplan.cross_validation import predicted_errors, stretches_of
from infoplan.detect import Evidence, Judgement
from infoplan.errors import UsageError
from infoplan.fault.sensed import Sensed
from infoplan.methods import find, method_label
from infoplan.randomness import generator
from infoplan.samples import Samples
from infoplan.threads import one_thread

Booleans = NDArray[np.bool_]
Floats = NDArray[np.float64]

NOT_ASKED = ("none", "best", "own", "pyod")
"""Detectors that say nothing, need labels, or are many; a chosen one of these is asked."""

SEED = 0
"""Of where spikes are planted, and of what random detectors do."""


@dataclass(frozen=True)
class Checked:
    """What one detector says of a survey.

    Attributes
    ----------
    flagged
        Of the samples that have a value, shape (n,).
    planted, found
        Spikes that were planted in a copy, and those of them that it flags there.
    besides
        Other samples that it flags in the copy.
    gain
        What leaving out its flags does to the error of the predictions: paired by stretch, at the
        samples that no detector flags; the unit of the values. Below 0 it helps.
    """

    flagged: Booleans
    planted: int
    found: int
    besides: int
    gain: Interval


def check_detectors(samples: Samples, config: MissionConfig, share: float) -> dict[str, Checked]:
    """Ask all detectors about a survey, and about a copy of it with planted spikes.

    Each judges all samples at once, under the hyperparameters that the model has learned from all
    of them, spikes and all.

    Parameters
    ----------
    samples
        Of the survey; those without a value are left out.
    config
        Its mission: the model, the detector that was chosen. It is asked with its options, all
        others with their defaults.
    share
        Of the samples that become spikes, of which at least one must; sizes and signs are those of
        the fault ``spike``.

    Returns
    -------
    dict of Checked
        By the detector's name.

    Raises
    ------
    UsageError
        If the share is too small for a spike.
    """
    told = ~np.isnan(samples.measured)
    x, y = samples.x[told], samples.measured[told]
    nowhere = np.full(len(y), np.nan)
    sensed = Sensed(x, nowhere, nowhere, y, np.arange(len(y), dtype=float), 0, np.nan, np.nan)
    planted = find("fault", SpikeConfig())(sensed, None, share, generator(SEED, "fault", 0))
    count = int(planted.is_outlier.sum())
    if not count:
        raise UsageError(f"check={share:g} of {len(y)} samples is no spike: make it larger")
    detectors = asked_detectors(config)
    with one_thread():
        model = _learned(x, y, config)
        flags = {name: one[0] for name, one in judge_at_once(x, y, model, detectors).items()}
        gains = _gains(x, y, model, flags)
        copy = planted.measured
        in_copy = judge_at_once(x, copy, _learned(x, copy, config), detectors)
    return {
        name: Checked(
            flags[name],
            count,
            int(np.sum(in_copy[name][0] & planted.is_outlier)),
            int(np.sum(in_copy[name][0] & ~planted.is_outlier)),
            gains[name],
        )
        for name in detectors
    }


def agreement(flags: Mapping[str, Booleans]) -> pd.DataFrame:
    """Count the samples that each two detectors both flag; a detector with itself: all it flags."""
    return pd.DataFrame({a: {b: int(np.sum(flags[a] & flags[b])) for b in flags} for a in flags})


def asked_detectors(config: MissionConfig) -> dict[str, DetectorConfig]:
    """Options of the detectors that are asked, by name, the chosen one first."""
    chosen = {method_label(config.detector): config.detector}
    others = {name: one for name, one in METHODS["detector"].items() if name not in NOT_ASKED}
    chosen.pop("none", None)
    return {**chosen, **{name: one for name, one in others.items() if name not in chosen}}


def _learned(x: Floats, y: Floats, config: MissionConfig) -> Any:
    """Fit the model to all samples."""
    model = find("model", config.model)(x, y)
    model.optimize(config.model.pilot_iterations)
    return model


def judge_at_once(
    x: Floats, y: Floats, model: Any, detectors: Mapping[str, DetectorConfig]
) -> dict[str, Judgement]:
    """Ask each detector about all samples, as if none had been judged before.

    Parameters
    ----------
    x, y
        Positions and what was measured there, shapes (n, 2) and (n,).
    model
        Its hyperparameters stay.
    detectors
        Their options by name.

    Returns
    -------
    dict
        Flags and scores by name.
    """
    n = len(y)
    nothing = np.zeros(n, dtype=bool)
    evidence = Evidence(x, y, np.zeros(n, dtype=np.int64), nothing, ~nothing, None)
    return {
        name: checked_verdict(
            find("detector", options)(evidence, model, generator(SEED, "detector", 1)), n, name
        )
        for name, options in detectors.items()
    }


def _gains(x: Floats, y: Floats, model: Any, flags: Mapping[str, Booleans]) -> dict[str, Interval]:
    """Compare, for each detector, predictions without its flags with those from all samples."""
    stretch = stretches_of(len(y))
    asked = ~np.any([*flags.values()], axis=0)
    changes: dict[str, list[float]] = {name: [] for name in flags}
    for number in np.unique(stretch):
        here, elsewhere = asked & (stretch == number), stretch != number
        usual = predicted_errors(model, x, y, elsewhere, here)
        for name, flagged in flags.items():
            errors = predicted_errors(model, x, y, elsewhere & ~flagged, here)
            if len(errors) and len(usual):
                changes[name].append(_rmse(errors) - _rmse(usual))
    return {name: mean_interval(pd.Series(found)) for name, found in changes.items()}


def _rmse(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2)))
