"""Fig. 1 (b) to (d): the terrain with its data, and what the model makes of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.missions import mission_maps
from infoplan.palette import OUTLIER

NEEDS = (("UCT-BEST", 0.1, "batch"), ("UCT-NONE", 0.1, "batch"))


def draw(selection: Selection, folder: Path, seed: int) -> list[Path]:
    """Draw Fig. 1 (b) to (d) from missions at rho 0.1; returns its files.

    The data are those of UCT-NONE; the surfaces without and with outliers are the final means of
    UCT-BEST and of UCT-NONE. All three have the same axes.
    """
    best, none = (mission_maps(selection, *need, seed) for need in NEEDS)
    surfaces = {
        "ground truth and data": best.truth,
        "without outliers (UCT-BEST)": best.mean,
        "with outliers (UCT-NONE)": none.mean,
    }
    is_spike = none.samples["is_outlier"].astype(bool)
    heights = [*surfaces.values(), none.samples["measured"].to_numpy()]
    limits = min(np.nanmin(z) for z in heights), max(np.nanmax(z) for z in heights)
    with style.journal():
        figure = style.new_figure(style.PAGE, 2.1)
        figure.set_layout_engine("none")  # it leaves half of the paper to 3-D axes
        for k, (title, values) in enumerate(surfaces.items()):
            axes: Any = figure.add_axes(
                (k / 3 + 0.03, 0.05, 0.295, 0.93), projection="3d", computed_zorder=False
            )
            figure.text(k / 3 + 0.01, 0.93, f"({'bcd'[k]}) {title}", fontsize=style.TITLE)
            figure.text(
                k / 3 + 0.02,
                0.8,
                f"elevation ({style.inert(selection.unit, style.LONGEST_UNIT)})",
                fontsize=style.SMALL,
            )
            _surface(axes, values, best.extent, like=best.truth)
            _frame(axes, best.extent, limits)
            if k == 0:
                _points(axes, none.samples[~is_spike], style.INK, 0.9, "samples")
                _points(axes, none.samples[is_spike], OUTLIER, 2.8, "outliers")
                figure.legend(loc="upper left", bbox_to_anchor=(0.19, 1.0), markerscale=2.5,
                              handletextpad=0.0, labelspacing=0.2)  # fmt: skip
        figure.text(0.995, 0.02, f"seed {seed}", fontsize=style.SMALL, ha="right")
        nodes = best.table[["x1", "x2", "truth"]].assign(
            kind="node", without_outliers=best.mean.ravel(), with_outliers=none.mean.ravel()
        )
        points = none.samples[["x1", "x2", "truth", "measured"]].assign(
            kind=np.where(is_spike, "outlier", "sample")
        )
        columns = ["kind", "x1", "x2", "truth", "without_outliers", "with_outliers", "measured"]
        numbers = pd.concat([nodes, points])[columns]
        return style.save(figure, folder, "fig1", numbers)


def _surface(axes: Any, values: style.Floats, extent: style.Extent, like: style.Floats) -> None:
    rows, columns = values.shape
    x, y = np.meshgrid(np.linspace(*extent[:2], columns), np.linspace(*extent[2:], rows))
    colours: Any = style.shaded(values, extent, like)
    axes.plot_surface(x, y, values, facecolors=colours, rstride=1, cstride=1, shade=False,
                      linewidth=0.1, rasterized=True, clip_on=False)  # fmt: skip


def _points(axes: Any, samples: pd.DataFrame, colour: str, size: float, label: str) -> None:
    axes.plot(samples["x1"], samples["x2"], samples["measured"], ".", color=colour, ms=size,
              mew=0, label=label, clip_on=False)  # fmt: skip


def _frame(axes: Any, extent: style.Extent, limits: tuple[float, float]) -> None:
    axes.set(xlim=extent[:2], ylim=extent[2:], zlim=limits)
    axes.set_xlabel("$x_1$ (workspace units)", fontsize=style.SMALL, labelpad=-8)
    axes.set_ylabel("$x_2$ (workspace units)", fontsize=style.SMALL, labelpad=-8)
    sides = np.array([extent[1] - extent[0], extent[3] - extent[2]])
    axes.set_box_aspect((*(sides / sides.max()), 0.6), zoom=1.06)
    axes.view_init(elev=28, azim=-115)
    axes.locator_params(nbins=5)
    axes.tick_params(pad=-4, labelsize=style.TINY)
    axes.tick_params(axis="z", pad=-1)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_linewidth(0.5)
