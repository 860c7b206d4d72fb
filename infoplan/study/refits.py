"""Refits: what a stored mission's model would have been with the best hyperparameters.

On the samples that it used, and on those that a better detector would have left it.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from infoplan.collapse import spacing_of
from infoplan.errors import RunError
from infoplan.methods import find
from infoplan.study.columns import lay_out
from infoplan.study.identity import Run
from infoplan.study.store import read_table

DATA = ("used", "without_spikes", "with_lost", "clean")
"""Which samples a mission's model is refit on, as the table ``refits`` says."""

Booleans = NDArray[np.bool_]


def refit_mission(results_dir: Path, run: Run, seed: int) -> pa.Table:
    """Fit a stored mission's model anew, on each of `DATA`.

    The scalers stay those of the mission's pilot. The optimum is that of what the model maximises,
    within its bounds (`infoplan.model.regression.Regression.refit`), climbed to from the mission's
    last hyperparameters, from those after its pilot, and from long lengthscales.

    Parameters
    ----------
    results_dir, run, seed
        Which mission.

    Returns
    -------
    pyarrow.Table
        As the schema ``refits``: a row for each of `DATA`.

    Raises
    ------
    RunError
        If a table cannot be read, or a prediction is not finite.
    """
    samples, curve, maps = (
        read_table(results_dir, name, run.name, seed).to_pandas()
        for name in ("samples", "curves", "maps")
    )
    x, y = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    told = ~np.isnan(y)
    pilot = told & (samples["epoch"] == 0).to_numpy()
    new_model = partial(find("model", run.config.model), spacing=spacing_of(run.config, x[pilot]))
    model = new_model(x[pilot], y[pilot])
    names = list(vars(model.hyperparameters))
    first, last = (curve.iloc[row][names].astype(float).to_dict() for row in (0, -1))
    outlier = samples["is_outlier"].to_numpy(dtype=bool)
    nodes, truth = maps[["x1", "x2"]].to_numpy(), maps["truth"].to_numpy()
    rows: list[dict[str, Any]] = []
    done: list[Booleans] = []
    for chosen in chosen_samples(told, samples["used"].to_numpy(dtype=bool), outlier).values():
        same = [number for number, other in enumerate(done) if np.array_equal(other, chosen)]
        done.append(chosen)
        if same:
            rows.append(rows[same[0]])
            continue
        model.recall(last)
        model.replace(x[chosen], y[chosen])
        refit = model.refit([first])
        mean, _ = model.predict(nodes)
        rows.append({
            "accepted": int(chosen.sum()),
            "rmse": float(np.sqrt(np.mean((mean - truth) ** 2))),
            "lml": model.log_marginal_likelihood,
            **vars(refit),
            **vars(model.hyperparameters),
        })  # fmt: skip
    if not np.isfinite([row["rmse"] for row in rows]).all():
        raise RunError(f"a refit of {run.name} seed {seed} predicts what is no finite number")
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    missing = {name: [np.nan] * len(DATA) for name in ("lengthscale_1", "lengthscale_2")}
    return lay_out(
        "refits", {"seed": [seed] * len(DATA), "data": list(DATA)} | missing | columns
    )  # fmt: skip


def chosen_samples(told: Booleans, used: Booleans, outlier: Booleans) -> Mapping[str, Booleans]:
    """Tell which samples each of `DATA` is.

    Parameters
    ----------
    told, used, outlier
        Which have a measurement, are in the mission's model at its end, and are outliers, shape
        (n,).
    """
    return {
        "used": told & used,
        "without_spikes": told & used & ~outlier,
        "with_lost": told & (used | ~outlier),
        "clean": told & ~outlier,
    }
