"""Specification curves: a claim's effect in every universe, sorted, and the choices below."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.multiverse import ClaimCurve
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.draw import style
from infoplan.palette import GREEN, VERDICTS
from infoplan.study.universes import CHOICES, DEFAULT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

ACROSS = 3
"""Panels beside each other."""

SORTED = "universe, by effect"


def draw_overview(curves: Sequence[ClaimCurve], nearest: Sequence[str], folder: Path) -> list[Path]:
    """Draw the curves of all claims, a panel each; returns the files.

    Marks are universes, coloured and shaped by the verdict on the whole claim; thin lines are
    95 % t intervals of the comparison that binds. Shaded is where the claim says that it lies. A
    ring marks the defaults, a tick below those universes that are nearest to the authors' clip.
    """
    with style.journal():
        rows = -(-len(curves) // ACROSS)
        figure = style.new_figure(style.PAGE, 1.85 * rows + 0.35)
        panels = figure.subplots(rows, ACROSS, squeeze=False)
        for curve, axes in zip(curves, panels.flat, strict=False):
            _draw_curve(axes, curve, nearest)
            title = "\n".join(wrap(f"{curve.name} {curve.text}", 35))
            axes.set_title(title, loc="left", fontsize=style.SMALL)
        for axes in panels.flat[len(curves) :]:
            axes.set_axis_off()
        for axes in panels.flat[max(len(curves) - ACROSS, 0) : len(curves)]:
            axes.set_xlabel(SORTED, fontsize=style.SMALL)
        _legend(figure, nearest)
        return style.save(figure, folder, "multiverse", numbers_of(curves, nearest))


def draw_claim(
    curve: ClaimCurve, multiverse: Multiverse, nearest: Sequence[str], folder: Path
) -> list[Path]:
    """Draw one claim's curve with a row of dots below it for every level; returns the files."""
    labels = [(choice, level) for choice in CHOICES for level in choice.levels]
    with style.journal():
        figure = style.new_figure(style.PAGE, 2.0 + 0.105 * len(labels))
        top, below = figure.subplots(
            2, 1, sharex=True, gridspec_kw={"height_ratios": [2.0, 0.105 * len(labels)]}
        )
        order = _draw_curve(top, curve, nearest)
        top.set_title(f"{curve.name}: {curve.text}", loc="left")
        levels = {one.name: one.levels for one in multiverse.universes}
        for row, (choice, level) in enumerate(labels):
            has = np.array(
                [levels[curve.universes[place]][choice.name] == level for place in order]
            )
            for verdict in VERDICTS:
                at = np.flatnonzero(has & _are(curve, order, verdict))
                below.scatter(at, np.full(len(at), row), **_mark(verdict))
            if level == choice.default and row:
                below.axhline(row - 0.5, color=style.GRID, lw=0.4, zorder=0)
        below.set_yticks(range(len(labels)), [
            f"{choice.name if level == choice.default else ''}  {level}" for choice, level in labels
        ], fontsize=style.TINY)  # fmt: skip
        below.set(ylim=(len(labels) - 0.5, -0.5), xlabel=SORTED)
        below.tick_params(axis="y", length=0)
        _legend(figure, nearest)
        name = f"multiverse_{curve.name.lower()}"
        return style.save(figure, folder, name, numbers_of([curve], nearest))


def draw_effects(shares: pd.DataFrame, p: pd.DataFrame, folder: Path) -> list[Path]:
    """Draw which choices move which claims, as a heat map; returns the files.

    Parameters
    ----------
    shares
        Part of a claim's variance over joint universes that only a choice explains, claims x
        choices.
    p
        As of `effects_jointly`, adjusted by Holm.
    folder
        Where to.
    """
    with style.journal():
        figure = style.new_figure(style.PAGE, 0.23 * len(shares) + 1.2)
        axes = figure.add_subplot()
        values, sure = shares.to_numpy(dtype=float), p.to_numpy(dtype=float) <= 0.05
        image = axes.imshow(100 * values, cmap="YlGnBu", vmin=0, vmax=max(100 * values.max(), 1),
                            aspect="auto")  # fmt: skip
        for row, column in np.ndindex(values.shape):
            value, bold = 100 * float(values[row, column]), bool(sure[row, column])
            if value >= 0.5:
                colour = style.rgba(image, value)
                axes.text(column, row, f"{value:.0f}", ha="center", va="center",
                          color=style.ink_on(colour), weight="bold" if bold else "normal",
                          fontsize=style.SMALL)  # fmt: skip
        axes.set_yticks(range(len(shares)), list(shares.index))
        axes.set_xticks(range(len(shares.columns)), list(shares.columns), rotation=40, ha="left",
                        rotation_mode="anchor")  # fmt: skip
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        bar = figure.colorbar(image, ax=axes, pad=0.01, fraction=0.03, ticks=whole_numbers())
        bar.set_label("% of the variance; bold: p ≤ 0.05")
        return style.save(figure, folder, "multiverse_choices", shares.reset_index(names="claim"))


def whole_numbers() -> "MaxNLocator":
    """Make ticks at whole numbers, a few."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(6, integer=True)


def numbers_of(curves: Sequence[ClaimCurve], nearest: Sequence[str]) -> pd.DataFrame:
    """List what curves show: a row a claim and universe."""
    rows = []
    for curve in curves:
        for place, universe in enumerate(curve.universes):
            effect = curve.interval(place)
            rows.append(
                {"claim": curve.name, "compared": curve.what, "unit": curve.unit,
                 "universe": universe, "mean": effect.mean, "low": effect.low, "high": effect.high,
                 "seeds": effect.n, "verdict": curve.verdicts[place],
                 "near_the_clip": universe in nearest}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _draw_curve(axes: "Axes", curve: ClaimCurve, nearest: Sequence[str]) -> NDArray[np.int64]:
    """Draw a curve, and return the places of its universes in the order drawn."""
    order = np.argsort(curve.means, kind="stable")
    at = np.arange(len(order))
    found = [curve.interval(int(place)) for place in order]
    means = np.array([one.mean for one in found])
    low, high = (np.array([getattr(one, end) for one in found]) for end in ("low", "high"))
    # A few universes have intervals that would leave the others no room.
    bottom, top = _frame(means, low, high)
    axes.axhspan(max(curve.stated.low, bottom), min(curve.stated.high, top), color=GREEN,
                 alpha=0.1, lw=0)  # fmt: skip
    axes.axhline(0, color=style.FAINT, lw=0.5)
    for verdict, mark in VERDICTS.items():
        chosen = _are(curve, order, verdict)
        axes.vlines(at[chosen], low[chosen], high[chosen], color=mark.colour, lw=0.5, alpha=0.6)
        axes.scatter(at[chosen], means[chosen], **_mark(verdict), zorder=3)
    names = [curve.universes[place] for place in order]
    if DEFAULT in names:
        place = names.index(DEFAULT)
        axes.scatter([place], [means[place]], s=22, facecolors="none", edgecolors=style.INK, lw=0.8,
                     zorder=4)  # fmt: skip
    near = [place for place, name in enumerate(names) if name in nearest]
    axes.scatter(near, np.full(len(near), bottom), marker="|", s=14, color=style.INK, lw=0.7,
                 clip_on=False, zorder=5)  # fmt: skip
    axes.set(xlim=(-1, len(order)), ylim=(bottom, top))
    axes.xaxis.set_major_locator(whole_numbers())
    unit = f" ({curve.unit})" if curve.unit else ""
    axes.set_ylabel(f"{_broken(curve.what)}{unit}", fontsize=style.TINY)
    return order


def _are(curve: ClaimCurve, order: NDArray[np.int64], verdict: str) -> NDArray[np.bool_]:
    """Say of the universes, in that order, whether they have a verdict."""
    return np.array([curve.verdicts[place] == verdict for place in order])


def _mark(verdict: str) -> dict[str, Any]:
    """Give colour, shape and size of a verdict's marks as Matplotlib's arguments."""
    mark = VERDICTS[verdict]
    # A cross is nothing but its line.
    return {"color": mark.colour, "marker": mark.marker, "s": 6, "lw": 0.6 * (mark.marker == "x")}


def _frame(means: NDArray[np.float64], *ends: NDArray[np.float64]) -> tuple[float, float]:
    """Lowest and highest value that is shown: of all means, and of nine tenths of the ends."""
    known = np.concatenate([end[np.isfinite(end)] for end in ends])
    low, high = np.quantile(known, [0.05, 0.95]) if len(known) else (means.min(), means.max())
    low, high = min(low, means.min()), max(high, means.max())
    room = 0.08 * (high - low) or 1.0
    return float(low - room), float(high + room)


def _broken(what: str) -> str:
    """Put the methods and the number that is compared on lines of their own."""
    methods, _, number = what.partition(": ")
    return f"{methods}\n{number}"


def _legend(figure: "Figure", nearest: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker=mark.marker, ms=3, lw=0, color=mark.colour, label=verdict)
        for verdict, mark in VERDICTS.items()
    ]
    handles += [
        Line2D([], [], marker="o", ms=5, lw=0, mfc="none", mec=style.INK, label="defaults"),
    ]
    if nearest:
        near = Line2D([], [], marker="|", ms=5, lw=0, color=style.INK, label="nearest to the clip")
        handles.append(near)
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
