"""The figure ``explain``: from BEST's error to a method's, part by part."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.error_sources import ErrorSources
from infoplan.analyse.statistics import mean_interval
from infoplan.draw import style
from infoplan.palette import ERROR_PARTS
from infoplan.wording import counted, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS = ("best_itself", "places", "lost", "spikes", "learning")
"""Parts in the order in which they are stacked: what went wrong last stands on top."""

LABELS = {
    "best_itself": "BEST itself", "places": "places", "lost": "clean lost",
    "spikes": "spikes", "learning": "learning",
}  # fmt: skip

BESIDE = 4
"""So many methods stand side by side."""

HALF = 0.36
"""Half of the width of a bar."""


def draw(sources: Sequence[ErrorSources], folder: Path) -> list[Path]:
    """Draw the parts of each run's gap as steps from BEST's error up to its own.

    A bar a part, from where the parts before it end; its 95 % t interval over seeds, and a dot a
    seed, stand at its end. Parts below zero go down.

    Parameters
    ----------
    sources
        At least one.
    folder
        Where the files go.

    Returns
    -------
    list of Path
        PNG, PDF and CSV.
    """
    ordered = sorted(sources, key=lambda one: (one.scope, one.rho, one.method))
    beside = min(len(ordered), BESIDE)
    rows = -(-len(ordered) // beside)
    with style.journal():
        width = min(style.PAGE, max(1.75 * beside + 0.4, style.COLUMN))
        picture = style.new_figure(width, 2.3 * rows)
        grid = picture.subplots(rows, beside, sharey=True, squeeze=False)
        for axes, one in zip(grid.flat, ordered, strict=False):
            _draw_steps(axes, one)
        for axes in list(grid.flat)[len(ordered) :]:
            axes.set_visible(False)
        units = " or ".join(dict.fromkeys(style.inert(one.unit, style.LONGEST_UNIT)
                                          for one in ordered))  # fmt: skip
        picture.supylabel(f"final RMSE ({units})")
        return style.save(picture, folder, "explain", plotted_numbers(ordered))


def plotted_numbers(sources: Sequence[ErrorSources]) -> pd.DataFrame:
    """Return what the figure shows.

    Returns
    -------
    DataFrame
        A row a bar: run, method, rho, scope, part (``best_rmse`` and ``rmse``, the errors at both
        ends, and each part), n, start (where it begins), mean, low, high, and ``seed_<k>``.
    """
    rows = []
    for one in sources:
        start = 0.0
        for part in ("best_rmse", *STEPS, "rmse"):
            mean = mean_interval(one.table[part])
            begun = 0.0 if part in ("best_rmse", "rmse") else start
            rows.append(
                {"run": one.run, "method": one.method, "rho": one.rho, "scope": one.scope,
                 "part": part, "n": mean.n, "start": begun, "mean": mean.mean, "low": mean.low,
                 "high": mean.high}
                | {f"seed_{seed}": value
                   for seed, value in zip(one.table["seed"], one.table[part], strict=True)}
            )  # fmt: skip
            start = begun + mean.mean
    return pd.DataFrame(rows)


def _draw_steps(axes: "Axes", one: ErrorSources) -> None:
    numbers = plotted_numbers([one])
    places = np.linspace(-0.16, 0.16, len(one.table)) if len(one.table) > 1 else np.zeros(1)
    for place, bar in enumerate(numbers.to_dict("records")):
        part, end = bar["part"], bar["start"] + bar["mean"]
        colour = ERROR_PARTS.get(part, style.DARK)
        axes.bar(place, bar["mean"], 2 * HALF, bottom=bar["start"], color=colour, lw=0)
        values = bar["start"] + one.table[part].to_numpy()
        axes.plot(place + places, values, "o", ms=2.0, mfc="white", mec=style.INK, mew=0.4,
                  zorder=3)  # fmt: skip
        if np.isfinite(bar["low"]):
            axes.plot([place] * 2, [bar["start"] + bar["low"], bar["start"] + bar["high"]],
                      color=style.INK, lw=0.9, zorder=2)  # fmt: skip
        if place + 1 < len(numbers):
            axes.plot([place + HALF, place + 1 - HALF], [end, end], color=style.FAINT, lw=0.5)
    _name_numbers(axes, numbers, one)
    names = ["BEST", *(LABELS[part] for part in STEPS), style.inert(one.method, 20)]
    axes.set_xticks(range(len(names)), names, fontsize=style.SMALL, rotation=45, ha="right",
                    rotation_mode="anchor")  # fmt: skip
    axes.axhline(0.0, color=style.INK, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y")
    axes.set_axisbelow(True)
    scope = ", historical" if one.scope == "historical" else ""
    seeds = counted(len(one.table), "seed")
    axes.set_title(
        f"{style.inert(one.method, 20)}\n$\\rho$ = {one.rho:g}{scope}, {seeds}", loc="left",
        fontsize=style.LABEL,
    )  # fmt: skip


def _name_numbers(axes: "Axes", numbers: pd.DataFrame, one: ErrorSources) -> None:
    """Write each mean above all that is drawn of it."""
    for place, bar in enumerate(numbers.to_dict("records")):
        tops = [bar["start"], bar["start"] + bar["mean"], bar["start"] + bar["high"],
                *(bar["start"] + one.table[bar["part"]])]  # fmt: skip
        axes.annotate(figure(bar["mean"]), (place, np.nanmax(tops)), (0, 2),
                      textcoords="offset points", ha="center", fontsize=style.TINY)  # fmt: skip
    axes.margins(y=0.08)
