"""The golden missions: short ones over planners, detectors, scopes, models and the pilot's choices.

``python tests/golden/missions.py`` writes their numbers anew. It refuses to replace numbers that
have changed as long as `infoplan.study.identity.NUMERICS_VERSION` has not been raised.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import infoplan
from infoplan.study.identity import NUMERICS_VERSION

FILE = Path(__file__).with_name("missions.json")

SHORT = [
    "terrain=volcano", "budget=140", "grid=[9,11]", "pilot.samples=40", "rho=0.15",
    "model.pilot_iterations=40",
]  # fmt: skip

MISSIONS = {
    "puct-copod": ["planner=puct", "detector=copod"],
    "puct-copod-historical": ["planner=puct", "detector=copod", "detector.scope=historical"],
    "puct-copod-paper-score": ["planner=puct", "detector=copod", "detector.score=paper"],
    "uct-none": ["planner=uct", "detector=none"],
    "uct-best-noisy-std": ["planner=uct", "detector=best", "planner.noisy_std=true"],
    "uct-best-first-action": ["planner=uct", "detector=best", "planner.execute_actions=1"],
    "uct-best-planned-average": ["planner=uct", "detector=best", "planner.average=planned"],
    "puct-copod-visit": ["planner=puct", "detector=copod", "planner.border=visit"],
    "puct-copod-terminal": ["planner=puct", "detector=copod", "planner.border=terminal"],
    "uct-none-rollout-samples": [
        "planner=uct", "detector=none", "planner.rollout_step=sample", "planner.rollouts=20",
    ],
    "puct-copod-judged-pilot": [
        "planner=puct", "detector=copod", "detector.judge_pilot=true", "pilot.outliers=true",
    ],
    "random-best-judged-pilot": [
        "planner=random", "detector=best", "detector.judge_pilot=true", "pilot.outliers=true",
    ],
    "random-gp-residual-judged-pilot-historical": [
        "planner=random", "detector=gp_residual", "detector.judge_pilot=true",
        "detector.scope=historical", "pilot.outliers=true",
    ],
    "weighted-copod": ["planner=weighted", "detector=copod"],
    "greedy-local": ["planner=greedy", "detector=local"],
    "uct-mutual-information": [
        "planner=uct", "detector=none", "planner.reward=mutual_information",
    ],
    "puct-variance-reduction": [
        "planner=puct", "detector=copod", "planner.reward=variance_reduction",
    ],
    "greedy-ucb": ["planner=greedy", "detector=none", "planner.reward=ucb", "planner.kappa=1"],
    "uct-obstacles": [
        "planner=uct", "detector=none", "terrain.obstacles=[[[22,27],[36,27],[36,34],[22,34]]]",
    ],
    "bayes-opt": ["planner=bayes_opt", "detector=none", "planner.distance_penalty=5"],
    "rig-tree-obstacles": [
        "planner=rig_tree", "detector=none", "planner.samples=60",
        "terrain.obstacles=[[[22,27],[36,27],[36,34],[22,34]]]",
    ],
    "cmaes": ["planner=cmaes", "detector=none", "planner.evaluations=60"],
    "lawnmower-gp-residual": ["planner=lawnmower", "detector=gp_residual"],
    "random-gp-residual-historical": [
        "planner=random", "detector=gp_residual", "detector.scope=historical",
    ],
    "random-pyod": ["planner=random", "detector=pyod", "detector.model=IForest"],
    "random-student-t": ["planner=random", "detector=none", "model=student_t"],
    "random-rcgp": ["planner=random", "detector=none", "model=rcgp"],
    "random-itgp": ["planner=random", "detector=none", "model=itgp", "pilot.outliers=true"],
    "random-relevance-pursuit": [
        "planner=random", "detector=none", "model=relevance_pursuit",
    ],
    "random-vecchia": [
        "planner=random", "detector=gp_residual", "model=vecchia", "model.neighbours=8",
        "model.prediction_neighbours=30",
    ],
    "random-matern12": ["planner=random", "detector=none", "model.kernel=matern12"],
    "random-matern32-student-t": [
        "planner=random", "detector=none", "model=student_t", "model.kernel=matern32",
    ],
    "random-matern52-vecchia": [
        "planner=random", "detector=gp_residual", "model=vecchia", "model.kernel=matern52",
        "model.neighbours=8",
    ],
    "random-rational-quadratic": [
        "planner=random", "detector=none", "model.kernel=rational_quadratic",
    ],
    "random-gibbs": ["planner=random", "detector=none", "model.kernel=gibbs"],
    "random-guarded": [
        "planner=random", "detector=none", "model.min_lengthscale=20", "model.restarts=1",
        "model.lengthscale_prior=[0.3,0.5]", "model.noise_prior=[0.1,1.0]",
    ],
    "random-restarted-noise": [
        "planner=random", "detector=none", "model.noise_start=restarted",
    ],
    "random-restarted-noise-student-t": [
        "planner=random", "detector=none", "model=student_t", "model.noise_start=restarted",
    ],
    "random-restarted-noise-vecchia": [
        "planner=random", "detector=none", "model=vecchia", "model.noise_start=restarted",
        "model.neighbours=8",
    ],
    "random-reset-adam": ["planner=random", "detector=none", "model.optimizer_state=reset"],
    "random-reset-lbfgs-rcgp": [
        "planner=random", "detector=none", "model=rcgp", "model.optimizer=lbfgs",
        "model.optimizer_state=reset",
    ],
    "random-frozen": ["planner=random", "detector=none", "model.iterations=0"],
    "random-lbfgs": ["planner=random", "detector=best", "model.optimizer=lbfgs"],
    "random-float32": ["planner=random", "detector=best", "model.dtype=float32"],
    "random-per-sample": ["planner=random", "detector=best", "model.iterations=per_sample"],
    "random-spiky-pilot": ["planner=random", "detector=none", "pilot.outliers=true"],
    "random-bernoulli": ["planner=random", "detector=none", "outliers.count=bernoulli"],
    "random-floor": ["planner=random", "detector=none", "outliers.count=floor"],
    "random-one-draw-a-batch": ["planner=random", "detector=none", "fault.draw=batch"],
    "random-max-range": ["planner=random", "detector=none", "fault=max_range"],
    "random-uniform": ["planner=random", "detector=none", "fault=uniform"],
    "random-burst": ["planner=random", "detector=none", "fault=burst"],
    "random-stuck": ["planner=random", "detector=none", "fault=stuck"],
    "random-bias": ["planner=random", "detector=none", "fault=bias"],
    "random-drift-from-the-start": [
        "planner=random", "detector=none", "fault=drift", "pilot.outliers=true",
    ],
    "random-heavy-tail": ["planner=random", "detector=none", "fault=heavy_tail"],
    "random-local": ["planner=random", "detector=none", "fault=local"],
    "random-mixed": ["planner=random", "detector=none", "fault=mixed"],
    "random-dropout-from-the-start": [
        "planner=random", "detector=local", "fault=dropout", "pilot.outliers=true",
    ],
    "random-hampel": ["planner=random", "detector=hampel"],
    "random-hampel-historical": [
        "planner=random", "detector=hampel", "detector.scope=historical",
    ],
    "random-qartod": ["planner=random", "detector=qartod", "fault=stuck"],
    "random-qartod-historical": [
        "planner=random", "detector=qartod", "detector.scope=historical",
    ],
    "random-field": ["planner=random", "detector=none", "terrain=random_field", "terrain.seed=3"],
    "random-jacksboro": ["planner=random", "detector=none", "terrain=jacksboro"],
}  # fmt: skip

SEEDS = (0, 7)


def fly(name: str, seed: int) -> dict[str, Any]:
    """Fly one golden mission; returns its numbers by table and column."""
    config = infoplan.configure(*SHORT, *MISSIONS[name])
    frames = infoplan.fly(config, seed)
    curves = frames.curves.drop(columns=[c for c in frames.curves if c.endswith("_seconds")])
    samples = frames.samples.assign(used=frames.samples["used"].astype(int))
    # A row in seven of the samples and maps sees what all of them would; the sums see the rest.
    tables = {
        "curves": curves,
        "samples": samples.iloc[::7],
        "samples_sum": samples.sum(skipna=True).to_frame().T,
        "maps": frames.maps.iloc[::7],
        "maps_sum": frames.maps.sum().to_frame().T,
    }
    return {
        table: {
            column: [plain(value) for value in frame[column]]
            for column in frame
            if column not in ("planner", "detector", "scope", "rho", "terrain", "seed")
        }
        for table, frame in tables.items()
    }


def plain(value: Any) -> float | None:
    """Write a number with the digits that every machine agrees on; None for NaN."""
    return None if value is None or np.isnan(value) else float(f"{float(value):.12g}")


def difference(expected: dict[str, Any], found: dict[str, Any], rtol: float = 1e-6) -> str:
    """Say where the numbers of a mission first differ by more than rounding; empty if nowhere."""
    for table, columns in expected.items():
        for column, values in columns.items():
            old = np.array(values, dtype=float)
            new = np.array(found[table].get(column, []), dtype=float)
            if old.shape != new.shape:
                return f"{table}.{column} has {len(new)} rows instead of {len(old)}"
            close = np.isclose(new, old, rtol=rtol, atol=1e-9, equal_nan=True)
            if not close.all():
                row = int(np.argmin(close))
                return f"{table}.{column} has {new[row]} instead of {old[row]} in row {row}"
    return ""


def main() -> None:
    """Write the golden numbers."""
    stored = json.loads(FILE.read_text()) if FILE.is_file() else {}
    flown = {name: {str(seed): fly(name, seed) for seed in SEEDS} for name in MISSIONS}
    changed = [
        where
        for name, seeds in stored.get("missions", {}).items()
        for seed, numbers in seeds.items()
        if (where := difference(numbers, flown[name][seed]))
    ]
    if changed and stored["numerics_version"] == NUMERICS_VERSION:
        sys.exit(
            f"the numbers have changed ({changed[0]}): raise NUMERICS_VERSION in "
            "infoplan/study/identity.py and say why in CHANGELOG.md, or find what has changed them"
        )
    document = {"numerics_version": NUMERICS_VERSION, "missions": flown}
    FILE.write_text(json.dumps(document, separators=(",", ":")) + "\n")
    print(f"{len(flown)} missions x {len(SEEDS)} seeds written to {FILE}")


if __name__ == "__main__":
    main()
