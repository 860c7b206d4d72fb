"""Outlier detectors.

A detector is a function of all samples collected so far, ``(x, y, is_outlier, **options)``, that
returns ``(flagged, score)``: a boolean and a score (NaN where it has none) for each sample.
"""

from infoplan.detect.copod import copod
from infoplan.detect.trivial import best, none

DETECTORS = {"none": none, "best": best, "copod": copod}

__all__ = ["DETECTORS", "best", "copod", "none"]
