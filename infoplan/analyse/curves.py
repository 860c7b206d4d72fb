"""Learning curves: their values on a common axis of collected samples, and numbers that sum up."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from infoplan.analyse.configurations import default_options
from infoplan.analyse.statistics import PairedDifference, paired_difference
from infoplan.analyse.tables import REPLAY
from infoplan.collapse import collapse_sentence, moving_sentence
from infoplan.errors import UsageError
from infoplan.study.stored_curves import ended_collapsed, ended_moving

EARLY = (150, 500)
"""The paper's claims call this stretch of collected samples early."""

LATE = 1000
"""And from here to the budget late."""

BEYOND = 1e6
"""Values so many times the usual ones are no errors that a drawing could show."""

AXIS_POINTS = 190
"""About as many steps does a common axis have."""


def value_at(curve: pd.DataFrame, samples: ArrayLike, column: str = "rmse") -> NDArray[np.float64]:
    """Value of a curve after given numbers of collected samples, linear between epochs.

    Parameters
    ----------
    curve
        One mission's rows.
    samples
        Numbers of collected samples; NaN is returned outside of the curve.
    column
        Which column.
    """
    return np.interp(
        np.asarray(samples, dtype=float),
        curve["collected"].to_numpy(dtype=float),
        curve[column].to_numpy(dtype=float),
        left=np.nan,
        right=np.nan,
    )


def mean_between(curve: pd.DataFrame, low: float, high: float, column: str = "rmse") -> float:
    """Mean of a curve over a stretch of collected samples, linear between epochs (exact).

    Parameters
    ----------
    curve
        One mission's rows.
    low, high
        Ends of the stretch; an end beyond the last row is moved there.
    column
        Which column.

    Returns
    -------
    float
        NaN if the curve begins after `low` or ends at or before it.
    """
    collected = curve["collected"].to_numpy(dtype=float)
    high = min(high, collected[-1])
    if low < collected[0] or high <= low:
        return float("nan")
    inside = collected[(collected > low) & (collected < high)]
    axis = np.concatenate([[low], inside, [high]])
    values = value_at(curve, axis, column)
    return float(np.sum(np.diff(axis) * (values[1:] + values[:-1]) / 2) / (high - low))


def missions(curves: pd.DataFrame) -> Iterator[tuple[tuple[str, int], pd.DataFrame]]:
    """Walk over the missions of a table, as ((run, seed), rows)."""
    grouped: Any = curves.groupby(["run", "seed"], sort=True)
    for (run, seed), rows in grouped:
        yield (str(run), int(seed)), rows


def collapsed_ends(curves: pd.DataFrame, results_dir: Path) -> dict[tuple[str, int], bool | None]:
    """Tell of each mission, by run and seed, whether it ends with a collapsed model.

    Parameters
    ----------
    curves
        As `load_curves` returns them.
    results_dir
        Where their tables are.
    """
    return {
        (run, seed): ended_collapsed(results_dir, run, seed, rows.iloc[-1].to_dict())
        for (run, seed), rows in missions(curves)
    }


def collapse(curves: pd.DataFrame, results_dir: Path) -> str:
    """Say how many missions end with a collapsed model, and what helps; empty if none does."""
    return collapse_sentence(list(collapsed_ends(curves, results_dir).values()))


def moving_ends(curves: pd.DataFrame, results_dir: Path) -> dict[tuple[str, int], bool | None]:
    """Tell of each mission, by run and seed, whether its hyperparameters still moved at its end.

    Parameters as of `collapsed_ends`.
    """
    return {
        (run, seed): ended_moving(
            results_dir, run, seed, {str(name): rows[name].to_numpy() for name in rows}
        )
        for (run, seed), rows in missions(curves)
    }


def moving(curves: pd.DataFrame, results_dir: Path, explain: bool) -> str:
    """Say as `moving_sentence` how many missions end while their hyperparameters move."""
    return moving_sentence(list(moving_ends(curves, results_dir).values()), explain)


def common_axis(curves: pd.DataFrame) -> NDArray[np.int64]:
    """Numbers of collected samples that all missions reach: even steps, and the last.

    It runs from the latest of the first rows to the earliest of the last rows.
    """
    ends = [(rows["collected"].iloc[0], rows["collected"].iloc[-1]) for _, rows in missions(curves)]
    first, last = max(low for low, _ in ends), min(high for _, high in ends)
    step = max(1, round((last - first) / AXIS_POINTS))
    return np.append(np.arange(first, last, step), last)


def on_common_axis(
    curves: pd.DataFrame, samples: ArrayLike | None = None, column: str = "rmse"
) -> pd.DataFrame:
    """Put the curves of several missions on one axis of collected samples.

    Parameters
    ----------
    curves
        As `load_curves` returns them.
    samples
        Numbers of collected samples; `common_axis` if None.
    column
        Which column, linear between epochs; NaN outside of a mission's curve.

    Returns
    -------
    DataFrame
        One row a number of samples (index ``collected``), one column a mission (levels ``run`` and
        ``seed``).
    """
    axis = common_axis(curves) if samples is None else np.asarray(samples)
    values = {key: value_at(rows, axis, column) for key, rows in missions(curves)}
    frame = pd.DataFrame(values, index=pd.Index(axis, name="collected"))
    frame.columns = pd.MultiIndex.from_tuples(values, names=["run", "seed"])
    return frame


def drawable(values: ArrayLike, usual: ArrayLike) -> NDArray[np.float64]:
    """Put gaps, NaN, where values are infinite or beyond all measure.

    Parameters
    ----------
    values
        Any numbers.
    usual
        Numbers of the usual size: what exceeds their median `BEYOND` times is no more shown.
    """
    numbers, known = np.asarray(values, dtype=float), np.abs(np.asarray(usual, dtype=float))
    known = known[np.isfinite(known) & (known > 0)]
    limit = BEYOND * float(np.median(known)) if len(known) else np.inf
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(numbers) & (np.abs(numbers) <= limit), numbers, np.nan)


def area_under_curve(curves: pd.DataFrame, column: str = "rmse") -> "pd.Series[float]":
    """Area under each mission's curve, divided by its length: the mean over collected samples.

    Parameters
    ----------
    curves
        As `load_curves` returns them.
    column
        Which column.

    Returns
    -------
    Series
        Indexed by run and seed; from the latest of the first rows to each mission's budget.
    """
    first = max(rows["collected"].iloc[0] for _, rows in missions(curves))
    areas = {key: mean_between(rows, first, np.inf, column) for key, rows in missions(curves)}
    index = pd.MultiIndex.from_tuples(areas, names=["run", "seed"])
    return pd.Series(list(areas.values()), index=index, name="area")


def summarise(
    curves: pd.DataFrame, column: str = "rmse", early: tuple[int, int] = EARLY
) -> pd.DataFrame:
    """Sum up each mission's curve in a few numbers.

    Parameters
    ----------
    curves
        As `load_curves` returns them.
    column
        Which column, in its unit.
    early
        Which collected samples are early: from, to.

    Returns
    -------
    DataFrame
        Indexed by run and seed: method, scope, rho; ``final`` (at the budget), ``minimum``,
        ``early`` (mean over these collected samples), ``late`` (mean from 1000 on) and
        ``area`` (mean over the whole curve), NaN where a mission is too short; confusion counts of
        the mission (scope batch adds the epochs up, historical judges everything at the end) with
        precision, recall and false_alarm_rate; ``seconds`` computed; and the options in which the
        runs differ, as `load_curves` gives them.
    """
    areas = area_under_curve(curves, column)
    swept = _options(curves)
    rows = []
    for key, curve in missions(curves):
        last = curve.iloc[-1]
        counts = curve[["tp", "fp", "fn", "tn"]]
        tp, fp, fn, tn = counts.iloc[-1] if last["scope"] == "historical" else counts.sum()
        rows.append(
            {
                "method": last["method"],
                "scope": last["scope"],
                "rho": last["rho"],
                "final": last[column],
                "minimum": curve[column].min(),
                "early": mean_between(curve, *early, column),
                "late": mean_between(curve, LATE, np.inf, column),
                "area": areas[key],
                "tp": tp,
                "fp": fp,
                "fn": fn,
                "tn": tn,
                **ratios(tp, fp, fn, tn),
                "seconds": curve.filter(regex="^[a-z]+_seconds$").to_numpy().sum(),
                **last[swept],
            }
        )
    return pd.DataFrame(rows, index=areas.index)


def _options(curves: pd.DataFrame) -> list[str]:
    """Name the columns that hold options."""
    known = {*default_options(), REPLAY} - {"rho"}
    return [str(name) for name in curves if "." in str(name) or name in known]


def ratios(tp: float, fp: float, fn: float, tn: float) -> dict[str, float]:
    """Precision, recall and false-alarm rate of confusion counts; NaN where nothing is counted."""
    return {
        "precision": float(tp / (tp + fp)) if tp + fp else np.nan,
        "recall": float(tp / (tp + fn)) if tp + fn else np.nan,
        "false_alarm_rate": float(fp / (fp + tn)) if fp + tn else np.nan,
    }


def compare(
    curves_a: pd.DataFrame,
    curves_b: pd.DataFrame,
    *,
    by: str = "final",
    column: str = "rmse",
) -> PairedDifference:
    """Compare two runs by the difference a - b of one number a mission, paired by seed.

    Parameters
    ----------
    curves_a, curves_b
        The missions of one run each, as `load_curves` returns them.
    by
        A numeric column of `summarise`: ``final``, ``area``, ``early``, ``late``, ``recall`` ...
    column
        Which column of the curves is summed up.

    Returns
    -------
    PairedDifference

    Raises
    ------
    UsageError
        If a table holds several runs, or they have no seed in common.
    """
    numbers = []
    for curves in (curves_a, curves_b):
        if curves["run"].nunique() != 1:
            raise UsageError(
                f"compare takes one run on each side, not {curves['run'].nunique()}: choose, for "
                "instance with load_curves(..., method='UCT-COPOD', rho=0.1, scope='batch')"
            )
        numbers.append(summarise(curves, column)[by].droplevel("run"))
    difference = paired_difference(numbers[0], numbers[1])
    if not difference.mean.n:
        raise UsageError(
            f"{curves_a['run'].iloc[0]} and {curves_b['run'].iloc[0]} have no seed in common: "
            "run both with the same seeds"
        )
    return difference
