"""The pictures of an animation: where the robot is, what it believes, and how wrong it is."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.curves import drawable
from infoplan.draw import style
from infoplan.draw.moving_files import Picture
from infoplan.draw.recording import Recording
from infoplan.method_identity import Look, looks
from infoplan.palette import MARKS, RIM
from infoplan.scoring import State
from infoplan.wording import figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

Floats = NDArray[np.float64]


HEADLINE, ROOM = 9.5, 85
"""Size of the headline, points, and how many characters of that size it has room for."""

WIDTH, HEIGHT, DPI = 960, 640, 100
"""Size of a picture in pixels, both even as video wants them."""


def draw_pictures(states: Sequence[State], recording: Recording) -> Iterator[Picture]:
    """Draw one picture a state.

    Parameters
    ----------
    states
        In order; all of them fix the colour scales.
    recording
        The mission they belong to.

    Yields
    ------
    ndarray of uint8, shape (HEIGHT, WIDTH, 3)
        Red, green, blue.
    """
    with style.journal():
        scene = Scene(states, recording)
    for state in states:
        with style.journal():
            yield scene.draw(state)


class Scene:
    """The picture of a state: axes that stay, and artists whose data change.

    Parameters
    ----------
    states
        All that will be drawn: they fix the colour scales.
    recording
        The mission they belong to.
    """

    def __init__(self, states: Sequence[State], recording: Recording):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.colors import LogNorm, PowerNorm
        from matplotlib.figure import Figure

        config, truth = recording.config, recording.truth
        self.surveyed = recording.surveyed
        if self.surveyed:  # what is believed at the end stands for what nobody knows
            truth = states[-1].maps.mean.reshape(truth.shape)
        xmin, xmax, ymin, ymax = config.terrain.extent
        self.extent = (xmin, xmax, ymin, ymax)
        self.budget, self.truth = config.budget, truth
        self.unit = style.inert(config.terrain.unit or "", style.LONGEST_UNIT)
        self.figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
        self.canvas = FigureCanvasAgg(self.figure)
        flown = "" if self.surveyed else f"ρ = {config.rho:g}, "
        title = (
            f"{style.inert(recording.method)} on {style.inert(config.terrain.name)}, "
            f"{flown}{config.detector.scope} scope, seed {recording.seed}"
        )
        headline = self._say(14, title, weight="bold")
        # A long name must not run into the clock.
        headline.set_fontsize(min(HEADLINE, HEADLINE * ROOM / len(title)))
        self.clock = self._say(WIDTH - 14, "", ha="right")
        self.obstacles = config.terrain.obstacles
        self._draw_path_panel()
        # Few nodes must not take the colours from all others.
        deviation = _range([state.maps.std for state in states], 0.02, 0.98)
        _, error = _range([self._errors_of(state) for state in states], 0.0, 0.98)
        density = max(float(state.maps.outlier_density.max()) for state in states)
        self.mean = self._panel(0, 0, "mean", style.ELEVATION, truth.min(), truth.max())
        self.std = self._panel(0, 1, "standard deviation", style.DEVIATION, *deviation)
        self.error = self._panel(1, 0, self._error_words(), style.ERROR, 0, error)
        # It falls by orders of magnitude: steps of the same ratio have the same colours.
        least = max(deviation[0], 1e-3 * deviation[1])
        self.std.set_norm(LogNorm(least, deviation[1]))
        steps = np.geomspace(least, deviation[1], 5).tolist()
        bar: Any = self.std.colorbar
        bar.set_ticks(steps, labels=[figure(step) for step in steps])
        bar.minorticks_off()
        # With nothing flagged, any scale will do.
        self.density = self._panel(1, 1, "outlier density", style.DENSITY, 0, density or 1.0)
        # A few places hold most flags: the root lets the others be seen.
        self.density.set_norm(PowerNorm(0.5, 0, density or 1.0))
        curve = recording.curve.assign(rmse=recording.errors)
        self._draw_curve_panel(curve, looks([recording.method])[recording.method])

    def draw(self, state: State) -> Picture:
        """Draw a state; returns red, green, blue, shape (HEIGHT, WIDTH, 3)."""
        row, samples, maps = state.row, state.samples, state.maps
        self.clock.set_text(f"{row.collected} of {self.budget} samples, epoch {row.epoch}")
        self.path.set_data(samples.x[:, 0], samples.x[:, 1])
        newest = samples[samples.epoch == row.epoch]
        self.newest.set_data(newest.x[:, 0], newest.x[:, 1])
        self.robot.set_data(samples.x[-1:, 0], samples.x[-1:, 1])
        flagged, outlier = samples.flagged, samples.is_outlier | self.surveyed & samples.flagged
        for marks, chosen in (
            (self.caught, flagged & outlier),
            (self.missed, ~flagged & outlier),
            (self.false_alarms, flagged & ~outlier),
        ):
            marks.set_data(samples.x[chosen, 0], samples.x[chosen, 1])
        for image, values in (
            (self.mean, maps.mean),
            (self.std, maps.std),
            (self.error, self._errors_of(state)),
            (self.density, maps.outlier_density),
        ):
            image.set_data(drawable(values.reshape(self.truth.shape), self.truth))
        if not self.surveyed:
            told = f"absolute error, RMSE {figure(row.rmse)} {self.unit}"
            self.error.axes.set_title(told.rstrip(), loc="left")
        so_far = self.stored["collected"] <= row.collected
        self.curve.set_data(self.stored["collected"][so_far], self.errors[so_far])
        now = self.stored["epoch"] == row.epoch
        error = row.rmse if not self.surveyed else float(self.stored["rmse"][now].iloc[0])
        self.point.set_data([row.collected], drawable([error], self.stored["rmse"]))
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()

    def _draw_path_panel(self) -> None:
        axes = self._axes(36, 186, 396, 396)
        style.show_relief(axes, self.truth, self.extent)
        style.show_obstacles(axes, self.obstacles)
        axes.set(xlabel="", ylabel="")
        ground = "mean at the end" if self.surveyed else "ground truth"
        axes.set_title(f"{ground}, path and samples", loc="left")
        (self.path,) = axes.plot([], [], color="white", lw=0.8, alpha=0.75)
        (self.newest,) = axes.plot([], [], ".-", color="white", lw=1.4, ms=3.5)
        self.missed = self._mark(axes, "missed", "outlier missed")
        told = ("flagged", "flagged") if self.surveyed else ("caught", "outlier caught")
        self.caught = self._mark(axes, *told)
        self.false_alarms = self._mark(axes, "false-alarm", "false alarm")
        marks = [self.caught, self.missed, self.false_alarms]
        (self.robot,) = axes.plot([], [], "D", color=style.INK, mec="white", label="robot")
        shown = [self.caught] if self.surveyed else marks
        axes.legend(
            handles=[*shown, self.robot], ncols=4, loc="upper left", bbox_to_anchor=(0, -0.05),
            borderaxespad=0, handletextpad=0.2, columnspacing=1.2,
        )  # fmt: skip

    def _mark(self, axes: "Axes", name: str, label: str) -> "Line2D":
        """Make the marks of a kind, as yet of no samples."""
        mark = MARKS[name]
        (line,) = axes.plot([], [], mark.marker, color=mark.colour, label=label)
        line.set(markersize=5.5, markeredgecolor=RIM, markeredgewidth=0.6)
        return line

    def _errors_of(self, state: State) -> Floats:
        """Absolute error at the nodes; of a survey, the change of the mean until the end."""
        maps = state.maps
        return np.abs(maps.mean - (self.truth.ravel() if self.surveyed else maps.truth))

    def _error_words(self) -> str:
        return "mean less that of the end" if self.surveyed else "absolute error"

    def _panel(
        self, row: int, column: int, title: str, cmap: str, vmin: float, vmax: float
    ) -> "AxesImage":
        """Draw a small map with its colour bar; row 0 is the upper one."""
        from matplotlib.ticker import FuncFormatter

        left, bottom, side = 482 + 240 * column, 402 - 216 * row, 180
        axes = self._axes(left, bottom, side, side)
        image = style.show_map(axes, self.truth, self.extent, cmap=cmap, vmin=vmin, vmax=vmax)
        style.show_obstacles(axes, self.obstacles)
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
        axes.set_title(title, loc="left")
        bar = self.figure.colorbar(image, cax=self._axes(left + side + 6, bottom, 8, side))
        bar.outline.set_linewidth(0.6)
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        return axes.images[0]

    def _draw_curve_panel(self, curve: pd.DataFrame, look: Look) -> None:
        self.stored, self.errors = curve, drawable(curve["rmse"], curve["rmse"])
        axes = self._axes(54, 42, 878, 84)
        axes.plot(curve["collected"], self.errors, color=look.colour, alpha=0.3)
        (self.curve,) = axes.plot([], [], color=look.colour, lw=1.6)
        (self.point,) = axes.plot([], [], "o", color=look.colour, ms=5, clip_on=False)
        axes.set(xlim=(0, self.budget), ylim=(0, None), xlabel="samples collected",
                 ylabel=f"{'CV ' * self.surveyed}RMSE ({self.unit})")  # fmt: skip
        axes.spines[["top", "right"]].set_visible(False)

    def _axes(self, left: float, bottom: float, width: float, height: float) -> "Axes":
        """Axes at a place given in pixels."""
        return self.figure.add_axes((left / WIDTH, bottom / HEIGHT, width / WIDTH, height / HEIGHT))

    def _say(self, left: float, text: str, **look: Any) -> "Text":
        """Write into the headline, so many pixels from the left."""
        return self.figure.text(left / WIDTH, 1 - 24 / HEIGHT, text, size=HEADLINE, **look)


def _range(maps: Sequence[Floats], low: float, high: float) -> tuple[float, float]:
    """Two quantiles of some maps' values, apart from each other; NaN is left out."""
    values = np.concatenate([values[np.isfinite(values)] for values in maps])
    if not len(values):
        return 0.0, 1.0
    first, last = (float(np.quantile(values, share)) for share in (low, high))
    return first, last if last > first else first + (abs(first) or 1.0)
