"""Draw what every sensor fault makes of a track: ``draw_faults.py [folder]``, else docs/faults."""

import sys
from pathlib import Path

import numpy as np

from infoplan.config import METHODS, Config
from infoplan.draw import style
from infoplan.fault import FAULTS
from infoplan.palette import OUTLIER
from infoplan.simulator import Simulator
from infoplan.terrain import load_terrain

FOLDER = Path(__file__).parents[1] / "docs" / "faults"
SAMPLES, BATCH, SEED = 160, 20, 1
RHO = 0.15
COLOURS = {"truth": style.FAINT, "sound": style.INK, "outlier": OUTLIER}


def draw_faults(folder: Path = FOLDER) -> list[Path]:
    """Draw a picture for each fault, and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    terrain = load_terrain("volcano")
    return [_draw(name, terrain, folder / f"{name}.png") for name in FAULTS]


def _draw(name, terrain, path: Path) -> Path:
    config = Config(fault=METHODS["fault"][name], rho=RHO)
    simulator = Simulator(config, terrain, SEED)
    way = np.linspace(0.0, 1.0, SAMPLES)
    x = np.column_stack([5 + 40 * way, 25 + 12 * np.sin(7 * way)])
    poses = np.column_stack([x, np.zeros(SAMPLES)])
    batches = [
        simulator.sample(epoch, poses[start : start + BATCH])
        for epoch, start in enumerate(range(0, SAMPLES, BATCH), 1)
    ]
    measured, outlier, truth = (
        np.concatenate([getattr(batch, part) for batch in batches])
        for part in ("measured", "is_outlier", "truth")
    )
    number = np.arange(SAMPLES)
    with style.journal():
        figure = style.new_figure(style.PAGE, 1.6)
        axes = figure.add_subplot()
        axes.plot(number, truth, color=COLOURS["truth"], lw=1.0, label="truth")
        sound = ~outlier
        axes.plot(number[sound], measured[sound], ".", color=COLOURS["sound"], ms=2.5,
                  label="measurement")  # fmt: skip
        if np.isfinite(measured[outlier]).any():
            axes.plot(number[outlier], measured[outlier], "x", color=COLOURS["outlier"], ms=4,
                      mew=0.9, label="outlier")  # fmt: skip
        for one in number[np.isnan(measured)]:
            label = "nothing said" if one == number[np.isnan(measured)][0] else None
            axes.axvspan(one - 0.5, one + 0.5, color=COLOURS["outlier"], alpha=0.25, lw=0,
                         label=label)  # fmt: skip
        axes.set(xlabel="sample", ylabel=f"elevation ({terrain.unit})", xlim=(-1, SAMPLES))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.savefig(path, dpi=110)
    return path


if __name__ == "__main__":
    for file in draw_faults(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER):
        print(file)
