"""Lines of any methods with bands over seeds, a panel for each outlier share and scope."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from infoplan.analyse.curves import drawable
from infoplan.analyse.statistics import mean_band
from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.method_identity import NEVER_ERRS, PAPERS, Look, looks
from infoplan.wording import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = {
    "a": (0.05, "batch"),
    "b": (0.10, "batch"),
    "c": (0.15, "batch"),
    "d": (0.10, "historical"),
}
"""Share of outliers and the detector's scope of each panel of the paper's Fig. 5."""

SHORT = 12
"""Four methods with names as long share a line of the legend, else two."""


def panels(selection: Selection) -> dict[str, tuple[float, str]]:
    """Share of outliers and scope of each panel: the paper's four, then what else was flown.

    The paper's are left out if all of them would be empty.
    """
    missions = selection.missions
    papers = {rho for rho, _ in PANELS.values()}
    named = dict(PANELS) if papers & set(missions["rho"]) else {}
    judged = missions[~missions["detector"].isin(NEVER_ERRS)]
    there = set(zip(judged["rho"], judged["scope"], strict=True))
    # NONE and BEST are drawn under both scopes: they need a panel only where there is none.
    shown = papers | {rho for rho, _ in there}
    there |= {(rho, "batch") for rho in set(missions["rho"]) - shown}
    for condition in sorted(there - set(PANELS.values())):
        named[_letter(len(named))] = condition
    return named


def panel_numbers(selection: Selection, lines: Callable[[Selection], pd.DataFrame]) -> pd.DataFrame:
    """Sum up the lines of each panel's methods over seeds.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.
    lines
        Given the missions of one run, gives a column for each seed, its index named.

    Returns
    -------
    DataFrame
        One row a point of a line: panel, rho, scope, method, run, the index, n (seeds), mean, low
        and high over them (pointwise 95 % t interval), and ``seed_<k>``, the single seeds (NaN
        where a method lacks one).
    """
    frames = []
    for letter, (rho, scope) in panels(selection).items():
        for method in looks(selection.missions["method"]):
            run = selection.run(method, rho, scope)
            if run is None:
                continue
            seeds = lines(selection.only([run]))
            mean, low, high = mean_band(seeds.to_numpy().T)
            frame = pd.DataFrame({"panel": letter, "rho": rho, "scope": scope, "method": method,
                                  "run": run, seeds.index.name: seeds.index, "n": seeds.shape[1],
                                  "mean": mean, "low": low, "high": high})  # fmt: skip
            frames.append(frame.join(seeds.add_prefix("seed_").reset_index(drop=True)))
    return pd.concat(frames, ignore_index=True)


def draw_panels(
    selection: Selection,
    numbers: pd.DataFrame,
    x: str,
    labels: tuple[str, str],
    *,
    single_seeds: bool = False,
) -> "tuple[Figure, list[Axes]]":
    """Draw the panels of a selection with a legend above.

    Parameters
    ----------
    selection
        As of `panel_numbers`.
    numbers
        What that returns.
    x
        Name of its column along the horizontal axis.
    labels
        Of both axes.
    single_seeds
        Show each seed, too.

    Returns
    -------
    figure : Figure
    axes : list of Axes
        Of the panels, which share both axes.
    """
    shown = panels(selection)
    rows = -(-len(shown) // 2)
    order = looks(numbers["method"])
    longest = max(map(len, order))
    columns = 4 if longest <= SHORT else 2 if longest <= 2 * SHORT else 1
    legend_rows = -(-len(order) // columns)
    height = 3.3 * rows / 2 + 0.12 * (legend_rows - 1)
    figure = style.new_figure(style.COLUMN, height)
    grid = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    for axes, (letter, (rho, scope)) in zip(grid.flat, shown.items(), strict=False):
        share = f"{rho:.2f}" if round(rho, 2) == rho else f"{rho:g}"
        title = f"$\\rho$ = {share}"
        style.panel(axes, letter, title + (", historical" if scope == "historical" else ""))
        here = numbers[numbers["panel"] == letter]
        for method in here["method"].unique():
            line = here[here["method"] == method]
            _draw_method(axes, line, x, numbers["mean"], method, order, single_seeds)
        if here.empty:
            ground = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}  # a diagonal is there
            axes.text(0.5, 0.5, "no runs", ha="center", va="center", transform=axes.transAxes,
                      bbox=ground)  # fmt: skip
        _name_gaps(axes, here, numbers["mean"])
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y")
    for axes in list(grid.flat)[len(shown) :]:
        axes.set_visible(False)
    figure.supxlabel(f"{labels[0]} ({_seeds(numbers)})")
    figure.supylabel(labels[1])
    lines = {line.get_gid(): line for axes in grid.flat for line in axes.get_lines()}
    handles = [lines[method] for method in order if method in lines]
    # The other methods' rows of strokes are longer.
    length = 2.4 if set(order) <= set(PAPERS) else 5.0
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, handlelength=length,
                  columnspacing=1.2, handletextpad=0.5)  # fmt: skip
    return figure, list(grid.flat)[: len(shown)]


def _draw_method(
    axes: "Axes",
    curve: pd.DataFrame,
    x: str,
    usual: "pd.Series[float]",
    method: str,
    order: dict[str, Look],
    single_seeds: bool,
) -> None:
    look = order[method]
    if single_seeds:
        for name in curve.filter(like="seed_"):
            axes.plot(curve[x], drawable(curve[name], usual), color=look.colour, lw=0.3,
                      alpha=0.5)  # fmt: skip
    low, mean, high = (drawable(curve[name], usual) for name in ("low", "mean", "high"))
    axes.fill_between(curve[x], low, high, color=look.colour, alpha=0.2, lw=0)
    axes.plot(curve[x], mean, **style.line(look), label=style.inert(method), gid=method)


def _name_gaps(axes: "Axes", here: pd.DataFrame, usual: "pd.Series[float]") -> None:
    """Say which methods have errors that no axis holds."""
    lost = here["method"][np.isnan(drawable(here["mean"], usual))].unique()
    if len(lost):
        told = "\n".join(f"{style.inert(method)}: not finite in part" for method in lost)
        axes.text(0.98, 0.02, told, ha="right", va="bottom", fontsize=style.TINY,
                  transform=axes.transAxes)  # fmt: skip


def _seeds(numbers: pd.DataFrame) -> str:
    """Say over how many seeds the means are."""
    least, most = int(numbers["n"].min()), int(numbers["n"].max())
    return f"{least} to {most} seeds" if least < most else counted(most, "seed")


def _letter(number: int) -> str:
    """Letter of a panel: a to z, then aa, ab, and so on."""
    first, last = divmod(number, 26)
    return (_letter(first - 1) if first else "") + chr(ord("a") + last)
