"""The cleaned log: all that was in it, with the verdict on each row."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.files import writing
from infoplan.later_logs import CLEARED, CONFIRMED, UNTESTED
from infoplan.survey.log import SurveyLog
from infoplan.wording import csv_cell

ADDED = ("score", "flagged", "why")
"""Columns that a cleaned log has besides its own."""


LATER = {
    CONFIRMED: "confirmed: a later log has been near",
    CLEARED: "cleared: a later log has been near",
    UNTESTED: "untested: no later log has been near",
}
"""How a verdict of later logs is told."""


def write_clean(
    path: Path,
    log: SurveyLog,
    score: NDArray[np.float64],
    flagged: NDArray[np.bool_],
    detector: Mapping[str, Any],
    verdict: Sequence[str] | None = None,
) -> Path:
    """Write a log with the verdict on each of its rows, in their order, as CSV.

    Parameters
    ----------
    path
        The file; its folder is made.
    log
        As read: all its columns are written as they were, also of rows that are no samples.
    score, flagged
        The detector's, of each sample in order of time, shape (n,).
    detector
        Its options, ``name`` among them.
    verdict
        What later logs say of each sample that was flagged before them (`infoplan.later_logs`),
        empty of the others; None: there are none.

    Returns
    -------
    Path
        Of the file. A column that the log has already is called ``infoplan_...``.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    n = len(log.columns)
    scores, flags, why = np.full(n, np.nan), np.full(n, "", dtype=object), [""] * n
    scores[log.rows] = score
    flags[log.rows] = np.where(flagged, "true", "false")
    for row, reason in log.refused.items():
        why[row] = str(reason)
    for row, one, value in zip(log.rows.tolist(), flagged, log.value, strict=True):
        if one:
            why[row] = "no value" if np.isnan(value) else _phrase(detector, scores[row])
    for row, said in zip(log.rows.tolist(), verdict or (), strict=False):
        if said:
            now = why[row] or "flagged no more"
            why[row] = f"{now}; {LATER[said]}"
    table = log.columns.copy()
    added = (pd.Series(scores).map(lambda s: "" if np.isnan(s) else f"{s:.6g}"), flags,
             [csv_cell(text) for text in why])  # fmt: skip
    for name, column in zip(ADDED, added, strict=True):
        table[f"infoplan_{name}" if name in table else name] = np.asarray(column, dtype=object)
    unfinished = path.with_name(f".{path.name}")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        table.to_csv(unfinished, index=False, lineterminator="\n", encoding="utf-8")
        unfinished.replace(path)
    return path


def _phrase(detector: Mapping[str, Any], score: float) -> str:
    """Say why a sample is flagged."""
    name = str(detector["name"])
    if np.isnan(score):
        return f"{name} flags it"
    threshold = detector.get("threshold")
    above = "" if threshold is None else f", above {threshold:g}"
    return f"{name} scores it {score:.3g}{above}"
