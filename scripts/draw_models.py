"""Draw what every model makes of the same samples: ``draw_models.py [folder]``, else docs."""

import sys
from pathlib import Path

import numpy as np

import infoplan
from infoplan.draw import style
from infoplan.model import MODELS
from infoplan.terrain import load_terrain

FOLDER = Path(__file__).parents[1] / "docs"
OPTIONS = ("planner=lawnmower", "planner.spacing=9", "detector=none", "terrain=volcano", "rho=0.2")
GRID = 40
SEED = 0


def draw_models(folder: Path = FOLDER, budget: int = 520, models: tuple = tuple(MODELS)) -> Path:
    """Draw the truth, and a panel for each model, and return the file."""
    terrain = load_terrain("volcano")
    style.load_matplotlib()
    flown = {
        name: infoplan.fly(
            infoplan.configure(f"model={name}", *OPTIONS, budget=budget, grid=[GRID, GRID]),
            SEED, terrain,
        )
        for name in models
    }  # fmt: skip
    truth = next(iter(flown.values())).maps["truth"].to_numpy()
    columns = 4
    rows = -(-(len(models) + 1) // columns)
    with style.journal():
        figure = style.new_figure(style.SHOWN_SMALL, 1.62 * rows)
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).flat
        _show(panels[0], truth, truth, terrain, "truth")
        samples = next(iter(flown.values())).samples
        panels[0].plot(samples["x1"], samples["x2"], color="white", lw=0.7)
        style.mark(panels[0], samples[samples["is_outlier"]], "missed", size=3.0)
        for axes, (name, frames) in zip(panels[1:], flown.items(), strict=False):
            rmse = np.array(frames.curves["rmse"])[-1]
            mean = frames.maps["mean"].to_numpy()
            _show(axes, mean, truth, terrain, f"{name}\nRMSE {rmse:.0f} {terrain.unit}")
        for axes in panels[len(models) + 1 :]:
            axes.set_visible(False)
        path = folder / "models.png"
        figure.savefig(path, dpi=160)
    return path


def _show(axes, values, truth, terrain, title: str) -> None:
    style.show_map(
        axes, values.reshape(GRID, GRID), terrain.extent, cmap=style.ELEVATION,
        vmin=truth.min(), vmax=truth.max(),
    )  # fmt: skip
    axes.set(xlabel="", ylabel="")
    style.panel(axes, "", title)


if __name__ == "__main__":
    print(draw_models(*map(Path, sys.argv[1:])))
