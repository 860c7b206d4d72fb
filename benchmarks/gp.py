"""Time the Gaussian process at a mission's end, against the matrix product and scikit-learn.

The floor of an iteration is N^3 operations (Cholesky factor N^3 / 3, inverse 2 N^3 / 3), that of
a prediction N^2 M (one triangular solve), both at the rate of a large dense matrix product.
"""

import tracemalloc
from time import perf_counter

import numpy as np
from scipy.linalg.blas import dgemm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from threadpoolctl import threadpool_limits

from infoplan.model import GaussianProcess

N, M = 1900, 2500
REPEATS = 7


def best(call, repeats=REPEATS):
    """Return the shortest time of a call in seconds: the one least disturbed."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return min(times)


def operations_per_second():
    """Measure the rate of a dense matrix product of the size of the data."""
    a = np.asfortranarray(np.random.default_rng(0).normal(size=(N, N)))
    return 2.0 * N**3 / best(lambda: dgemm(1.0, a, a))


def traced_peak(call):
    """Return the most memory in MiB that arrays took during a call."""
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def scikit_learn(x, y, query):
    """Time scikit-learn's likelihood with gradient, and its prediction."""
    kernel = ConstantKernel(1.0) * RBF([0.5, 0.5])
    regressor = GaussianProcessRegressor(kernel, alpha=1.0, optimizer=None).fit(x, y)
    theta = regressor.kernel_.theta
    iteration = best(lambda: regressor.log_marginal_likelihood(theta, eval_gradient=True), 3)
    return iteration, best(lambda: regressor.predict(query, return_std=True), 3)


def main():
    """Print and return seconds, ratios over the floors and scikit-learn, and peak memory."""
    rng = np.random.default_rng(1)
    x, query = rng.uniform(-1.0, 1.0, (N, 2)), rng.uniform(-1.0, 1.0, (M, 2))
    y = np.sin(5.0 * x[:, 0]) + rng.normal(size=N)
    results = {}
    with threadpool_limits(1):
        GaussianProcess(x[:10], y[:10]).optimize(1)  # compiles, or loads the cache
        rate = operations_per_second()
        others = dict(zip(("iteration", "prediction"), scikit_learn(x, y, query), strict=True))
        for dtype in ("float64", "float32"):
            gp = GaussianProcess(x, y, dtype=dtype)
            iteration = best(lambda gp=gp: gp.optimize(1))
            gp.predict(query[:1])  # the factorisation belongs to the iteration
            prediction = best(lambda gp=gp: gp.predict(query))
            for part, seconds, operations in (
                ("iteration", iteration, N**3),
                ("prediction", prediction, N**2 * M),
            ):
                results[dtype, part] = {
                    "seconds": seconds,
                    "over_floor": seconds * rate / operations,
                    "sklearn_over_this": others[part] / seconds,
                }
                print(
                    f"{dtype} {part:10s} {1e3 * seconds:6.1f} ms, {seconds * rate / operations:.2f}"
                    f" of the double-precision floor, {others[part] / seconds:.1f} times as fast as"
                    " scikit-learn"
                )

        def mission_end():
            gp = GaussianProcess(x, y)
            gp.optimize(1)
            gp.predict(query)
            gp.append(query[:20], y[:20])
            gp.predict(query)

        results["peak_mib"] = traced_peak(mission_end)
        print(f"peak memory of a model with {N} data: {results['peak_mib']:.0f} MiB")
    return results


if __name__ == "__main__":
    main()
