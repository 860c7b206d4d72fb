"""Logs of surveys for tests, and what makes a survey of one quick."""

from pathlib import Path

import numpy as np
import pandas as pd

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


HOSTILE = "depth </script><img src=1 onerror=alert(1)> $$data &lt;"
"""Name of a column that would do something if a page took it for more than text."""


def write_hostile_log(folder: Path, samples: int = 60) -> Path:
    """Write a log on a plane of its own, of which names, a cell and the file would do harm."""
    log = folder / "<script>alert(1); b.csv"
    t = np.arange(samples)
    depth = 9 + np.sin(t / 9) + 5 * (t == 30)
    cells = [f"{value:.2f}" for value in depth]
    cells[7] = "<script>alert(1)</script>"
    rows = [
        f"{100 * np.sin(k / 9):.2f}\t{100 * np.cos(k / 7):.2f}\t{cell}"
        for k, cell in enumerate(cells)
    ]
    log.write_text("\n".join([f"x\ty\t{HOSTILE}", *rows]) + "\n")
    return log


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


FOOT = 0.3048
SPIKE, ROCK, LONELY = 10, 50, 90
"""Rows of the first log: a spike and a rock that the second passes, a spike that it does not."""


def _floor(x, y):
    return 9 + 0.03 * x + 0.02 * y


def write(path, columns):
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def first_log(path, start=1.7e9):
    rng = np.random.default_rng(2)
    x, y = np.tile(1.5 * np.arange(20.0), 5), np.repeat(6.0 * np.arange(5), 20)
    depth = _floor(x, y) + rng.normal(0, 0.05, 100)
    depth[[SPIKE, ROCK, LONELY]] += [5, 3, 5]
    return write(path, {"time": start + np.arange(100), "x": x, "y": y, "depth (m)": depth})


def second_log(path, start=1.7e9 + 86400):
    """Along the first leg and about the rock, in feet, under other names."""
    rng = np.random.default_rng(3)
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    x = np.concatenate([np.arange(30.0), 15 + 0.6 * np.cos(turn)])
    y = np.concatenate([np.full(30, 1.0), 12 + 0.6 * np.sin(turn)])
    depth = _floor(x, y) + rng.normal(0, 0.05, 42)
    depth[30:] += 3
    columns = {"Northing": y, "Easting": x, "Sounding depth (ft)": depth / FOOT}
    return write(path, {**columns, "timestamp": start + np.arange(42)})
