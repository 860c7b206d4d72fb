"""Time the process of nearest neighbours: its growth, and beside others on the same data."""

from collections.abc import Callable
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import minimize

from benchmarks.measure import best, resident_mib, restart_peak_mib
from infoplan.model import GaussianProcess, VecchiaProcess

NODES = 2500
NOISE = 0.3


def terrain(x: np.ndarray) -> np.ndarray:
    """Elevation that is rough along a few diagonals and smooth elsewhere."""
    hills = np.sin(9.0 * x[:, 0]) * np.cos(7.0 * x[:, 1]) + 0.4 * np.sin(25.0 * (x[:, 0] + x[:, 1]))
    return np.asarray(hills + 2.0 * np.exp(-8.0 * np.sum((x - 0.3) ** 2, axis=1)))


def track(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make up n samples along parallel tracks, as of a survey, and a query grid; in [0, 1]^2."""
    lines = max(int(np.sqrt(n / 10.0)), 1)
    along = np.arange(n) * lines / n
    line, part = np.floor(along), along % 1.0
    rng = np.random.default_rng(1)
    x = np.stack([np.where(line % 2, 1.0 - part, part), (line + 0.5) / lines], axis=1)
    x = np.clip(x + rng.normal(scale=0.2 / lines, size=(n, 2)), 0.0, 1.0)
    axis = np.linspace(0.0, 1.0, 50)
    query = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return x, terrain(x) + NOISE * rng.normal(size=n), query


def one_size(n: int, kind: str) -> dict[str, float]:
    """Time an iteration and a prediction of n samples, and measure the memory of both.

    Memory is the resident one of this process above what it was with a small model, so that what
    compiled code allocates counts, too; to be called once in a process.
    """
    process: Any = {"vecchia": VecchiaProcess, "gp": GaussianProcess}[kind]
    x, y, query = track(n)
    small = process(x[:100], y[:100], lengthscale=0.1)  # loads the compiled passes
    small.optimize(1)
    small.predict(query)
    before = restart_peak_mib()
    model = process(x, y, lengthscale=0.1)
    model.optimize(1)
    iteration = best(lambda: model.optimize(1), 3)
    prediction = best(lambda: model.predict(query), 3)
    return {
        "n": n,
        "iteration_seconds": iteration.cpu,
        "prediction_seconds": prediction.cpu,
        "peak_mib": resident_mib()[1] - before,
    }


def slope(rows: list[dict[str, float]], quantity: str) -> float:
    """Power of n by which a quantity grows over all sizes, by least squares of the logarithms."""
    sizes, found = (np.log([row[name] for row in rows]) for name in ("n", quantity))
    return float(np.polyfit(sizes, found, 1)[0])


def at_once(n: int, iterations: int) -> dict[str, float]:
    """Learn a log of n samples and predict a grid, compiled code loaded before."""
    x, y, query = track(n)
    VecchiaProcess(x[:100], y[:100]).optimize(1)
    start = perf_counter()
    model = VecchiaProcess(x, y, lengthscale=0.1)
    model.optimize(iterations)
    mean, _ = model.predict(query)
    seconds = perf_counter() - start
    return {"n": n, "seconds": seconds, "rmse": _rmse(mean, query)}


def rivals(n: int, iterations: int) -> dict[str, dict[str, float]]:
    """Fit and predict the same samples with several processes.

    Returns
    -------
    dict of dicts
        By name: ``seconds`` of fit and prediction; ``rmse`` against the noise-free surface and
        ``nlpd`` of it, in its units, on the grid.
    """
    x, y, query = track(n)

    def ours(kind: Any) -> tuple[np.ndarray, np.ndarray]:
        model = kind(x, y, lengthscale=0.1, optimizer="lbfgs")
        model.optimize(iterations)
        found: tuple[np.ndarray, np.ndarray] = model.predict(query)
        return found

    candidates: dict[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
        "gp": lambda: ours(GaussianProcess),
        "vecchia": lambda: ours(VecchiaProcess),
        "scikit-learn, exact": lambda: _scikit_learn(x, y, query, iterations),
    }
    if find_spec("gpboost"):
        candidates["gpboost, vecchia, 30 neighbours"] = lambda: _gpboost(x, y, query)
    for kind in (GaussianProcess, VecchiaProcess):  # loads the compiled passes
        small = kind(x[:100], y[:100])
        small.optimize(1)
        small.predict(query[:1])
    found = {}
    for name, call in candidates.items():
        start = perf_counter()
        mean, std = call()
        seconds = perf_counter() - start
        truth = terrain(query)
        density = 0.5 * ((truth - mean) / std) ** 2 + np.log(std) + 0.5 * np.log(2.0 * np.pi)
        found[name] = {
            "seconds": seconds, "rmse": _rmse(mean, query), "nlpd": float(np.mean(density))
        }  # fmt: skip
    return found


def _scikit_learn(
    x: np.ndarray, y: np.ndarray, query: np.ndarray, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    def optimizer(value: Any, start: np.ndarray, bounds: np.ndarray) -> tuple[np.ndarray, float]:
        found = minimize(value, start, jac=True, bounds=bounds, options={"maxiter": iterations})
        return found.x, found.fun

    model = GaussianProcessRegressor(
        ConstantKernel() * RBF([0.1, 0.1]) + WhiteKernel(), optimizer=optimizer, normalize_y=True
    ).fit(x, y)
    mean, std = model.predict(query, return_std=True)
    noise = y.var() * model.kernel_.k2.noise_level  # its deviation is that of a noisy sample
    return mean, np.sqrt(np.maximum(std**2 - noise, 1e-12))


def _gpboost(x: np.ndarray, y: np.ndarray, query: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    import gpboost

    model = gpboost.GPModel(
        gp_coords=x, cov_function="gaussian_ard", likelihood="gaussian", gp_approx="vecchia",
        num_neighbors=30, num_parallel_threads=1,
    )  # fmt: skip
    centred = y - y.mean()
    model.fit(y=centred)
    predicted = model.predict(gp_coords_pred=query, predict_var=True, predict_response=False)
    return y.mean() + predicted["mu"], np.sqrt(predicted["var"])


def _rmse(mean: np.ndarray, query: np.ndarray) -> float:
    return float(np.sqrt(np.mean((mean - terrain(query)) ** 2)))
