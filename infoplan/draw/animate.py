"""One mission as an animation: where it drove, what it believed, and how wrong it was."""

import shutil
import subprocess
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from infoplan.analyse.curves import drawable
from infoplan.analyse.relief import on_grid
from infoplan.analyse.tables import find_missions, stored_options
from infoplan.config import MissionConfig, validate
from infoplan.draw import style
from infoplan.errors import RunError, UsageError
from infoplan.extent import checked_extent
from infoplan.method_identity import Look, looks, method_of
from infoplan.plan import count_flags, smooth
from infoplan.scoring import CurveRow, Maps, State
from infoplan.study.replayed import as_samples, explore_again, stand_in
from infoplan.study.run_names import find_run, stored_runs
from infoplan.study.store import list_missions, read_footer, read_table, table_path
from infoplan.text_options import as_command
from infoplan.trust import admit
from infoplan.wording import figure

if TYPE_CHECKING:
    import PIL.Image
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.text import Text

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Item = TypeVar("Item")

FORMATS = ("gif", "mp4")
MAX_FPS = 50
"""Browsers show no more pictures of a GIF a second."""
MAX_FRAMES = 60
"""A mission of more epochs skips some, so that the file stays small."""
HOLD_SECONDS = 3.0
"""How long the last picture stands."""
COLOURS = 255
"""Colours of a GIF."""
LINE_SECONDS = 5.0
"""Without a terminal, lines about the progress come this often."""
SAME_RMSE = 1e-6
"""Relative difference up to which a recomputed RMSE is the stored one: rounding of other BLAS."""
HEADLINE, ROOM = 9.5, 85
"""Size of the headline, points, and how many characters of that size it has room for."""
WIDTH, HEIGHT, DPI = 960, 640, 100
"""Size of a picture in pixels, both even as video wants them."""


@dataclass(frozen=True)
class Recording:
    """A stored mission.

    Attributes
    ----------
    run, seed
        Which.
    method
        Its name, as in all drawings.
    config
        Its configuration.
    science
        The same as it is stored.
    samples, curve, maps
        Its tables, one row a sample, an epoch, a node of the query grid.
    truth
        Elevation at the nodes of the query grid, shape ``config.grid``, terrain's unit.
    """

    run: str
    seed: int
    method: str
    config: MissionConfig
    science: dict[str, Any]
    samples: pd.DataFrame
    curve: pd.DataFrame
    maps: pd.DataFrame
    truth: Floats


def animate(
    results_dir: Path,
    console: Console,
    *,
    run: str | None = None,
    seed: int = 0,
    file_format: str = "gif",
    fps: float = 4,
    trust: bool = False,
    named: Mapping[str, str | None] | None = None,
) -> Path:
    """Draw a stored mission as an animation, a picture an epoch.

    The maps between are recomputed from the samples. A detector or model of the user's is imported
    for that only if the caller trusts it; without it the maps of the end are shown, the last that
    the tables hold. A planner is never needed.

    Parameters
    ----------
    results_dir
        The folder of the tables; the animation lands in its ``figures``.
    console
        Where progress and warnings go.
    run
        Name of the run; None: the one that `choose_run` finds.
    seed
        Which of its missions.
    file_format
        ``gif`` or ``mp4``.
    fps
        Pictures a second, above 0 and at most 50.
    trust
        Whether a detector's or model's function that the stored run names may be imported; else
        those maps alone are drawn that the tables hold.
    named
        Functions that the command line itself names, by group, as ``{"detector": "mine.jumps"}``;
        those of the run may be imported.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    UsageError
        If the mission is not stored, an option is wrong, or ffmpeg is needed and not there.
    RunError
        If a table cannot be read or the file cannot be written.
    """
    if file_format not in FORMATS:
        raise UsageError(f"format={file_format} is not a choice: use {' or '.join(FORMATS)}")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps <= MAX_FPS:
        raise UsageError(f"fps={fps} must be a number above 0 and at most {MAX_FPS}")
    write: Callable[[Sequence[Picture], Path, float], None] = write_gif
    if file_format == "mp4":
        write = write_mp4
        find_ffmpeg()
    recording = read_recording(results_dir, choose_run(results_dir, run), seed)
    states = list(_states(recording, named or {}, trust, console))
    states = thinned(states, MAX_FRAMES)
    pictures = list(
        _tracked(draw_pictures(states, recording), len(states), "drawing pictures", console)
    )
    path = results_dir / "figures" / f"{recording.run}-seed{seed}.{file_format}"
    unfinished = path.with_name(f".{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(pictures, unfinished, fps)
        unfinished.replace(path)
    except OSError as error:
        raise RunError(
            f"{path} could not be written ({error.strerror or error}): make room, or check that "
            "you may write there"
        ) from error
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
    return path


def choose_run(results_dir: Path, run: str | None) -> str:
    """Find the run to animate.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    run
        A stored run, as `find_run` takes it; None: the only run, else the paper's own method
        (PUCT-COPOD at rho 0.1 and scope batch), if only one run is such.

    Raises
    ------
    UsageError
        If it is not stored, or several could be meant.
    """
    stored = stored_runs(results_dir)
    if not stored:
        raise UsageError(
            f"results_dir={results_dir} holds no finished mission to animate: fly one with "
            f"{as_command('infoplan run', results_dir)}, or name the folder that holds curves/"
        )
    if run is None:
        paper = [name for name in stored if _is_papers_own(results_dir, name)]
        candidates = stored if len(stored) == 1 else paper
        if len(candidates) != 1:
            raise UsageError(
                f"results_dir={results_dir} holds several runs: say which with "
                f"run={' or run='.join(candidates or stored)}"
            )
        return candidates[0]
    return find_run(results_dir, run)


def read_recording(results_dir: Path, run: str, seed: int) -> Recording:
    """Read a stored mission.

    Raises
    ------
    UsageError
        If it is not stored, or by another schema version.
    RunError
        If a table cannot be read.
    """
    missions = find_missions(results_dir, run=run, seed=seed).missions
    footer = read_footer(table_path(results_dir, "curves", run, seed))
    curve, samples, maps = (
        read_table(results_dir, name, run, seed).to_pandas()
        for name in ("curves", "samples", "maps")
    )
    truth = on_grid(maps, "truth")
    if truth.shape != tuple(footer.config.grid):
        raise RunError(
            f"the map of {run} seed {seed} has {truth.shape[0]} x {truth.shape[1]} nodes, not the "
            f"{footer.config.grid} of its configuration: run it again"
        )
    method = str(missions["method"].iloc[0])
    return Recording(
        run, seed, method, footer.config, footer.configuration, samples, curve, maps, truth
    )


def cannot_replay(config: MissionConfig, trust: bool, given: Collection[str] = ()) -> str:
    """Say why the states of a mission are not recomputed; empty if they are.

    Parameters
    ----------
    config
        The mission's.
    trust
        Whether functions that it names may be imported.
    given
        Groups whose function the command line itself names.
    """
    own = [getattr(config, group) for group in ("detector", "model") if group not in given]
    named = [options.function for options in own if getattr(options, "function", None)]
    if named and not trust:
        return (
            f"nothing of a results folder is imported, such as {' and '.join(named)}, "
            "without trust=true"
        )
    try:
        # Of the stored terrain no file is known, which a terrain that is to be loaded needs.
        terrain = replace(MissionConfig().terrain, extent=config.terrain.extent)
        validate(replace(config, terrain=terrain, planner=stand_in(config)))
    except UsageError as error:
        return f"its configuration is none that could be flown: {error}"
    return ""


def from_tables(recording: Recording) -> Iterator[State]:
    """Give the states that the tables tell: the maps are those of the end, and of no epoch before.

    Samples are shown as they were judged at the end.

    Yields
    ------
    State
        After the pilot and after each epoch.
    """
    config, table = recording.config, as_samples(recording.samples)
    extent, maps = checked_extent(config.terrain.extent), recording.maps
    x, truth, *believed = (
        maps[name].to_numpy() for name in (["x1", "x2"], "truth", "mean", "std", "outlier_density")
    )
    last, unknown = Maps(x, truth, *believed), np.full(len(truth), np.nan)
    columns = [item.name for item in fields(CurveRow)]
    rows = [
        dict(zip(columns, row, strict=True)) for row in recording.curve[columns].to_numpy(object)
    ]
    for epoch, row in enumerate(rows):
        samples = table[table.epoch <= epoch]
        if epoch < len(rows) - 1:
            flags = count_flags(samples.x[samples.flagged], extent, recording.truth.shape)
            density = smooth(flags, config.planner.smoothing, extent).ravel()
            known = replace(last, mean=unknown, std=unknown, outlier_density=density)
        else:
            known = last
        yield State(CurveRow(**row), samples, known)


def replay(recording: Recording) -> Iterator[State]:
    """Recompute the state after every epoch by teaching a belief the mission's own samples.

    Yields
    ------
    State
        After the pilot and after each epoch.
    """
    return explore_again(recording.config, recording.seed, recording.samples, recording.maps)


def difference_from_curve(states: Sequence[State], recording: Recording) -> str:
    """Say how the recomputed RMSE differs from the stored curve; empty if it does not."""
    stored = recording.curve["rmse"].to_numpy()
    recomputed = np.array([state.row.rmse for state in states])
    same = np.isclose(recomputed, stored, rtol=SAME_RMSE, atol=0.0, equal_nan=True)
    if same.all():
        return ""
    with np.errstate(invalid="ignore"):
        epoch = int(np.argmax(np.where(same, -1.0, np.nan_to_num(np.abs(recomputed - stored)))))
    return (
        f"the recomputed RMSE of {recording.run} seed {recording.seed} is not the stored one "
        f"({recomputed[epoch]:.4g} instead of {stored[epoch]:.4g} after epoch {epoch}), as with "
        "another version of the code: the animation shows the recomputed mission"
    )


def thinned(states: Sequence[State], most: int) -> list[State]:
    """Keep at most so many states, evenly spread, the first and the last among them."""
    chosen = np.unique(np.linspace(0, len(states) - 1, min(most, len(states))).round().astype(int))
    return [states[i] for i in chosen]


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
        scene = _Scene(states, recording)
    for state in states:
        with style.journal():
            yield scene.draw(state)


def write_gif(pictures: Sequence[Picture], path: Path, fps: float) -> None:
    """Write an endless GIF whose last picture stands for a while."""
    import PIL.Image

    # One palette for all pictures: only what changes between two is stored.
    palette = _palette(np.concatenate([pictures[0], pictures[len(pictures) // 2], pictures[-1]]))
    frames = [
        PIL.Image.fromarray(picture).quantize(palette=palette, dither=PIL.Image.Dither.NONE)
        for picture in pictures
    ]
    milliseconds = [round(1000 / fps)] * len(frames)
    milliseconds[-1] = max(milliseconds[-1], round(1000 * HOLD_SECONDS))
    frames[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=milliseconds,
        loop=0,
        optimize=True,
    )


def write_mp4(pictures: Sequence[Picture], path: Path, fps: float) -> None:
    """Write an H.264 video by ffmpeg, the last picture standing for a while.

    Raises
    ------
    RunError
        If ffmpeg fails.
    """
    height, width = pictures[0].shape[:2]
    held = [*pictures, *[pictures[-1]] * round(HOLD_SECONDS * fps)]
    raw = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {fps:g} -i -"
    coded = "-r 25 -c:v libx264 -crf 20 -pix_fmt yuv420p -movflags +faststart -f mp4"
    command = [find_ffmpeg(), "-y", "-loglevel", "error", *raw.split(), *coded.split(), str(path)]
    done = subprocess.run(
        command, input=b"".join(picture.tobytes() for picture in held), capture_output=True
    )
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["it does not say why"]
        raise RunError(f"ffmpeg could not write {path} ({words[-1]}): use format=gif instead")


def find_ffmpeg() -> str:
    """Path of ffmpeg.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise UsageError(
            "format=mp4 needs ffmpeg, which is not on the path: install it (on Debian and Ubuntu "
            "the package is called ffmpeg), or use format=gif"
        )
    return found


class _Scene:
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
        xmin, xmax, ymin, ymax = config.terrain.extent
        self.extent = (xmin, xmax, ymin, ymax)
        self.budget, self.truth = config.budget, truth
        self.unit = style.plain(config.terrain.unit or "", style.LONGEST_UNIT)
        self.figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
        self.canvas = FigureCanvasAgg(self.figure)
        title = (
            f"{style.plain(recording.method)} on {style.plain(config.terrain.name)}, "
            f"ρ = {config.rho:g}, {config.detector.scope} scope, seed {recording.seed}"
        )
        headline = self._say(14, title, weight="bold")
        # A long name must not run into the clock.
        headline.set_fontsize(min(HEADLINE, HEADLINE * ROOM / len(title)))
        self.clock = self._say(WIDTH - 14, "", ha="right")
        self._draw_path_panel()
        # Few nodes must not take the colours from all others.
        deviation = _range([state.maps.std for state in states], 0.02, 0.98)
        _, error = _range(
            [np.abs(state.maps.mean - state.maps.truth) for state in states], 0.0, 0.98
        )
        density = max(float(state.maps.outlier_density.max()) for state in states)
        self.mean = self._panel(0, 0, "mean", style.ELEVATION, truth.min(), truth.max())
        self.std = self._panel(0, 1, "standard deviation", style.DEVIATION, *deviation)
        self.error = self._panel(1, 0, "absolute error", style.ERROR, 0, error)
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
        self._draw_curve_panel(recording.curve, looks([recording.method])[recording.method])

    def draw(self, state: State) -> Picture:
        """Draw a state; returns red, green, blue, shape (HEIGHT, WIDTH, 3)."""
        row, samples, maps = state.row, state.samples, state.maps
        self.clock.set_text(f"{row.collected} of {self.budget} samples, epoch {row.epoch}")
        self.path.set_data(samples.x[:, 0], samples.x[:, 1])
        newest = samples[samples.epoch == row.epoch]
        self.newest.set_data(newest.x[:, 0], newest.x[:, 1])
        self.robot.set_data(samples.x[-1:, 0], samples.x[-1:, 1])
        flagged, outlier = samples.flagged, samples.is_outlier
        for marks, chosen in (
            (self.caught, flagged & outlier),
            (self.missed, ~flagged & outlier),
            (self.false_alarms, flagged & ~outlier),
        ):
            marks.set_data(samples.x[chosen, 0], samples.x[chosen, 1])
        for image, values in (
            (self.mean, maps.mean),
            (self.std, maps.std),
            (self.error, np.abs(maps.mean - maps.truth)),
            (self.density, maps.outlier_density),
        ):
            image.set_data(drawable(values.reshape(self.truth.shape), self.truth))
        told = f"absolute error, RMSE {figure(row.rmse)} {self.unit}"
        self.error.axes.set_title(told.rstrip(), loc="left")
        so_far = self.stored["collected"] <= row.collected
        self.curve.set_data(self.stored["collected"][so_far], self.errors[so_far])
        self.point.set_data([row.collected], drawable([row.rmse], self.stored["rmse"]))
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()

    def _draw_path_panel(self) -> None:
        axes = self._axes(36, 186, 396, 396)
        style.show_relief(axes, self.truth, self.extent)
        axes.set(xlabel="", ylabel="")
        axes.set_title("ground truth, path and samples", loc="left")
        (self.path,) = axes.plot([], [], color="white", lw=0.8, alpha=0.75)
        (self.newest,) = axes.plot([], [], ".-", color="white", lw=1.4, ms=3.5)
        (self.missed,) = axes.plot([], [], "v", color="#FF4FB0", label="spike missed")
        (self.caught,) = axes.plot([], [], "o", color="white", label="spike caught")
        (self.false_alarms,) = axes.plot([], [], "X", color="#FF6A00", label="false alarm")
        marks = [self.caught, self.missed, self.false_alarms]
        for mark in marks:
            mark.set(markersize=5.5, markeredgecolor="black", markeredgewidth=0.6)
        (self.robot,) = axes.plot([], [], "D", color="black", mec="white", label="robot")
        axes.legend(
            handles=[*marks, self.robot], ncols=4, loc="upper left", bbox_to_anchor=(0, -0.05),
            borderaxespad=0, handletextpad=0.2, columnspacing=1.2,
        )  # fmt: skip

    def _panel(
        self, row: int, column: int, title: str, cmap: str, vmin: float, vmax: float
    ) -> "AxesImage":
        """Draw a small map with its colour bar; row 0 is the upper one."""
        from matplotlib.ticker import FuncFormatter

        left, bottom, side = 482 + 240 * column, 402 - 216 * row, 180
        axes = self._axes(left, bottom, side, side)
        image = style.show_map(axes, self.truth, self.extent, cmap=cmap, vmin=vmin, vmax=vmax)
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
                 ylabel=f"RMSE ({self.unit})")  # fmt: skip
        axes.spines[["top", "right"]].set_visible(False)

    def _axes(self, left: float, bottom: float, width: float, height: float) -> "Axes":
        """Axes at a place given in pixels."""
        return self.figure.add_axes((left / WIDTH, bottom / HEIGHT, width / WIDTH, height / HEIGHT))

    def _say(self, left: float, text: str, **look: Any) -> "Text":
        """Write into the headline, so many pixels from the left."""
        return self.figure.text(left / WIDTH, 1 - 24 / HEIGHT, text, size=HEADLINE, **look)


def _is_papers_own(results_dir: Path, run: str) -> bool:
    """Whether a run is PUCT-COPOD at rho 0.1 and scope batch."""
    seed = list_missions(results_dir)[run][0]
    science = read_footer(table_path(results_dir, "curves", run, seed)).configuration
    setting = science["detector"]["scope"], science["rho"]
    return method_of(stored_options(science)).label == "PUCT-COPOD" and setting == ("batch", 0.1)


def _states(
    recording: Recording, named: Mapping[str, str | None], trust: bool, console: Console
) -> Iterator[State]:
    """Recompute a mission's states, or take what the tables tell, and say which."""
    tell = partial(console.print, soft_wrap=True, markup=False)
    config, epochs = recording.config, len(recording.curve)
    _check_named(recording, named)
    given = {group for group, path in named.items() if path is not None}
    if reason := cannot_replay(config, trust, given):
        tell(f"only the maps of the end are shown: {reason}")
        yield from _tracked(from_tables(recording), epochs, "reading epochs", console)
        return
    admit(config, recording.science, given, trust, tell)
    states = []
    for state in _tracked(replay(recording), epochs, "recomputing epochs", console):
        states.append(state)
        yield state
    if difference := difference_from_curve(states, recording):
        console.print(f"WARNING: {difference}", style="bold yellow", soft_wrap=True, markup=False)


def _check_named(recording: Recording, named: Mapping[str, str | None]) -> None:
    """Refuse a function of the command line that is not the recording's."""
    for group, path in named.items():
        used = getattr(getattr(recording.config, group), "function", None)
        if path is not None and path != used:
            raise UsageError(
                f"{group}.function={path} is not the {group} of {recording.run}: "
                f"{f'that is {used}' if used else 'that is none of a user'}"
            )


def _range(maps: Sequence[Floats], low: float, high: float) -> tuple[float, float]:
    """Two quantiles of some maps' values, apart from each other; NaN is left out."""
    values = np.concatenate([values[np.isfinite(values)] for values in maps])
    if not len(values):
        return 0.0, 1.0
    first, last = (float(np.quantile(values, share)) for share in (low, high))
    return first, last if last > first else first + (abs(first) or 1.0)


def _palette(picture: Picture) -> "PIL.Image.Image":
    """Choose the colours of a GIF: many for the maps, and some for the few pixels of the marks."""
    import PIL.Image

    # Every shade counts by the root of its area, or small marks would get no colour of their own.
    coarse = (picture >> 3).astype(np.int64) @ (1 << 10, 1 << 5, 1)
    areas = np.bincount(coarse.ravel(), minlength=1 << 15)
    areas[[0, -1]] = 0  # black and white are given
    shades = np.repeat(np.arange(1 << 15), np.sqrt(areas).astype(int))
    swatches = np.stack([shades >> 10, shades >> 5 & 31, shades & 31], axis=-1) * 8 + 4
    found = PIL.Image.fromarray(swatches[None].astype(np.uint8)).quantize(COLOURS - 2)
    colours = [*(found.getpalette() or [])[: 3 * (COLOURS - 2)], 0, 0, 0, 255, 255, 255]
    palette = PIL.Image.new("P", (1, 1))
    palette.putpalette(colours)
    return palette


def _tracked(items: Iterator[Item], total: int, what: str, console: Console) -> Iterator[Item]:
    """Pass items on and show how many are done: a bar, or lines where there is no terminal."""
    if console.is_terminal:
        yield from track(items, what, total, console=console, transient=True)
        return
    last = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        if done == total or time.monotonic() - last >= LINE_SECONDS:
            last = time.monotonic()
            console.print(f"{what}: {done} of {total}", soft_wrap=True)
