"""All speed figures of infoplan in one run: a table, and JSON beside it.

Every figure is measured in a process of its own, on one thread, on the machine at hand. Ratios by
processor time stand beside those by the wall clock: on a busy machine only they mean something.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.jobs import command, run_job
from benchmarks.measure import machine
from benchmarks.missions import terrain
from benchmarks.neighbours import slope
from infoplan.analyse.statistics import mean_interval

METHODS = {
    "UCT-NONE": {"planner": "uct", "detector": "none"},
    "UCT-BEST": {"planner": "uct", "detector": "best"},
    "UCT-COPOD": {"planner": "uct", "detector": "copod"},
    "PUCT-COPOD": {"planner": "puct", "detector": "copod"},
}
FIGURE_5 = {"UCT-NONE": 3, "UCT-BEST": 3, "UCT-COPOD": 4, "PUCT-COPOD": 4}
"""Configurations of each method; historical scope adds one for either method with COPOD."""

FASTEST = {"optimizer": "lbfgs", "dtype": "float32"}
VARIANTS: dict[str, dict[str, Any]] = {
    "adam": {},
    "lbfgs": {"optimizer": "lbfgs"},
    "adam, float32": {"dtype": "float32"},
    "lbfgs, float32": FASTEST,
}


@dataclass
class Scale:
    """How much is run: the full figures, or a quick look that the benchmark works."""

    budget: int = 2000
    repeats: int = 3
    seeds: int = 10
    sizes: tuple[int, ...] = (500, 1000, 1900, 3800)
    far_budget: int = 5000
    far_grid: int = 200
    near_sizes: tuple[int, ...] = (1000, 2000, 5000, 10_000, 20_000, 50_000)
    exact_sizes: tuple[int, ...] = (1000, 2000, 5000)
    near_budget: int = 20_000
    rival: int = 3000


QUICK = Scale(
    budget=250, repeats=1, seeds=1, sizes=(100, 200, 300), far_budget=300, far_grid=60,
    near_sizes=(200, 400), exact_sizes=(200, 400), near_budget=300, rival=200,
)  # fmt: skip


@dataclass
class Line:
    """A figure: what it is, the number with its unit, and the target if it has one."""

    section: str
    what: str
    measured: str
    target: str = ""
    met: bool | None = None


Section = tuple[list[Line], Any]


def mission_against_reference(scale: Scale) -> Section:
    """Fly whole missions with infoplan's parts, and with PyPolo's model and the plain search."""
    # Interleaved, so that a change of the machine's speed meets all of them.
    kinds: dict[str, dict[str, Any]] = {
        "infoplan": {},
        "reference": {"reference": True},
        "fastest": {"model": FASTEST},
    }
    runs: dict[str, list[Any]] = {kind: [] for kind in kinds}
    for repeat in range(scale.repeats):
        for kind, options in kinds.items():
            if kind != "reference" or repeat < 2:
                runs[kind].append(run_job("mission", budget=scale.budget, **options))
    shortest = {kind: _shortest(found) for kind, found in runs.items()}
    reference, section = shortest["reference"], "1 mission"
    lines = [
        Line(
            section,
            "reference: PyPolo's GP, plain-Python search",
            f"{reference['wall']:.1f} s ({reference['cpu']:.1f} s of processor time)",
        )
    ]
    for kind, what, target in (
        ("infoplan", "speed-up in float64, equal iterations", 6),
        ("fastest", "speed-up with lbfgs, float32, equal iterations", 10),
    ):
        wall, cpu = (reference[clock] / shortest[kind][clock] for clock in ("wall", "cpu"))
        # The two missions differ in their plans, thus in the number of epochs.
        work = runs[kind][0]["operations"] / runs["reference"][0]["operations"]
        lines.append(
            Line(
                section,
                what,
                f"{wall:.1f} x (processor time {cpu:.1f} x, at equal arithmetic {cpu * work:.1f} x)"
                f": {shortest[kind]['wall']:.2f} s",
                f"at least {target} x",
                min(wall, cpu) >= target,
            )
        )
    lines += _stage_lines(runs["infoplan"][0])
    return lines, runs


def _stage_lines(run: dict[str, Any]) -> list[Line]:
    stages, total = run["stages"], run["seconds"]["wall"]
    return [
        Line("10 stages", stage, f"{seconds:.3f} s, {100 * seconds / total:.1f} %")
        for stage, seconds in stages.items()
    ] + [
        Line(
            "10 stages",
            f"whole mission, {run['epochs']} epochs, {run['accepted']} samples in the model",
            f"{total:.2f} s",
        )
    ]


def mission_over_floor(scale: Scale) -> Section:
    """Time the console command for one mission from the start of its process."""
    runs = [
        run_job("whole_mission", terrain=terrain().name, budget=scale.budget)
        for _ in range(scale.repeats)
    ]
    ratio = {clock: min(run["over_floor"][clock] for run in runs) for clock in ("wall", "cpu")}
    spent = min(run["seconds"]["wall"] for run in runs)
    gflops = max(run["rate"]["wall"] for run in runs) / 1e9
    line = Line(
        "2 floor",
        f"infoplan run seeds=1 n_jobs=1 over its arithmetic at {gflops:.0f} GF/s, start included",
        f"{ratio['wall']:.2f} (processor time {ratio['cpu']:.2f}): {spent:.1f} s",
        "at most 1.8",
        ratio["wall"] <= 1.8,
    )
    return [line], runs


def optimisers_on_equal_data(scale: Scale) -> Section:
    """Compare the likelihood that optimisers reach on the data of one mission."""
    replays = run_job("replays", budget=scale.budget)
    lines = []
    for adam, other, target in (
        ("adam 50", "lbfgs 10", "at least, with 1/5 of the evaluations"),
        ("adam 5", "lbfgs 5", ""),
        ("adam 5", "lbfgs 3", ""),
        ("adam 5", "lbfgs 5 float32", "at least"),
        ("adam 5", "adam 5 float32", ""),
    ):
        gain = np.subtract(replays[other]["likelihood"], replays[adam]["likelihood"])
        spent = {name: sum(replays[name]["evaluations"][1:]) for name in (adam, other)}
        pilot = replays[other]["evaluations"][0]
        reached = float(np.mean(gain > -0.01))
        fewer = spent[other] / spent[adam]
        lines.append(
            Line(
                "3 optimiser",
                f"likelihood of {other} against {adam} an epoch, same data",
                f"not below in {100 * reached:.0f} % of epochs, least gain {gain.min():+.2f}, mean "
                f"{gain.mean():+.1f} nats; evaluations {fewer:.2f} of Adam's, {pilot} on the pilot",
                target,
                (reached == 1.0 and ("1/5" not in target or fewer <= 0.2)) if target else None,
            )
        )
    return lines, replays


def effect_on_rmse(scale: Scale) -> Section:
    """Compare the final RMSE of optimisers and precisions, and estimate the time of Fig. 5."""
    cores = len(os.sched_getaffinity(0))
    compared = ("UCT-BEST", "PUCT-COPOD")
    wanted = [
        (method, variant, seed)
        for method in compared
        for variant in VARIANTS
        for seed in range(scale.seeds)
    ]
    wanted += [(method, "adam", 0) for method in METHODS if method not in compared]

    def flight(job: tuple[str, str, int]) -> Any:
        method, variant, seed = job
        return run_job(
            "mission", **METHODS[method], seed=seed, budget=scale.budget, model=VARIANTS[variant]
        )

    with ThreadPoolExecutor(cores) as pool:
        flights = dict(zip(wanted, pool.map(flight, wanted), strict=True))
    lines = []
    for method in compared:
        for variant in VARIANTS:
            rmse, base = (
                np.array([flights[method, kind, seed]["rmse"] for seed in range(scale.seeds)])
                for kind in (variant, "adam")
            )
            difference = mean_interval(rmse - base)
            against = (
                ""
                if variant == "adam"
                else f", against adam {difference.mean:+.0f} "
                f"[{difference.low:+.0f}, {difference.high:+.0f}]"
            )
            lines.append(
                Line(
                    "4 RMSE",
                    f"{method}, {variant}: mean over {scale.seeds} seeds [95 % interval]",
                    f"{rmse.mean():.0f}{against}",
                )
            )
    minutes = {
        clock: sum(
            10 * configurations * _mean_seconds(flights, method, clock)
            for method, configurations in FIGURE_5.items()
        )
        / cores
        / 60
        for clock in ("wall", "cpu")
    }
    lines.append(
        Line(
            "8 Fig. 5",
            f"estimate: 140 missions on {cores} cores, each as long as those flown here, {cores} "
            "at a time",
            f"{minutes['wall']:.1f} min (by processor time {minutes['cpu']:.1f} min)",
            "below 20 min",
            minutes["wall"] < 20,
        )
    )
    return lines, {" | ".join(map(str, key)): run for key, run in flights.items()}


def _mean_seconds(flights: dict[tuple[str, str, int], Any], method: str, clock: str) -> float:
    chosen = [run for key, run in flights.items() if key[:2] == (method, "adam")]
    return float(np.mean([run["seconds"][clock] for run in chosen]))


def tree_search(scale: Scale) -> Section:
    """Time one search at the paper's settings."""
    found = run_job("tree_search", seeds=scale.seeds)
    lines = [
        Line(
            "5 search",
            f"{planner.upper()}, 500 iterations x 5 rollouts",
            f"{run['ms']:.2f} ms, {run['ratio']:.0f} x as fast as plain Python",
            "at most 3 ms" if planner == "puct" else "",
            run["ms"] <= 3 if planner == "puct" else None,
        )
        for planner, run in found.items()
    ]
    return lines, found


def memory_and_growth(scale: Scale) -> Section:
    """Measure the peak of a worker, and how time and memory of the model grow."""
    worker = run_job("worker_memory", budget=scale.budget)
    model = run_job("model", sizes=list(scale.sizes))
    lines = [
        Line(
            "6 memory",
            f"peak of a worker at {scale.budget} samples, above its imports "
            f"({worker['imports_mib']:.0f} MiB)",
            f"{worker['above_imports_mib']:.0f} MiB",
            "at most 200 MiB",
            worker["above_imports_mib"] <= 200,
        )
    ]
    for dtype in ("float64", "float32"):
        found, largest = model[dtype], model[dtype]["growth"][-1]
        lines += [
            Line(
                "6 growth",
                f"{dtype}: an iteration's time, from N = {scale.sizes[-2]} to {scale.sizes[-1]}",
                f"N^{found['time_exponent']:.2f}, {largest['iteration_seconds']:.2f} s at the end",
                "at most N^3",
                found["time_exponent"] <= 3.05,
            ),
            Line(
                "6 growth",
                f"{dtype}: the model's memory, from N = {scale.sizes[-2]} to {scale.sizes[-1]}",
                f"N^{found['memory_exponent']:.2f}, {largest['bytes_per_n2']:.1f} N^2 bytes",
                "at most N^2",
                found["memory_exponent"] <= 2.05,
            ),
        ]
        for part in ("iteration", "prediction"):
            times = found["parts"] if part == "iteration" else {}
            share = ", ".join(
                f"{name} {step['ms']:.0f} ms"
                + (f" at {100 * step['of_product']:.0f} % of the product" if len(step) > 1 else "")
                for name, step in times.items()
            )
            faster = model["sklearn"][part]["cpu"] / found[part]["seconds"]["cpu"]
            lines.append(
                Line(
                    "model",
                    f"{dtype}: {part} at N = {model['n']}, over the floor in float64",
                    f"{found[part]['over_floor']['cpu']:.2f}, {faster:.1f} x as fast as "
                    f"scikit-learn{': ' if share else ''}{share}",
                )
            )
    return lines, {"worker": worker, "model": model}


def start_up(scale: Scale) -> Section:
    """Time the help text, and a small run with warm and with empty caches."""
    smoke = ["run", "experiment=smoke", "terrain=volcano"]
    with tempfile.TemporaryDirectory() as folder:

        def run(*options: str, cache: str, first: bool = False) -> dict[str, Any]:
            return command(
                *smoke,
                *options,
                "resume=false",
                f"results_dir={folder}/results",
                environment={"NUMBA_CACHE_DIR": f"{folder}/{cache}"},
            )

        help_text = _shortest_command(lambda: command("--help"), 5)
        fresh = run("seeds=1", cache="alone")
        warm = _shortest_command(lambda: run("seeds=1", cache="alone"), scale.repeats)
        fresh_two = run("seeds=2", "n_jobs=2", cache="two")
        warm_two = run("seeds=2", "n_jobs=2", cache="two")
    compilation = fresh["wall"] - warm["wall"]
    extra = (fresh_two["cpu"] - warm_two["cpu"]) / (fresh["cpu"] - warm["cpu"])
    said = "compiling" in fresh["said"]
    lines = [
        Line(
            "7 start",
            "infoplan --help",
            f"{help_text['wall']:.2f} s",
            "below 0.4 s",
            help_text["wall"] < 0.4,
        ),
        Line(
            "7 start",
            "a smoke run with one seed, compiled",
            f"{warm['wall']:.1f} s ({warm['cpu']:.1f} s of processor time)",
            "below 4 s",
            warm["wall"] < 4,
        ),
        Line(
            "7 start",
            f"first compilation, {'announced by a line' if said else 'unannounced'}",
            f"{compilation:.1f} s",
            "below 20 s, announced",
            compilation < 20 and said,
        ),
        Line(
            "7 start",
            "compilation with two workers over that with one",
            f"{extra:.1f} x the processor time",
            "once for all",
            extra < 1.6,
        ),
    ]
    raw = {
        "help": help_text,
        "fresh": fresh,
        "warm": warm,
        "fresh 2": fresh_two,
        "warm 2": warm_two,
    }
    return lines, raw


def past_the_paper(scale: Scale) -> Section:
    """Fly missions with a larger budget and with a finer grid."""
    grid = [scale.far_grid, scale.far_grid]
    jobs: dict[str, dict[str, Any]] = {
        f"budget={scale.far_budget}": {"budget": scale.far_budget},
        f"grid={grid}": {"budget": scale.budget, "grid": grid},
        f"budget={scale.far_budget}, lbfgs, float32": {
            "budget": scale.far_budget,
            "model": FASTEST,
        },
    }
    runs = {name: run_job("mission", **options) for name, options in jobs.items()}
    lines = [
        Line(
            "9 growth",
            name,
            f"{run['seconds']['wall']:.0f} s, {run['memory_mib']:.0f} MiB, "
            f"{run['over_floor']['cpu']:.2f} of its floor",
        )
        for name, run in runs.items()
    ]
    return lines, runs


def nearest_neighbours(scale: Scale) -> Section:
    """Fly missions with the process of nearest neighbours, and time it alone and beside others."""
    kinds = {"gp": {}, "vecchia": {"name": "vecchia"}}
    runs: dict[str, list[Any]] = {kind: [] for kind in kinds}
    for _ in range(scale.repeats):
        for kind, model in kinds.items():
            runs[kind].append(run_job("mission", budget=scale.budget, model=model))
    shortest = {kind: _shortest(found) for kind, found in runs.items()}
    shares = {
        clock: shortest["vecchia"][clock] / shortest["gp"][clock] for clock in ("wall", "cpu")
    }
    far = run_job("mission", budget=scale.near_budget, model=kinds["vecchia"])
    cores = len(os.sched_getaffinity(0))
    flights = {
        method: run_job("mission", **options, budget=scale.budget, model=kinds["vecchia"])
        for method, options in METHODS.items()
    }
    fig5 = (
        sum(10 * FIGURE_5[m] * flight["seconds"]["wall"] for m, flight in flights.items()) / cores
    )
    growth = {
        kind: [run_job("one_size", n=n, kind=kind) for n in sizes]
        for kind, sizes in (("gp", scale.exact_sizes), ("vecchia", scale.near_sizes))
    }
    alone = run_job("neighbours", largest=scale.near_sizes[-1], rival=scale.rival)
    section, once = "12 vecchia", alone["at_once"]
    lines = [
        Line(
            section, f"a mission of {scale.budget} samples over the same with model=gp",
            f"{shares['wall']:.2f} (processor time {shares['cpu']:.2f}): "
            f"{shortest['vecchia']['wall']:.2f} s",
            "at most 0.25", max(shares.values()) <= 0.25,
        ),
        Line(
            section, f"a mission of {scale.near_budget} samples",
            f"{far['seconds']['wall']:.0f} s, {far['memory_mib']:.0f} MiB",
            "at most 120 s", far["seconds"]["wall"] <= 120,
        ),
        Line(
            section, f"estimate of Fig. 5: 140 missions on {cores} cores", f"{fig5 / 60:.1f} min",
            "at most 3 min", fig5 <= 180,
        ),
        Line(
            section, f"a log of {once['n']} samples at once, 200 iterations and a grid",
            f"{once['seconds']:.0f} s", "at most 180 s", once["seconds"] <= 180,
        ),
    ]  # fmt: skip
    for kind, rows in growth.items():
        for name, column, unit in (
            ("an iteration's time", "iteration_seconds", "s"),
            ("a prediction's time", "prediction_seconds", "s"),
            ("memory of both", "peak_mib", "MiB"),
        ):
            power, bounded = slope(rows, column), kind == "vecchia"
            lines.append(
                Line(
                    section, f"{kind}: {name}, from n = {rows[0]['n']} to {rows[-1]['n']}",
                    f"n^{power:.2f}, {rows[-1][column]:.3g} {unit} at the end",
                    "at most n^1.1" if bounded else "", power <= 1.1 if bounded else None,
                )
            )  # fmt: skip
    lines += [
        Line(
            section, f"{name}: learning {scale.rival} samples and predicting 2500 nodes",
            f"{found['seconds']:.2f} s, RMSE {found['rmse']:.4f}, NLPD {found['nlpd']:.3f}",
        )
        for name, found in alone["rivals"].items()
    ]  # fmt: skip
    return lines, {
        "missions": runs,
        "far": far,
        "methods": flights,
        "growth": growth,
        "alone": alone,
    }


def kernels_of_the_product(scale: Scale) -> Section:
    """Compare the matrix product by the kernels that OpenBLAS picks with others."""
    found = {
        name: run_job("rates", {"OPENBLAS_CORETYPE": name} if name else None)
        for name in ("", "Haswell", "SkylakeX")
        if name != "SkylakeX" or "avx512f" in Path("/proc/cpuinfo").read_text()
    }
    lines = [
        Line(
            "BLAS",
            f"matrix product with {'OPENBLAS_CORETYPE=' + name if name else 'its own choice'} "
            f"({', '.join(run['kernels'])})",
            f"{run['float64'] / 1e9:.0f} GF/s, in float32 {run['float32'] / 1e9:.0f}",
        )
        for name, run in found.items()
    ]
    return lines, found


def workers_in_parallel(scale: Scale) -> Section:
    """Compare the missions an hour of two workers with those of one, start-up included."""
    missions = 2 * scale.seeds
    with tempfile.TemporaryDirectory() as folder:
        runs = {
            n_jobs: command(
                "run",
                f"terrain={terrain().name}",
                f"budget={scale.budget}",
                f"seeds={missions}",
                f"n_jobs={n_jobs}",
                f"results_dir={folder}/{n_jobs}",
            )
            for n_jobs in (1, 2)
        }
    ratio = runs[1]["wall"] / runs[2]["wall"]
    hourly = {n_jobs: 3600 * missions / run["wall"] for n_jobs, run in runs.items()}
    line = Line(
        "11 workers",
        f"missions an hour, two workers over one, {missions} missions each",
        f"{ratio:.2f} ({hourly[2]:.0f} over {hourly[1]:.0f})",
        "at least 1.8",
        ratio >= 1.8,
    )
    return [line], runs


SECTIONS: dict[str, Callable[[Scale], Section]] = {
    "mission": mission_against_reference,
    "floor": mission_over_floor,
    "optimiser": optimisers_on_equal_data,
    "rmse": effect_on_rmse,
    "search": tree_search,
    "memory": memory_and_growth,
    "start": start_up,
    "workers": workers_in_parallel,
    "far": past_the_paper,
    "neighbours": nearest_neighbours,
    "blas": kernels_of_the_product,
}


def _shortest(runs: list[dict[str, Any]]) -> dict[str, float]:
    return {clock: min(run["seconds"][clock] for run in runs) for clock in ("wall", "cpu")}


def _shortest_command(run: Callable[[], dict[str, Any]], repeats: int) -> dict[str, Any]:
    runs = [run() for _ in range(repeats)]
    return {clock: min(found[clock] for found in runs) for clock in ("wall", "cpu")}


def render(described: dict[str, Any], lines: list[Line], console: Console) -> None:
    """Print the machine and the table."""
    console.print(
        f"{described['cpu']}, {described['cores']} cores, {described['system']}, Python "
        f"{described['python']}; load average before {described['load_average'][0]:.1f}"
    )
    console.print(", ".join(f"{name} {number}" for name, number in described["libraries"].items()))
    console.print(f"Missions on {described['terrain']}.")
    table = Table(box=None, pad_edge=False)
    for column in ("", "figure", "measured", "target", "met"):
        table.add_column(column, overflow="fold")
    marks = {True: "yes", False: "NO", None: ""}
    for line in lines:
        table.add_row(line.section, line.what, line.measured, line.target, marks[line.met])
    console.print(table)
    if described["load_average"][0] > 0.5:
        console.print("Other work was running: read the ratios by processor time.")


def main(arguments: list[str] | None = None) -> list[Line]:
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.run", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="tiny missions: does it work at all")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    parser.add_argument("--json", type=Path, default=Path("results/benchmarks.json"))
    chosen = parser.parse_args(arguments)
    scale = QUICK if chosen.quick else Scale()
    described = {**machine(), "terrain": terrain().name}
    lines: list[Line] = []
    raw: dict[str, Any] = {}
    progress = Console(stderr=True)
    chosen.json.parent.mkdir(parents=True, exist_ok=True)
    for name in chosen.only:
        progress.print(f"measuring: {name}")
        found, raw[name] = SECTIONS[name](scale)
        lines += found
        document = {
            "machine": described,
            "load_average_after": os.getloadavg(),
            "scale": asdict(scale),
            "figures": [asdict(line) for line in lines],
            "raw": raw,
        }
        # After each section: what is measured is not lost when a later one fails.
        chosen.json.write_text(json.dumps(document, indent=1) + "\n")
    console = Console(highlight=False, width=None if Console().is_terminal else 170)
    render(described, lines, console)
    console.print(f"all numbers: {chosen.json}")
    return lines


if __name__ == "__main__":
    main()
