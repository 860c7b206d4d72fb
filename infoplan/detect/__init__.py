"""Outlier detectors.

A detector is a function ``(samples, model, rng, **options)`` that returns ``(flagged, score)``, a
boolean and a score (NaN where it has none) for each sample. `Evidence` says what it knows of the
samples; the model is that of before the new batch, the generator the epoch's own.
"""

from collections.abc import Callable

from infoplan.detect.any_pyod import pyod
from infoplan.detect.copod import copod
from infoplan.detect.evidence import Evidence, Judgement
from infoplan.detect.gp_residual import gp_residual
from infoplan.detect.hampel import hampel
from infoplan.detect.local import local
from infoplan.detect.qartod import qartod
from infoplan.detect.trivial import best, none

DETECTORS: dict[str, Callable[..., Judgement]] = {
    "none": none,
    "best": best,
    "copod": copod,
    "pyod": pyod,
    "gp_residual": gp_residual,
    "local": local,
    "hampel": hampel,
    "qartod": qartod,
}

__all__ = [
    "DETECTORS",
    "Evidence",
    "Judgement",
    "best",
    "copod",
    "gp_residual",
    "hampel",
    "local",
    "none",
    "pyod",
    "qartod",
]
