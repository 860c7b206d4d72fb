"""Surveys, whose truth nobody knows: cross-validated scores in place of errors."""

from pathlib import Path

import numpy as np
import pandas as pd

from infoplan.analyse.curves import missions
from infoplan.analyse.statistics import Interval, mean_interval
from infoplan.analyse.tables import Selection, load_curves
from infoplan.config import is_survey
from infoplan.errors import UsageError
from infoplan.study.store import read_table

NO_TRUTH = "nobody knows the truth of a survey"


def read_stretches(results_dir: Path, run: str, seed: int) -> pd.DataFrame:
    """Read the table of a survey's stretches (`infoplan.tables`)."""
    return read_table(results_dir, "stretches", run, seed).to_pandas()


def scores_by_epoch(stretches: pd.DataFrame) -> pd.DataFrame:
    """Pool the scores of the stretches of a track.

    Parameters
    ----------
    stretches
        As `read_stretches` returns them.

    Returns
    -------
    DataFrame
        Indexed by epoch; ``rmse``, ``rmse_unfiltered`` and ``loo_rmse`` over all samples in the
        model, terrain's unit; NaN where none could be predicted.
    """
    names = ["rmse", "rmse_unfiltered", "loo_rmse"]
    squares = stretches[names] ** 2
    counts = stretches[names].notna().mul(stretches["samples"], axis=0)
    total = squares.mul(stretches["samples"], axis=0).groupby(stretches["epoch"]).sum()
    means = total / counts.groupby(stretches["epoch"]).sum().replace(0, np.nan)
    return means**0.5


def gain(stretches: pd.DataFrame) -> Interval:
    """Say what it does to the predictions to leave out what was flagged, at the end.

    Returns
    -------
    Interval
        RMSE less that with flagged samples in the model, at the same samples, paired by stretch;
        terrain's unit. Below 0 the detector has helped.
    """
    last = stretches[stretches["epoch"] == stretches["epoch"].max()]
    return mean_interval((last["rmse"] - last["rmse_unfiltered"]).dropna())


def load_scored_curves(selection: Selection) -> pd.DataFrame:
    """Load curves as `load_curves`; of a survey ``rmse`` is the cross-validated one."""
    curves = load_curves(selection)
    if not is_survey(selection.terrain):
        return curves
    frames = []
    for (run, seed), curve in missions(curves):
        scores = scores_by_epoch(read_stretches(selection.results_dir, run, seed))
        frames.append(curve.assign(rmse=curve["epoch"].map(scores["rmse"])))
    return pd.concat(frames)


def demand_truth(selection: Selection, what: str) -> None:
    """Refuse what needs the truth of a survey.

    Raises
    ------
    UsageError
        Says so, and what there is.
    """
    if is_survey(selection.terrain):
        raise UsageError(
            f"{what} need the truth, and {NO_TRUTH}, of {selection.terrain} neither: look at it "
            "with infoplan show, report or animate, or choose flown runs with terrain="
        )
