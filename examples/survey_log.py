"""Logs as a survey boat brings them home, simulated, for the page "After a survey".

In the folder of this file:

    python survey_log.py
    infoplan survey harbour.csv harbour_again.csv

`harbour.csv`: a boat goes up and down a harbour at a metre a second and sounds its depth each
second; some echoes come from fish, and for ten seconds the sounder is out of the water.
`harbour_again.csv`: the day after it crosses where two of the fish were, and counts in feet.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from infoplan.survey.projection import to_degrees
from infoplan.terrain import load_terrain

CRS, CORNER = "EPSG:32633", (389_900.0, 5_820_100.0)
"""Plane and corner of the harbour; any will do."""

LENGTH, WIDTH, SPACING = 60.0, 40.0, 8.0
"""Of the area, and between tracks, metres."""

FISH, OUT = (41, 97, 160, 233, 234, 271), range(303, 313)
"""Seconds at which the echo is another's, or none's."""

FOOT = 0.3048


def track() -> np.ndarray:
    """Positions a metre apart, up and down; shape (n, 2), metres from the corner."""
    legs = []
    for number, x in enumerate(np.arange(4.0, WIDTH, SPACING)):
        y = np.arange(2.0, LENGTH - 1.0)
        legs.append(np.column_stack([np.full(len(y), x), y if number % 2 == 0 else y[::-1]]))
        across = np.arange(x + 1.0, min(x + SPACING, WIDTH - 4.0))
        legs.append(np.column_stack([across, np.full(len(across), legs[-1][-1, 1])]))
    return np.concatenate(legs)


def sounded(path: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Positions along a path as the boat holds it, and the depths there, metres."""
    floor = load_terrain(
        "random_field", extent=[0, WIDTH, 0, LENGTH], lengthscale=[12, 15], amplitude=1.5, mean=6,
        shape=[60, 40], seed=3,
    )  # fmt: skip
    x = np.clip(path + rng.normal(0, 0.2, path.shape), 0, [WIDTH, LENGTH])
    return x, floor.elevation_at(x[:, 0], x[:, 1]) + rng.normal(0, 0.05, len(x))


def write(path: str, x: np.ndarray, depth: np.ndarray, day: str, column: str) -> None:
    """Write a log."""
    lat, lon = to_degrees(x + CORNER, CRS)
    with open(path, "w", newline="", encoding="utf-8") as stream:
        stream.write("# simulated; depth below the transducer\n")
        lines = csv.writer(stream, lineterminator="\n")
        lines.writerow(["Time", "Latitude", "Longitude", column])
        for second, row in enumerate(zip(lat, lon, depth, strict=True)):
            when = f"{day}T09:{second // 60:02d}:{second % 60:02d}Z"
            lines.writerow([when, f"{row[0]:.7f}", f"{row[1]:.7f}", f"{row[2]:.2f}"])


def write_both(folder: Path) -> None:
    """Write both logs."""
    x, depth = sounded(track(), np.random.default_rng(7))
    depth[list(FISH)] -= [2.5, 3.1, 1.9, 2.8, 2.7, 3.4]
    depth[list(OUT)] = 0.3
    write(str(folder / "harbour.csv"), x, depth, "2024-05-01", "Depth (m)")
    across = np.arange(2.0, WIDTH - 2.0)
    legs = [np.column_stack([across, np.full(len(across), x[fish, 1])]) for fish in FISH[:2]]
    x, depth = sounded(np.concatenate([legs[0], legs[1][::-1]]), np.random.default_rng(8))
    write(str(folder / "harbour_again.csv"), x, depth / FOOT, "2024-05-02", "Depth (ft)")


if __name__ == "__main__":
    write_both(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
