"""Curves drawn in characters."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Curve(Protocol):
    """A learning curve: a table, or what else has columns."""

    def __getitem__(self, name: str, /) -> Any: ...


# Bits of the eight dots of a Braille character: rows from the top, left and right column.
BRAILLE = 0x2800
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


def takes_braille(encoding: str | None) -> bool:
    """Whether an output encoding has the characters that `curve_lines` draws with."""
    try:
        "⣿┤└─".encode(encoding or "ascii")
    except (LookupError, UnicodeEncodeError):
        return False
    return True


def curve_lines(
    x: ArrayLike,
    y: ArrayLike,
    *,
    width: int,
    height: int,
    low: float,
    high: float,
    braille: bool = True,
) -> list[str]:
    """Draw a curve in characters.

    Parameters
    ----------
    x, y
        Points of the curve, x ascending; it is linear between them.
    width, height
        Size in characters.
    low, high
        What the bottom and the top stand for; the curve is cut off there.
    braille
        Braille characters, each of 2 x 4 dots; else asterisks, for any encoding.

    Returns
    -------
    list of str
        `height` lines of `width` characters.
    """
    wide, tall = (2, 4) if braille else (1, 1)
    dots = _rasterise(np.asarray(x, float), np.asarray(y, float), wide * width, tall * height,
                      low, high)  # fmt: skip
    if not braille:
        return ["".join("*" if dot else " " for dot in row) for row in dots]
    cells = dots.reshape(height, tall, width, wide).transpose(0, 2, 1, 3)
    codes = BRAILLE + (cells * DOTS).sum(axis=(2, 3))
    return ["".join(chr(code) for code in row) for row in codes]


def plot_lines(
    x: ArrayLike,
    y: ArrayLike,
    *,
    width: int,
    height: int,
    title: str,
    x_label: str,
    braille: bool = True,
) -> list[str]:
    """Draw a curve with axes, y from zero.

    Parameters
    ----------
    x, y
        Points of the curve, x ascending.
    width, height
        Size of the curve in characters; labels come on top of it.
    title, x_label
        Above, and below the right end.
    braille
        As for `curve_lines`; without it the axes are plain ASCII, too.

    Returns
    -------
    list of str
    """
    xs, ys = np.asarray(x, float), np.asarray(y, float)
    high = _round_up(float(np.nanmax(ys)))
    curve = curve_lines(xs, ys, width=width, height=height, low=0.0, high=high, braille=braille)
    tick, side, corner, floor = "┤│└─" if braille else "+|+-"
    labelled = {0: f"{high:g}", height // 2: f"{high * (1 - (height // 2) / height):g}"}
    margin = max(map(len, labelled.values()))
    lines = [title]
    for row, text in enumerate(curve):
        line = f"{labelled.get(row, ''):>{margin}} {tick if row in labelled else side}{text}"
        lines.append(line.rstrip(f" {chr(BRAILLE)}"))
    lines.append(f"{0:>{margin}} {corner}{floor * width}")
    ends = f"{xs[0]:g}", f"{xs[-1]:g} {x_label}"
    gap = max(1, width - len(ends[0]) - len(f"{xs[-1]:g}"))
    lines.append(" " * (margin + 2) + ends[0] + " " * gap + ends[1])
    return lines


def small_curves(runs: Sequence[Sequence[Curve]], *, braille: bool = True) -> list[str]:
    """Draw the mean RMSE curve of each run in 12 x 3 characters, all on one scale from zero.

    Parameters
    ----------
    runs
        For each run its missions' learning curves: something whose items ``collected`` and
        ``rmse`` are arrays.
    braille
        As for `curve_lines`.

    Returns
    -------
    list of str
        One a run, its lines joined by line ends; empty for a run without curves.
    """
    means: list[tuple[Floats, Floats] | None] = []
    for curves in runs:
        if not curves:
            means.append(None)
            continue
        points = [(np.asarray(c["collected"], float), np.asarray(c["rmse"], float)) for c in curves]
        axis = np.linspace(max(x[0] for x, _ in points), min(x[-1] for x, _ in points), 100)
        means.append((axis, np.mean([np.interp(axis, x, y) for x, y in points], axis=0)))
    high = max((float(mean[1].max()) for mean in means if mean), default=1.0)
    size = {"width": 12, "height": 3}
    return [
        "\n".join(curve_lines(*mean, **size, low=0.0, high=high, braille=braille)) if mean else ""
        for mean in means
    ]


def _rasterise(
    x: Floats, y: Floats, columns: int, rows: int, low: float, high: float
) -> NDArray[np.bool_]:
    """Mark the dots that a curve passes, row 0 at the top; neighbours are joined."""
    edges = np.interp(np.linspace(x[0], x[-1], columns), x, y)
    share = np.clip((edges - low) / ((high - low) or 1.0), 0.0, 1.0)
    # A gap in the curve stays one.
    level = np.where(np.isnan(share), -1, np.rint(share * (rows - 1))).astype(int)
    dots = np.zeros((rows, columns), dtype=bool)
    for column, here in enumerate(level):
        if here < 0:
            continue
        before = level[column - 1] if column and level[column - 1] >= 0 else here
        # The step from the neighbour belongs to this column, less the neighbour's own dot.
        first, last = sorted((here, before + np.sign(here - before)))
        dots[first : last + 1, column] = True
    return dots[::-1]


def _round_up(value: float) -> float:
    """Round up to a number that is easy to read on an axis."""
    if not value > 0:
        return 1.0
    unit = 10.0 ** np.floor(np.log10(value))
    steps = (1, 1.2, 1.6, 2, 3, 4, 6, 8, 10, 12)
    return float(next(step * unit for step in steps if step * unit >= value))
