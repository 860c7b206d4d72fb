"""Draw how the parts of a mission go together: ``draw_loop.py [folder]``, else docs."""

import sys
from pathlib import Path

from infoplan.draw import style
from infoplan.palette import BLUE, PAGE

FOLDER = Path(__file__).parents[1] / "docs"
BOXES = {
    "terrain": (0, 1, "terrain"),
    "robot": (1, 1, "robot\ndrives, samples"),
    "sensor": (2, 1, "sensor\nnoise, faults"),
    "detector": (3, 1, "detector"),
    "model": (4, 1, "model\nmean, deviation"),
    "density": (3, 0, "outlier density"),
    "planner": (4, 0, "planner"),
}
"""Column, row and text of each."""
ARROWS = [
    ("terrain", "robot", ""),
    ("robot", "sensor", ""),
    ("sensor", "detector", ""),
    ("detector", "model", "clean"),
    ("detector", "density", "flagged"),
    ("model", "planner", ""),
    ("density", "planner", ""),
]
WIDE, HIGH, STEP_X, STEP_Y = 1.1, 0.5, 1.5, 0.95
"""Of a box and from one to the next, inches."""


def draw_loop(folder: Path = FOLDER) -> Path:
    """Draw the picture, and return the file."""
    style.load_matplotlib()
    from matplotlib.patches import FancyBboxPatch

    with style.journal():
        figure = style.new_figure(4 * STEP_X + WIDE + 0.1, STEP_Y + HIGH + 0.1)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(-0.05, 4 * STEP_X + WIDE + 0.05), ylim=(-0.05, STEP_Y + HIGH + 0.05))
        axes.axis("off")
        for column, row, text in BOXES.values():
            x, y = column * STEP_X, row * STEP_Y
            axes.add_patch(
                FancyBboxPatch((x + 0.05, y + 0.05), WIDE - 0.1, HIGH - 0.1, fc=PAGE["panel"][0],
                               ec=BLUE, lw=0.8, boxstyle="round,pad=0.05")
            )  # fmt: skip
            axes.text(x + WIDE / 2, y + HIGH / 2, text, ha="center", va="center",
                      fontsize=style.TITLE)  # fmt: skip
        for start, end, text in ARROWS:
            _arrow(axes, *BOXES[start][:2], *BOXES[end][:2], text)
        # The track goes back to the robot, below all that stands between them.
        x = STEP_X + WIDE / 2
        track = [(4 * STEP_X + WIDE / 2, 0.0), (4 * STEP_X + WIDE / 2, -0.18), (x, -0.18)]
        axes.plot(*zip(*track, strict=True), color=style.DARK, lw=0.9)
        axes.annotate("", (x, STEP_Y), (x, -0.18), arrowprops=_look())
        axes.text(2 * STEP_X + WIDE / 2, -0.14, "track", ha="center", fontsize=style.TEXT,
                  color=style.DARK)  # fmt: skip
        axes.set_ylim(-0.25, STEP_Y + HIGH + 0.05)
        path = folder / "loop.png"
        figure.savefig(path, dpi=140)
    return path


def _arrow(axes, column, row, to_column, to_row, text: str) -> None:
    """Draw an arrow from the side of a box to that of another: to the right, or down."""
    if row == to_row:
        y = row * STEP_Y + HIGH / 2
        start, end = (column * STEP_X + WIDE, y), (to_column * STEP_X, y)
    else:
        x = column * STEP_X + WIDE / 2
        start, end = (x, row * STEP_Y), (x, to_row * STEP_Y + HIGH)
    axes.annotate("", end, start, arrowprops=_look())
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    offset = (0, 0.08) if row == to_row else (0.06, 0)
    axes.text(
        middle[0] + offset[0], middle[1] + offset[1], text, fontsize=style.TEXT, color=style.DARK,
        ha="center" if row == to_row else "left", va="center",
    )  # fmt: skip


def _look() -> dict:
    return {"arrowstyle": "-|>", "color": style.DARK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}


if __name__ == "__main__":
    print(draw_loop(*map(Path, sys.argv[1:])))
