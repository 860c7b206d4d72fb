"""Seconds and MiB of the models against the number of samples, from what ``make bench`` stored.

``python -m benchmarks.growth_picture [JSON]`` draws ``docs/vecchia_growth.png``.
"""

import json
import sys
from pathlib import Path

from benchmarks.neighbours import slope
from infoplan.backend import load_matplotlib

FIGURE = Path(__file__).parents[1] / "docs" / "vecchia_growth.png"
PANELS = (
    ("iteration_seconds", "an iteration of the optimiser, s"),
    ("prediction_seconds", "a prediction of 2500 nodes, s"),
    ("peak_mib", "memory of both, MiB"),
)


def draw(growth: dict[str, list[dict[str, float]]]) -> None:
    """Draw a panel a quantity, a line a model, its slope beside it."""
    load_matplotlib()
    from matplotlib.figure import Figure

    from infoplan.draw import style

    with style.journal():
        figure = Figure(figsize=(style.PAGE, 2.3), layout="constrained")
        for (column, title), panel in zip(PANELS, figure.subplots(1, 3), strict=True):
            for (kind, rows), marker in zip(growth.items(), "so", strict=True):
                panel.plot(
                    [row["n"] for row in rows], [row[column] for row in rows],
                    marker=marker, ms=3, label=f"{kind}: n^{slope(rows, column):.2f}",
                )  # fmt: skip
            panel.set(xscale="log", yscale="log", xlabel="samples")
            panel.set_title(title, loc="left")
            panel.legend()
        figure.savefig(FIGURE, dpi=160)


def main(file: str = "results/benchmarks.json") -> None:
    """Draw the figure."""
    draw(json.loads(Path(file).read_text())["raw"]["neighbours"]["growth"])


if __name__ == "__main__":
    main(*sys.argv[1:])
