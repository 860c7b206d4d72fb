"""A log as a survey boat brings it home, simulated: `harbour.csv`, for the page "After a survey".

In the folder of this file:

    python survey_log.py
    infoplan survey harbour.csv

A boat goes up and down a harbour at a metre a second and sounds its depth each second; some echoes
come from fish, and for ten seconds the sounder is out of the water.
"""

import csv
import sys

import numpy as np

from infoplan.survey.projection import to_degrees
from infoplan.terrain import load_terrain

CRS, CORNER = "EPSG:32633", (389_900.0, 5_820_100.0)
"""Plane and corner of the harbour; any will do."""

LENGTH, WIDTH, SPACING = 60.0, 40.0, 8.0
"""Of the area, and between tracks, metres."""

FISH, OUT = (41, 97, 160, 233, 234, 271), range(303, 313)
"""Seconds at which the echo is another's, or none's."""


def track() -> np.ndarray:
    """Positions a metre apart, up and down; shape (n, 2), metres from the corner."""
    legs = []
    for number, x in enumerate(np.arange(4.0, WIDTH, SPACING)):
        y = np.arange(2.0, LENGTH - 1.0)
        legs.append(np.column_stack([np.full(len(y), x), y if number % 2 == 0 else y[::-1]]))
        across = np.arange(x + 1.0, min(x + SPACING, WIDTH - 4.0))
        legs.append(np.column_stack([across, np.full(len(across), legs[-1][-1, 1])]))
    return np.concatenate(legs)


def write(path: str) -> None:
    """Write the log."""
    rng = np.random.default_rng(7)
    floor = load_terrain(
        "random_field", extent=[0, WIDTH, 0, LENGTH], lengthscale=[12, 15], amplitude=1.5, mean=6,
        shape=[60, 40], seed=3,
    )  # fmt: skip
    x = track() + rng.normal(0, 0.2, track().shape)
    x = np.clip(x, 0, [WIDTH, LENGTH])
    depth = floor.elevation_at(x[:, 0], x[:, 1]) + rng.normal(0, 0.05, len(x))
    depth[list(FISH)] -= [2.5, 3.1, 1.9, 2.8, 2.7, 3.4]
    depth[list(OUT)] = 0.3
    lat, lon = to_degrees(x + CORNER, CRS)
    with open(path, "w", newline="", encoding="utf-8") as stream:
        stream.write("# simulated; depth below the transducer\n")
        lines = csv.writer(stream, lineterminator="\n")
        lines.writerow(["Time", "Latitude", "Longitude", "Depth (m)"])
        for second, row in enumerate(zip(lat, lon, depth, strict=True)):
            when = f"2024-05-01T09:{second // 60:02d}:{second % 60:02d}Z"
            lines.writerow([when, f"{row[0]:.7f}", f"{row[1]:.7f}", f"{row[2]:.2f}"])


if __name__ == "__main__":
    write(sys.argv[1] if len(sys.argv) > 1 else "harbour.csv")
