"""Stored results as tables, statistics and verdicts.

>>> from infoplan.analyse import compare, load_curves
>>> best = load_curves("results", method="UCT-BEST", rho=0.1)  # doctest: +SKIP
>>> none = load_curves("results", method="UCT-NONE", rho=0.1)  # doctest: +SKIP
>>> compare(best, none, by="final").mean  # doctest: +SKIP
Interval(mean=-512.3, low=-611.5, high=-413.1, n=10)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from infoplan.analyse.calibration import calibration_curve
    from infoplan.analyse.claims import METHODS, judge_claims
    from infoplan.analyse.curves import (
        area_under_curve,
        compare,
        mean_between,
        on_common_axis,
        summarise,
        value_at,
    )
    from infoplan.analyse.detection import detector_quality, rejudge, roc_auc
    from infoplan.analyse.judging import Claim, Comparison, Rules, Stated
    from infoplan.analyse.relief import by_relief
    from infoplan.analyse.statistics import (
        Interval,
        PairedDifference,
        holm,
        interquartile_mean,
        mean_band,
        mean_interval,
        paired_difference,
        probability_below_zero,
        sign_flip_test,
        stratified_mean,
        t_test,
    )
    from infoplan.analyse.tables import (
        Selection,
        find_missions,
        find_study,
        load_curves,
        load_maps,
        load_samples,
    )

_HOMES = {
    "calibration": ("calibration_curve",),
    "claims": ("METHODS", "judge_claims"),
    "curves": (
        "area_under_curve",
        "compare",
        "mean_between",
        "on_common_axis",
        "summarise",
        "value_at",
    ),
    "detection": ("detector_quality", "rejudge", "roc_auc"),
    "judging": ("Claim", "Comparison", "Rules", "Stated"),
    "relief": ("by_relief", "local_relief"),
    "statistics": (
        "Interval",
        "PairedDifference",
        "holm",
        "interquartile_mean",
        "mean_band",
        "mean_interval",
        "paired_difference",
        "probability_below_zero",
        "sign_flip_test",
        "stratified_mean",
        "t_test",
    ),
    "tables": (
        "Selection",
        "find_missions",
        "find_study",
        "load_curves",
        "load_maps",
        "load_samples",
    ),
}

__all__ = [
    "METHODS",
    "Claim",
    "Comparison",
    "Interval",
    "PairedDifference",
    "Rules",
    "Selection",
    "Stated",
    "area_under_curve",
    "by_relief",
    "calibration_curve",
    "compare",
    "detector_quality",
    "find_missions",
    "find_study",
    "holm",
    "interquartile_mean",
    "judge_claims",
    "load_curves",
    "load_maps",
    "load_samples",
    "local_relief",
    "mean_band",
    "mean_between",
    "mean_interval",
    "on_common_axis",
    "paired_difference",
    "probability_below_zero",
    "rejudge",
    "roc_auc",
    "sign_flip_test",
    "stratified_mean",
    "summarise",
    "t_test",
    "value_at",
]


def __getattr__(name: str) -> Any:
    # pandas and SciPy are loaded when a name is first used: the command line stays quick.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
