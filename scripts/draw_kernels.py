"""Draw correlation and sample paths of every kernel: ``draw_kernels.py [file]``, else docs/."""

import sys
from pathlib import Path

import numpy as np

from infoplan.config import KERNELS
from infoplan.draw import style
from infoplan.model.kernels import as_kernel
from infoplan.palette import BLUE, ORANGE

FILE = Path(__file__).parents[1] / "docs" / "kernels.png"
LENGTHSCALE, NODES, SEED = 0.3, 400, 4
GROWTHS = {"growth_1": 3.0}
"""Of gibbs, which is the Gaussian kernel without; other starts are those of a mission."""


def correlations(name: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Correlations along the first axis."""
    kernel = as_kernel(name)
    starts = [
        GROWTHS.get(one.name, LENGTHSCALE if one.start is None else one.start)
        for one in kernel.hyperparameters
    ]
    constants = kernel.constants(np.log(starts))
    return np.array([[kernel.correlation(constants, p, 0.0, q, 0.0) for q in b] for p in a])


def draw_kernels(file: Path = FILE) -> Path:
    """Draw the picture, and return its file."""
    x = np.linspace(-1.0, 1.0, NODES)
    with style.journal():
        figure = style.new_figure(style.PAGE, 1.1 * len(KERNELS))
        grid = figure.add_gridspec(len(KERNELS), 2, width_ratios=[2, 3])
        for row, name in enumerate(KERNELS):
            left, right = (figure.add_subplot(grid[row, column]) for column in (0, 1))
            left.plot(x, correlations(name, np.zeros(1), x)[0], color=style.INK, lw=1.0)
            left.set(ylim=(0.0, 1.05), xlim=(0.0, 1.0), ylabel=name.replace("_", "\n"))
            # Of the same noise, so that smoothness is the only difference.
            values, vectors = np.linalg.eigh(correlations(name, x, x))
            root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
            paths = root @ np.random.default_rng(SEED).normal(size=(NODES, 2))
            for path, colour in zip(paths.T, (BLUE, ORANGE), strict=True):
                right.plot(x, path, lw=1.0, color=colour)
            right.set(xlim=(-1.0, 1.0))
            if row == 0:
                style.panel(left, "", "correlation with the middle")
                style.panel(right, "", "two sample paths")
            if row < len(KERNELS) - 1:
                left.tick_params(labelbottom=False)
                right.tick_params(labelbottom=False)
        left.set_xlabel("distance from the middle (scaled units)")
        right.set_xlabel("position (scaled units)")
        figure.savefig(file, dpi=140)
    return file


if __name__ == "__main__":
    print(draw_kernels(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE))
