"""Draw a track of every planner on one terrain: ``draw_planners.py [folder]``, else docs."""

import sys
from pathlib import Path

import numpy as np

import infoplan
from infoplan.draw import style
from infoplan.palette import RIM
from infoplan.plan import PLANNERS
from infoplan.terrain import load_terrain

FOLDER = Path(__file__).parents[1] / "docs"
OBSTACLES = [[[30, 28], [38, 28], [38, 36], [34, 31], [30, 36]]]
OPTIONS = ("terrain=volcano", "detector=none", "rho=0", "grid=[40,40]")
SEED = 0


def draw_planners(folder: Path = FOLDER, budget: int = 600) -> Path:
    """Draw a panel for each planner, and return the file."""
    terrain = load_terrain("volcano", obstacles=OBSTACLES)
    style.load_matplotlib()
    columns = 3
    with style.journal():
        rows = -(-len(PLANNERS) // columns)
        figure = style.new_figure(style.PAGE, 2.4 * rows)
        panels = figure.subplots(rows, columns, sharex=True, sharey=True)
        for axes in panels.flat[len(PLANNERS) :]:
            axes.set_visible(False)
        for axes, name in zip(panels.flat, PLANNERS, strict=False):
            _draw(axes, name, terrain, budget)
        path = folder / "planners.png"
        figure.savefig(path, dpi=110)
    return path


def _draw(axes, name: str, terrain, budget: int) -> None:
    config = infoplan.configure(f"planner={name}", *OPTIONS, budget=budget)
    config.terrain.obstacles = OBSTACLES
    frames = infoplan.fly(config, SEED, terrain)
    driven = frames.samples[frames.samples["epoch"] > 0]
    style.show_relief(axes, terrain.elevation, terrain.extent)
    style.show_obstacles(axes, OBSTACLES)
    axes.plot(driven["x1"], driven["x2"], color=RIM, lw=2.0)  # parts white from yellow
    axes.plot(driven["x1"], driven["x2"], color="white", lw=1.0)
    axes.plot(*driven[["x1", "x2"]].iloc[0], "o", color="white", mec=style.INK, ms=4)
    rmse = np.array(frames.curves["rmse"])[-1]
    style.panel(axes, "", f"{name}, RMSE {rmse:.0f} {terrain.unit}")
    axes.set(xlabel="", ylabel="")


if __name__ == "__main__":
    print(draw_planners(*map(Path, sys.argv[1:])))
