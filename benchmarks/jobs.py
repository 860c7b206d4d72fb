"""What runs in a process of its own, so that memory, threads and start-up are each job's alone.

``run_job`` starts ``python -m benchmarks.jobs NAME ARGUMENTS`` and reads the JSON that it prints.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "MKL", "OMP", "NUMBA", "BLIS")
}
COMMAND = [sys.executable, "-m", "infoplan.cli"]
MARK = "benchmark result: "


def run_job(name: str, environment: dict[str, str] | None = None, **arguments: Any) -> Any:
    """Run a job in a process of its own, on one thread, and return its result."""
    arguments["started"] = perf_counter()  # the clock is the system's, not the process's
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.jobs", name, json.dumps(arguments)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env={**os.environ, **ONE_THREAD, **(environment or {})},
    )
    (line,) = (line for line in done.stdout.splitlines() if line.startswith(MARK))
    return json.loads(line.removeprefix(MARK))


def mission(
    started: float,
    planner: str = "puct",
    detector: str = "copod",
    seed: int = 0,
    budget: int = 2000,
    grid: tuple[int, int] = (50, 50),
    reference: bool = False,
    model: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Fly a mission: time, stages, floor at the rate of this process, memory above imports."""
    from contextlib import nullcontext

    from benchmarks.measure import Seconds, product_rate, resident_mib
    from benchmarks.missions import configuration, floor_operations, fly, stages

    if reference:
        from benchmarks.reference import reference_parts

        parts: Any = reference_parts()
    else:
        parts = nullcontext()
    chosen = model or {}
    config = configuration(planner, detector, budget=budget, grid=grid, **chosen)
    with parts:
        # Loads the compiled kernels and the detector.
        fly(configuration(planner, detector, budget=110, **(chosen | {"pilot_iterations": 1})))
        before, _ = resident_mib()
        flight = fly(config, seed)
    _, peak = resident_mib()
    rate = product_rate()
    operations = floor_operations(config, [row.accepted for row in flight.rows])
    floor = Seconds(operations / rate.wall, operations / rate.cpu)
    return {
        "seconds": flight.seconds,
        "operations": operations,
        "over_floor": flight.seconds.over(floor),
        "stages": stages(flight),
        "epochs": len(flight.rows) - 1,
        "accepted": flight.rows[-1].accepted,
        "rmse": flight.rows[-1].rmse,
        "memory_mib": peak - before,
    }


def whole_mission(started: float, terrain: str, budget: int = 2000) -> dict[str, Any]:
    """Run the command for one mission: time from the start of the process, over the floor."""
    import pyarrow.parquet

    from infoplan.cli import main

    with tempfile.TemporaryDirectory() as folder:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            options = [f"terrain={terrain}", f"budget={budget}", f"results_dir={folder}"]
            status = main(["run", "seeds=1", "n_jobs=1", *options])
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        wall = perf_counter() - started
        cpu = process_time() + children.ru_utime + children.ru_stime
        assert status == 0
        table = pyarrow.parquet.read_table(Path(folder) / "curves", columns=["accepted"])

    from benchmarks.measure import Seconds, product_rate
    from benchmarks.missions import configuration, floor_operations

    rate = product_rate()
    accepted = table["accepted"].to_pylist()
    operations = floor_operations(configuration(budget=budget), accepted)
    spent, floor = Seconds(wall, cpu), Seconds(operations / rate.wall, operations / rate.cpu)
    return {"seconds": spent, "rate": rate, "floor": floor, "over_floor": spent.over(floor)}


def replays(started: float, budget: int = 2000) -> dict[str, Any]:
    """Teach models the data of one mission with several optimisers and precisions."""
    from benchmarks.missions import accepted_batches, configuration, fly, replay

    batches = accepted_batches(fly(configuration(budget=budget)).samples)
    variants: dict[str, dict[str, Any]] = {
        f"{optimizer} {iterations}{' float32' if dtype == 'float32' else ''}": {
            "optimizer": optimizer,
            "iterations": iterations,
            "dtype": dtype,
        }
        for optimizer, iterations, dtype in (
            ("adam", 50, "float64"),
            ("lbfgs", 10, "float64"),
            ("adam", 5, "float64"),
            ("lbfgs", 5, "float64"),
            ("lbfgs", 3, "float64"),
            ("lbfgs", 5, "float32"),
            ("adam", 5, "float32"),
        )
    }
    return {
        name: replay(batches, pilot_iterations=500, **options) for name, options in variants.items()
    }


def worker_memory(started: float, budget: int = 2000) -> dict[str, float]:
    """Peak memory of a worker that flies a mission, above what its imports take."""
    from benchmarks.measure import resident_mib
    from benchmarks.missions import terrain
    from infoplan.config import Config
    from infoplan.study.flight import Task, fly, get_ready
    from infoplan.study.identity import identify

    run = identify(Config(budget=budget), terrain())
    get_ready([run.config], False, None)
    imports, _ = resident_mib()
    outcome = fly(Task(run, 0, 0), None)
    assert outcome.tables is not None, outcome.failure
    _, peak = resident_mib()
    return {"imports_mib": imports, "above_imports_mib": peak - imports}


def model(started: float, sizes: list[int]) -> dict[str, Any]:
    """Time the Gaussian process alone; the last size but one is compared with scikit-learn."""
    from benchmarks import gp

    n = sizes[-2]
    results: dict[str, Any] = {"n": n, "sklearn": gp.scikit_learn(n)}
    for dtype in ("float64", "float32"):
        growth = gp.growth(sizes, dtype)
        results[dtype] = {
            **gp.model(n, dtype),
            "parts": gp.parts(n, dtype),
            "growth": growth,
            "time_exponent": gp.exponent(growth, "iteration_seconds"),
            "memory_exponent": gp.exponent(growth, "peak_mib"),
        }
    return results


def one_size(started: float, n: int, kind: str) -> dict[str, float]:
    """Time and memory of a model of n samples, ``gp`` or ``vecchia``."""
    from benchmarks import neighbours

    return neighbours.one_size(n, kind)


def neighbours(started: float, largest: int, rival: int) -> dict[str, Any]:
    """Time the process of nearest neighbours on a long log, and beside others."""
    from benchmarks import neighbours

    return {
        "at_once": neighbours.at_once(largest, iterations=200),
        "rivals": neighbours.rivals(rival, iterations=60),
    }


def tree_search(started: float, seeds: int = 5) -> dict[str, Any]:
    """Time the tree search."""
    from benchmarks.search import compare

    return compare(seeds)


def rates(started: float) -> dict[str, Any]:
    """Rate of the matrix product, operations a second, and the kernels that do it."""
    from benchmarks.measure import product_rate
    from infoplan.study.provenance import blas_libraries

    return {
        "float64": product_rate("float64").cpu,
        "float32": product_rate("float32").cpu,
        "kernels": sorted({blas["architecture"] for blas in blas_libraries()}),
    }


def command(*arguments: str, environment: dict[str, str] | None = None) -> dict[str, Any]:
    """Run an infoplan command and time it, its workers included."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = perf_counter()
    done = subprocess.run(
        [*COMMAND, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=True,
        env={**os.environ, **(environment or {})},
    )
    wall = perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - usage.ru_utime - usage.ru_stime
    return {"wall": wall, "cpu": cpu, "said": done.stdout}


JOBS = {
    job.__name__: job
    for job in (
        mission,
        whole_mission,
        replays,
        worker_memory,
        model,
        one_size,
        neighbours,
        tree_search,
        rates,
    )
}


def main() -> None:
    """Run the job that the command line names and print its result."""
    name, arguments = sys.argv[1:]
    result = JOBS[name](**json.loads(arguments))
    print(MARK + json.dumps(result, default=lambda value: asdict(value)))


if __name__ == "__main__":
    main()
