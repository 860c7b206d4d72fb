"""Time one search at the paper's settings: UCT and PUCT, against the plain-Python reference."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.measure import best
from infoplan.plan import search
from infoplan.robot import steering_angles

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "plan"))
import reference_search

POSE = (25.0, 25.0, 1.0)
EXTENT = (0.0, 50.0, 0.0, 50.0)
OPTIONS = {
    "speed": 0.7,
    "samples_per_action": 10,
    "steering": steering_angles(0.15, 5),
    "iterations": 500,
    "rollouts": 5,
    "exploration": 0.3,
}


def milliseconds(run: Callable[[np.random.Generator], object], seeds: int, repeats: int) -> float:
    """Return the median time of a search over several streams, each the best of some repeats."""
    times = [
        best(lambda seed=seed: run(np.random.default_rng(seed)), repeats).wall
        for seed in range(seeds)
    ]
    return 1e3 * float(np.median(times))


def compare(seeds: int) -> dict[str, dict[str, float]]:
    """Return ms a search and the ratio over the reference, for each planner."""
    results = {}
    for planner, objectives in (("uct", 1), ("puct", 2)):
        maps = np.random.default_rng(0).random((objectives, 50, 50))
        options = {**OPTIONS, "pareto": planner == "puct"}
        settings = reference_search.Settings(
            maps.tolist(), EXTENT, **{**options, "steering": OPTIONS["steering"].tolist()}
        )

        def compiled(rng, maps=maps, options=options):
            return search(POSE, maps, EXTENT, rng=rng, **options)

        def plain(rng, settings=settings):
            return reference_search.search(settings, POSE, rng)

        compiled(np.random.default_rng(0))  # loads the compiled kernels
        fast, slow = milliseconds(compiled, 10 * seeds, 5), milliseconds(plain, seeds, 1)
        results[planner] = {"ms": fast, "reference_ms": slow, "ratio": slow / fast}
    return results
