"""Time one search at the paper's settings: UCT and PUCT, against the plain-Python reference."""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

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


def milliseconds(run, repeats):
    """Return the median time of a call."""
    times = []
    for seed in range(repeats):
        rng = np.random.default_rng(seed)
        start = perf_counter()
        run(rng)
        times.append(1e3 * (perf_counter() - start))
    return float(np.median(times))


def main():
    """Print and return ms a search and the ratio over the reference, for each planner."""
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

        compiled(np.random.default_rng(0))  # compiles, or loads the cache
        fast, slow = milliseconds(compiled, 201), milliseconds(plain, 5)
        results[planner] = {"ms": fast, "reference_ms": slow, "ratio": slow / fast}
        print(
            f"{planner:5s} {fast:7.2f} ms a search, plain Python {slow:7.1f} ms: "
            f"{slow / fast:.0f} times as fast"
        )
    return results


if __name__ == "__main__":
    main()
