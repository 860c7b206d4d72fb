"""Fig. 5: RMSE against the number of samples, four methods, mean over seeds with a band."""

from pathlib import Path

import pandas as pd

from infoplan.analyse.claims import METHODS
from infoplan.analyse.curves import on_common_axis
from infoplan.analyse.statistics import bootstrap_band
from infoplan.analyse.tables import Selection, load_curves
from infoplan.draw import style

PANELS = {
    "a": (0.05, "batch"),
    "b": (0.10, "batch"),
    "c": (0.15, "batch"),
    "d": (0.10, "historical"),
}
"""Share of outliers and the detector's scope of each panel."""

NEEDS = tuple(
    dict.fromkeys(
        (method, rho, scope if method.endswith("COPOD") else "batch")
        for rho, scope in PANELS.values()
        for method in METHODS
    )
)


def draw(selection: Selection, folder: Path, *, single_seeds: bool = False) -> list[Path]:
    """Draw Fig. 5 from the runs that are there; returns its files.

    A method's band is the pointwise 95 % percentile bootstrap interval of the mean over whole
    seeds; a single seed has none.
    """
    numbers = plotted_numbers(selection)
    with style.journal():
        figure = style.new_figure(style.COLUMN, 3.3)
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        for axes, (letter, (rho, scope)) in zip(grid.flat, PANELS.items(), strict=True):
            title = f"$\\rho$ = {rho:.2f}" + (", historical" if scope == "historical" else "")
            style.panel(axes, letter, title)
            here = numbers[numbers["panel"] == letter]
            for method in here["method"].unique():
                curve = here[here["method"] == method]
                colour, dashes = style.COLOURS[method], style.DASHES[method]
                if single_seeds:
                    for name in curve.filter(like="seed_"):
                        axes.plot(curve["collected"], curve[name], color=colour, lw=0.3, alpha=0.5)
                axes.fill_between(
                    curve["collected"], curve["low"], curve["high"], color=colour, alpha=0.2, lw=0
                )
                axes.plot(curve["collected"], curve["mean"], color=colour, ls=dashes, label=method)
            if here.empty:
                axes.text(0.5, 0.5, "no runs", ha="center", va="center", transform=axes.transAxes)
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(axis="y")
        grid[0, 0].set_ylim(bottom=0)
        grid[0, 0].set_xlim(0, selection.budget)
        figure.supxlabel("collected samples", fontsize=7)
        figure.supylabel(f"RMSE ({selection.unit})", fontsize=7)
        lines = {line.get_label(): line for axes in grid.flat for line in axes.get_lines()}
        handles = [lines[method] for method in METHODS if method in lines]
        figure.legend(handles=handles, loc="outside upper center", ncols=4, handlelength=2.4,
                      columnspacing=1.2, handletextpad=0.5)  # fmt: skip
        return style.save(figure, folder, "fig5", numbers)


def plotted_numbers(selection: Selection) -> pd.DataFrame:
    """Return what the figure shows.

    Returns
    -------
    DataFrame
        One row a point of a curve: panel, rho, scope, method, collected, n (seeds), mean, low and
        high over them, and ``seed_<k>``, the single seeds (NaN where a method lacks one).
    """
    frames = []
    for letter, (rho, scope) in PANELS.items():
        for method in METHODS:
            run = selection.run(method, rho, scope)
            if run is None:
                continue
            curves = on_common_axis(load_curves(selection.only([run]))).droplevel("run", axis=1)
            mean, low, high = bootstrap_band(curves.to_numpy().T)
            frame = pd.DataFrame({"panel": letter, "rho": rho, "scope": scope, "method": method,
                                  "collected": curves.index, "n": curves.shape[1],
                                  "mean": mean, "low": low, "high": high})  # fmt: skip
            frames.append(frame.join(curves.add_prefix("seed_").reset_index(drop=True)))
    return pd.concat(frames, ignore_index=True)
