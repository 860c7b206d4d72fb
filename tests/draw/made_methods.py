"""Made-up missions of any methods: all built-in pairs, the user's, PyOD's, replays."""

from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

import made_tables
import numpy as np

from infoplan.config import METHODS

PLANNERS = tuple(name for name in METHODS["planner"] if name != "own")
DETECTORS = tuple("pyod_ecod" if name == "pyod" else name for name in METHODS["detector"]
                  if name != "own")  # fmt: skip
PAIRS = tuple(product(PLANNERS, DETECTORS))
"""Every built-in planner with every built-in detector."""

FLOWN, EPOCHS, BATCH = 30, 3, 6
"""Samples of the pilot, epochs after it, samples of each."""


def options(group: str, name: str) -> dict[str, Any]:
    """Options of a choice, as they are stored."""
    if "." in name:  # a function of the user's
        own = asdict(METHODS[group]["own"])
        return own | {
            "name": name.rpartition(".")[2],
            "function": name,
            "options": {},
            "sha256": "f" * 64,
        }
    if name.startswith("pyod_"):
        return asdict(METHODS[group]["pyod"]) | {"name": name, "model": name[5:].upper()}
    return asdict(METHODS[group][name])


def store(
    folder: Path,
    planner: str = "uct",
    detector: str = "none",
    model: str = "gp",
    scope: str = "batch",
    seed: int = 0,
    **others: Any,
) -> str:
    """Store a mission of a second or so that was never flown; returns the run's name."""
    names = [name.rpartition(".")[2] for name in (planner, detector)]
    rows = [FLOWN + BATCH * epoch for epoch in range(EPOCHS + 1)]
    rng = np.random.default_rng(seed)
    n, angle = rows[-1], np.linspace(0.0, 12.0, rows[-1])
    outlier = np.arange(n) % 7 == 6
    outlier[:FLOWN] = False
    flagged = outlier if detector == "best" else (np.arange(n) % 5 == 4) & (np.arange(n) > FLOWN)
    samples = {
        "epoch": np.repeat(range(EPOCHS + 1), [FLOWN, *[BATCH] * EPOCHS]),
        "x1": 25.0 + (5.0 + angle) * np.cos(angle),
        "x2": 25.0 + (5.0 + angle) * np.sin(angle),
        "measured": 1000.0 + rng.normal(0.0, 30.0, n) + 300.0 * outlier,
        "is_outlier": outlier,
        "flagged": flagged & (detector != "none"),
    }
    counts = [(0, 0, 0, BATCH)] + [(1, 1, 0, BATCH - 2)] * EPOCHS
    given = {
        "planner": options("planner", planner),
        "detector": options("detector", detector) | {"scope": scope},
        "model": options("model", model),
        "terrain__orientation": 0,
    }
    rmse = np.linspace(500.0, 300.0 + 10.0 * PLANNERS.index(planner), len(rows)) + seed \
        if planner in PLANNERS else np.linspace(500.0, 250.0, len(rows)) + seed  # fmt: skip
    return made_tables.store(
        folder, "-".join(names), scope=scope, seed=seed, collected=rows, counts=counts,
        samples=samples, **{"rmse": rmse, "pilot__samples": FLOWN, "terrain": "volcano"} | given
        | others,
    )  # fmt: skip
