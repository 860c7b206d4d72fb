"""Logs of surveys for tests, and what makes a survey of one quick."""

from pathlib import Path

import numpy as np

QUICK = ["model=gp", "model.pilot_iterations=20", "model.iterations=1", "grid=[9,8]"]
"""Options of a survey of a tenth of a second."""

SPIKES = (17, 40, 63)
"""Samples of `write_log` that are spoilt."""

HEADER = "stamp,Latitude,Longitude,Depth (ft),note"


def write_log(path: Path, samples: int = 80) -> Path:
    """Write a log: a winding track, a second a sample, a smooth floor, and a few spikes."""
    rng = np.random.default_rng(5)
    t = np.arange(samples)
    lat = 17.97 + 2e-4 * np.sin(t / 9) + 1e-5 * t
    lon = -67.04 + 2e-4 * np.cos(t / 7)
    depth = 9 + 2 * np.sin(t / 9) + np.cos(t / 7) + rng.normal(0, 0.05, samples)
    depth[list(SPIKES)] += 6
    rows = [
        f"2024-05-01T10:{i // 60:02d}:{i % 60:02d}Z,{a:.7f},{b:.7f},{d:.2f},n{i}"
        for i, a, b, d in zip(t, lat, lon, depth, strict=True)
    ]
    path.write_text("\n".join([HEADER.replace("stamp", "time"), *rows]) + "\n")
    return path


def write_long_log(path: Path, samples: int, length: float = 250.0) -> Path:
    """Write a log of tracks side by side, a metre a sample, one in two hundred a spike."""
    rng = np.random.default_rng(11)
    number, along = np.divmod(np.arange(samples), int(length))
    x = np.where(number % 2 == 0, along, length - 1 - along) + rng.normal(0, 0.1, samples)
    y = 5.0 * number + rng.normal(0, 0.1, samples)
    depth = 9 + 2 * np.sin(x / 30) + np.cos(y / 40) + rng.normal(0, 0.05, samples)
    depth[100::200] += 4
    table = np.column_stack([np.arange(samples), x, y, depth])
    np.savetxt(path, table, "%.3f", ",", header="time,x,y,depth", comments="")
    return path
