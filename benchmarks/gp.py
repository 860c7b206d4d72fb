"""Time the Gaussian process: its parts, its growth, against the matrix product and scikit-learn.

The floor of an iteration is N^3 operations (Cholesky factor N^3 / 3, inverse 2 N^3 / 3), that of
a prediction N^2 M (one triangular solve), both at the rate of a large dense matrix product.
"""

import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from benchmarks.measure import Seconds, best, product_rate, timed
from infoplan.model import GaussianProcess
from infoplan.model.covariance import passes_of
from infoplan.model.kernels.squared_exponential import KERNEL

NODES = 2500
REPEATS = 5
RATES = (200.0, 200.0)
"""Lengthscales of a trained model: 0.05 of half the pilot's bounding box."""


def data(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make up n data and a query grid's worth of nodes."""
    rng = np.random.default_rng(1)
    x, query = rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(-1.0, 1.0, (NODES, 2))
    return x, np.sin(5.0 * x[:, 0]) + rng.normal(size=n), query


def traced_mib(call: Callable[[], object]) -> float:
    """Return the most memory that arrays took during a call, MiB."""
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def scikit_learn(n: int) -> dict[str, Seconds]:
    """Time scikit-learn's likelihood with gradient, and its prediction."""
    x, y, query = data(n)
    kernel = ConstantKernel(1.0) * RBF([0.5, 0.5])
    regressor = GaussianProcessRegressor(kernel, alpha=1.0, optimizer=None).fit(x, y)
    theta = regressor.kernel_.theta
    return {
        "iteration": best(lambda: regressor.log_marginal_likelihood(theta, eval_gradient=True), 3),
        "prediction": best(lambda: regressor.predict(query, return_std=True), 3),
    }


def model(n: int, dtype: str) -> dict[str, Any]:
    """Time one iteration and one prediction, over their floors in double precision."""
    x, y, query = data(n)
    rate = product_rate()
    gp = GaussianProcess(x, y, dtype=dtype)
    gp.optimize(1)  # loads the compiled kernels
    results = {}
    iteration = best(lambda: gp.optimize(1), REPEATS)
    gp.predict(query[:1])  # the factorisation belongs to the iteration
    prediction = best(lambda: gp.predict(query), REPEATS)
    for part, seconds, operations in (
        ("iteration", iteration, float(n) ** 3),
        ("prediction", prediction, float(n) ** 2 * NODES),
    ):
        floor = Seconds(operations / rate.wall, operations / rate.cpu)
        results[part] = {"seconds": seconds, "over_floor": seconds.over(floor)}
    return results


def parts(n: int, dtype: str) -> dict[str, dict[str, float]]:
    """Time the four steps of an iteration; for the factorisations as a share of the product."""
    x, y, _ = data(n)
    columns = np.ascontiguousarray(x.T)
    packed = np.empty(n * (n + 1) // 2, dtype=dtype)
    passes = passes_of(KERNEL)
    pftrf, pftri = get_lapack_funcs(("pftrf", "pftri"), dtype=dtype)
    rate = product_rate(dtype).cpu
    shortest = dict.fromkeys(("covariance", "factor", "inverse", "gradient"), Seconds())
    for _ in range(REPEATS):
        steps = {
            "covariance": lambda: passes.fill(columns, RATES, 1.0, 2.0, packed),
            "factor": lambda: pftrf(n, packed, uplo="L", overwrite_a=1),
            "inverse": lambda: pftri(n, packed, uplo="L", overwrite_a=1),
            "gradient": lambda: passes.gradient_sums(columns, RATES, y, packed),
        }
        for name, step in steps.items():
            with timed() as spent:
                step()
            shortest[name] = shortest[name].least(spent)
    operations = {"factor": n**3 / 3.0, "inverse": 2.0 * n**3 / 3.0}
    return {
        name: {"ms": 1e3 * spent.cpu}
        | ({"of_product": operations[name] / spent.cpu / rate} if name in operations else {})
        for name, spent in shortest.items()
    }


def growth(sizes: list[int], dtype: str) -> list[dict[str, float]]:
    """Time and memory of a model at several numbers of data."""
    rows = []
    for n in sizes:
        x, y, query = data(n)
        gp = GaussianProcess(x, y, dtype=dtype)

        def epoch(x: np.ndarray = x, y: np.ndarray = y, query: np.ndarray = query) -> None:
            gp = GaussianProcess(x[:-50], y[:-50], dtype=dtype)
            gp.predict(query)
            gp.append(x[-50:], y[-50:])  # grows the factor: the most memory of an epoch
            gp.predict(query)
            gp.optimize(1)

        iteration = best(lambda gp=gp: gp.optimize(1), 3)
        gp.predict(query[:1])
        prediction = best(lambda gp=gp, query=query: gp.predict(query), 3)
        mib = traced_mib(epoch)
        rows.append(
            {
                "n": n,
                "iteration_seconds": iteration.cpu,
                "prediction_seconds": prediction.cpu,
                "peak_mib": mib,
                "bytes_per_n2": mib * 2**20 / n**2,
            }
        )
    return rows


def exponent(rows: list[dict[str, float]], quantity: str) -> float:
    """Power of N by which a quantity grew between the two largest sizes."""
    small, large = rows[-2:]
    return float(np.log(large[quantity] / small[quantity]) / np.log(large["n"] / small["n"]))
