"""USGS ASCII digital elevation models, written by hand: newer GDAL reads them and writes none."""

from pathlib import Path

import numpy as np

RECORD = 1024
FIRST, LATER = 146, 170
"""Elevations in the first record of a profile, and in those that continue it."""


def write_dem(
    path: Path, elevation: np.ndarray, west: float, north: float, spacing: float, zone: int = 10
) -> Path:
    """Write whole metres on UTM nodes (WGS 84), the first row the north; returns the path.

    The records A and B of the standard: a header, then a profile a column from south to north.
    """
    rows, columns = elevation.shape
    east, south = west + spacing * (columns - 1), north - spacing * (rows - 1)
    header = f"{'A made-up mountain':144}" + _integers(1, 1, 1, zone) + _reals(*[0.0] * 15)
    header += _integers(2, 2, 4) + _reals(west, south, west, north, east, north, east, south)
    header += _reals(elevation.min(), elevation.max(), 0.0) + _integers(0)
    header += "".join(f"{number:12.6E}" for number in (spacing, spacing, 1.0))
    header += _integers(1, columns)
    records = [f"{header:890}{3:2}"]
    for j, profile in enumerate(elevation[::-1].T):
        x = west + spacing * j
        start = _integers(1, j + 1, rows, 1)
        start += _reals(x, south, 0.0, profile.min(), profile.max())
        records.append(start + _integers(*profile[:FIRST]))
        records += [
            _integers(*profile[begin : begin + LATER]) for begin in range(FIRST, rows, LATER)
        ]
    path.write_text("".join(record.ljust(RECORD) for record in records), encoding="ascii")
    return path


def _integers(*numbers: int) -> str:
    return "".join(f"{int(number):6}" for number in numbers)


def _reals(*numbers: float) -> str:
    return "".join(f"{float(number):24.15E}".replace("E", "D") for number in numbers)
