"""Samples of one method with the hyperparameters of another."""

import numpy as np
import pandas as pd
import pytest
from flown import short_mission, store
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF

from benchmarks.swapped_hyperparameters import by_swapping
from infoplan.model.scaling import Scaler


def test_own_hyperparameters_give_the_own_error_and_others_that_of_scikit_learn(volcano, tmp_path):
    best, none = (
        store(tmp_path, short_mission("uct", detector, rho=0.2), volcano)
        for detector in ("best", "none")
    )
    end, own, swapped, other, *lengthscales = by_swapping(tmp_path, best, none, 0)
    assert own == pytest.approx(end, rel=1e-6)
    samples, maps, curves = (
        pd.read_parquet(tmp_path / table / f"run={run}" / "seed=0.parquet", partitioning=None)
        for table, run in (("samples", best), ("maps", best), ("curves", none))
    )
    row = curves.iloc[-1]
    assert other == row["rmse"]
    assert lengthscales[1] == pytest.approx(np.sqrt(row["lengthscale_1"] * row["lengthscale_2"]))
    x, y = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    pilot, used = (samples["epoch"] == 0).to_numpy(), samples["used"].to_numpy()
    scaler = Scaler.of_pilot(x[pilot], y[pilot])
    kernel = row["amplitude"] ** 2 * RBF([row["lengthscale_1"], row["lengthscale_2"]])
    noise = row["noise_std"] ** 2 + row["jitter"]
    fitted = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None)
    fitted.fit(scaler.inputs(x[used]).T, scaler.outputs(y[used]))
    scaled = fitted.predict(scaler.inputs(maps[["x1", "x2"]].to_numpy()).T)
    mean = scaler.y_mean + scaler.y_std * scaled
    error = np.sqrt(np.mean((mean - maps["truth"].to_numpy()) ** 2))
    assert swapped == pytest.approx(error, rel=1e-6)
    assert swapped != pytest.approx(own, rel=1e-3)
