"""Draw maps that need no download: ``draw_maps.py [folder]``, else docs."""

import sys
from pathlib import Path

from infoplan.draw import style
from infoplan.terrain import load_terrain

ROOT = Path(__file__).parents[1]
MAPS = {
    "terrain=volcano": {"name": "volcano"},
    "terrain=jacksboro": {"name": "jacksboro"},
    "terrain=random_field": {"name": "random_field", "lengthscale": [9.0, 4.0], "seed": 4},
    "terrain=own": {"name": "own", "function": "own_terrain.ridges"},
}


def draw_maps(folder: Path = ROOT / "docs") -> Path:
    """Draw a panel for each map, and return the file."""
    sys.path.insert(0, str(ROOT / "examples"))
    style.load_matplotlib()
    with style.journal():
        figure = style.new_figure(style.SHOWN_SMALL, 1.55)
        for axes, (title, options) in zip(figure.subplots(1, len(MAPS)), MAPS.items(), strict=True):
            terrain = load_terrain(**options)
            style.show_relief(axes, terrain.elevation, terrain.extent)
            style.panel(axes, "", title)
            axes.set(xlabel="", ylabel="")
        path = folder / "maps.png"
        figure.savefig(path, dpi=160)
    sys.path.pop(0)
    return path


if __name__ == "__main__":
    print(draw_maps(*map(Path, sys.argv[1:])))
