"""Learning curves of the missions of a study that are done, read back."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.collapse import has_collapsed, is_rate_limited, rate_of, spacing_of, was_moving
from infoplan.config import OwnModelConfig
from infoplan.study.identity import Run
from infoplan.study.store import read_footer, read_table, table_path
from infoplan.study.study import Study

HYPERPARAMETERS = ("amplitude", "lengthscale_1", "lengthscale_2", "noise_std")
"""Columns of the curve that hold hyperparameters, of whatever kernel."""


@dataclass(frozen=True)
class StoredCurve:
    """A stored learning curve: its columns as arrays."""

    columns: dict[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    @property
    def last(self) -> dict[str, Any]:
        """Its last row."""
        return {name: values[-1] for name, values in self.columns.items()}

    @property
    def seconds(self) -> float:
        """Seconds of planning, fitting, predicting and detecting."""
        return float(sum(self[name].sum() for name in self.columns if name.endswith("_seconds")))


def stored_curves(study: Study, run: Run, seeds: list[int]) -> list[StoredCurve]:
    """Read the learning curves of the missions of a run that are done: kept, or computed now."""
    curves = []
    for seed in [seed for seed in seeds if (run.name, seed) in study.done]:
        table = read_table(study.results_dir, "curves", run.name, seed)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        curves.append(StoredCurve(columns))
    return curves


def ended_collapsed(results_dir: Path, run: str, seed: int, last: Mapping[Any, Any]) -> bool | None:
    """Tell whether the model of a stored mission has collapsed at its end.

    Parameters
    ----------
    results_dir, run, seed
        Which mission.
    last
        Last row of its curve. Where that does not tell, because an older version has written it,
        lengthscales, pilot and configuration do.

    Returns
    -------
    bool or None
        None if the model has no lengthscales, or is the user's own.
    """
    if last["collapsed"] is not None and not pd.isna(last["collapsed"]):
        return bool(last["collapsed"])
    config = read_footer(table_path(results_dir, "curves", run, seed)).config
    if isinstance(config.model, OwnModelConfig):
        return None
    samples = read_table(results_dir, "samples", run, seed).to_pandas()
    pilot = samples[(samples["epoch"] == 0) & samples["measured"].notna()]
    lengthscales = [float(last[name]) for name in ("lengthscale_1", "lengthscale_2")]
    places = pilot[["x1", "x2"]].to_numpy()
    return has_collapsed(lengthscales, places, spacing_of(config, places))


def ended_moving(results_dir: Path, run: str, seed: int, columns: Mapping[str, Any]) -> bool | None:
    """Tell whether the hyperparameters of a stored mission were still on the way at its end.

    Parameters
    ----------
    results_dir, run, seed
        Which mission.
    columns
        Of its curve. Where they do not tell, because an older version has written it, the
        hyperparameters and the configuration do.

    Returns
    -------
    bool or None
        As `infoplan.collapse.was_moving`.
    """
    told = columns.get("rate_limited")
    if told is not None and not pd.isna(told).all():
        return was_moving([None if pd.isna(epoch) else bool(epoch) for epoch in told])
    model = read_footer(table_path(results_dir, "curves", run, seed)).config.model
    if (rate := rate_of(model)) is None:
        return None
    names = [name for name in HYPERPARAMETERS if not np.isnan(columns[name]).any()]
    rows = [dict(zip(names, row, strict=True))
            for row in np.column_stack([columns[name] for name in names])]  # fmt: skip
    steps = np.diff(columns["collected"])
    if model.iterations != "per_sample":
        steps[:] = model.iterations
    pairs = zip(pairwise(rows), steps.tolist(), strict=True)
    return was_moving([is_rate_limited(*pair, count, rate) for pair, count in pairs])


def final_rmse(study: Study) -> list[float]:
    """Mean final RMSE over the seeds of each configuration; NaN where no seed is done."""
    finals = {}
    for run, seeds in study.runs:
        curves = stored_curves(study, run, seeds)
        finals[run.name] = float(np.mean([curve["rmse"][-1] for curve in curves] or [np.nan]))
    return [finals[name] for name in study.names]
