"""Learning curves of the missions of a study that are done, read back."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.study.identity import Run
from infoplan.study.store import read_table
from infoplan.study.study import Study


@dataclass(frozen=True)
class StoredCurve:
    """A stored learning curve: its columns as arrays."""

    columns: dict[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

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


def final_rmse(study: Study) -> list[float]:
    """Mean final RMSE over the seeds of each configuration; NaN where no seed is done."""
    finals = {}
    for run, seeds in study.runs:
        curves = stored_curves(study, run, seeds)
        finals[run.name] = float(np.mean([curve["rmse"][-1] for curve in curves] or [np.nan]))
    return [finals[name] for name in study.names]
