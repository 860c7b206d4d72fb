"""Methods against sensor faults as a heat map, over all maps of a folder."""

import math
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.by_fault import FaultTable
from infoplan.draw import style
from infoplan.draw.fault_table import REFERENCE, caption, cell_parts, decimals, remarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

CELL_WIDTH, CELL_HEIGHT = 0.42, 0.25
"""Inches."""

CHARACTER = 0.058
"""Width of a character of a method's name, inches."""

LONGEST_NAME = 40


def draw(table: FaultTable, folder: Path) -> list[Path]:
    """Draw the heat map; returns its files."""
    with style.journal():
        return style.save(picture(table), folder, "outliers", table.cells)


def picture(table: FaultTable) -> "Figure":
    """Make the heat map: a row a method, a column a fault, the area and half of its interval.

    References stand on top, then the methods that stand most faults. Cells that cannot be told from
    the best of their column are bold and framed.
    """
    rows, columns = len(table.methods), len(table.faults)
    names = [style.inert(method, LONGEST_NAME) for method in table.methods]
    beside = CHARACTER * max(map(len, names)) + 0.6
    width = max(beside + CELL_WIDTH * columns + 0.4, style.COLUMN)
    notes = _notes(table, width)
    figure = style.new_figure(width, CELL_HEIGHT * rows + 0.75 + 0.1 * len(notes))
    axes = figure.add_subplot()
    means = table.grid("mean").to_numpy(dtype=float)
    colours = style.score_colours(means)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    for row, method in enumerate(table.methods):
        for column, fault in enumerate(table.faults):
            _draw_cell(axes, (column, row), colours, float(means[row, column]),
                       cell_parts(table, method, fault, decimals(table)))  # fmt: skip
    marked = set(table.references)
    axes.set_yticks(range(rows), [
        f"{name}\n{REFERENCE}" if method in marked else name
        for name, method in zip(names, table.methods, strict=True)
    ])  # fmt: skip
    faults = [style.inert(fault, LONGEST_NAME) for fault in table.faults]
    axes.set_xticks(range(columns), list(map(_heading, faults)))
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    if table.references and len(table.references) < rows:
        axes.axhline(len(table.references) - 0.5, color=style.INK, lw=1.2)
    _colour_bar(axes, colours, means)
    figure.supxlabel("\n".join(notes), fontsize=style.TINY, ha="left", x=0.02)
    return figure


def _heading(fault: str) -> str:
    """Break a fault's label so that it fits over its column."""
    parts = fault.split(" ")
    return "\n".join(part.replace("_", "_\n") if len(part) > 8 else part for part in parts)


def _draw_cell(
    axes: "Axes",
    place: tuple[int, int],
    colours: "ScalarMappable",
    mean: float,
    parts: tuple[str, str, bool],
) -> None:
    from matplotlib.patches import Rectangle

    column, row = place
    text, half, best = parts
    known = math.isfinite(mean)
    colour = style.rgba(colours, mean) if known else style.WHITE
    corner = (column - 0.5, row - 0.5)
    hatch = None if known else "////"
    axes.add_patch(
        Rectangle(corner, 1, 1, facecolor=colour, edgecolor="white" if known else style.GRID,
                  lw=0.8, hatch=hatch)
    )  # fmt: skip
    ink = style.ink_on(colour)
    if best:
        inner = (column - 0.46, row - 0.44)
        axes.add_patch(Rectangle(inner, 0.92, 0.88, fill=False, edgecolor=ink, lw=0.7))
    weight = "bold" if best else "normal"
    axes.text(column, row - 0.16 if half else row, text.replace(" ", "\n"), ha="center",
              va="center", color=ink, fontsize=style.SMALL if known else style.TINY,
              weight=weight)  # fmt: skip
    if half:
        axes.text(column, row + 0.25, half, ha="center", va="center", color=ink,
                  fontsize=style.TINY)  # fmt: skip


def _colour_bar(axes: "Axes", colours: "ScalarMappable", means: NDArray[np.float64]) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

    highest = float(colours.get_clim()[1] or math.inf)
    beyond = bool((means[np.isfinite(means)] > highest).any())
    bar = axes.figure.colorbar(colours, ax=axes, pad=0.01, fraction=0.03, aspect=35,
                               extend="max" if beyond else "neither")  # fmt: skip
    bar.outline.set_linewidth(0.6)
    bar.set_label("area (standard deviations of the map)")
    bar.ax.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _notes(table: FaultTable, width: float) -> list[str]:
    """Break what a reader needs to know into lines that fit below the picture."""
    lines = [caption(table), *remarks(table, "bold and framed")]
    return [part for line in lines for part in wrap(style.inert(line, 400), int(width / 0.0405))]
