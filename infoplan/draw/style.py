"""One look for all figures: sizes, fonts, colours, files."""

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.backend import load_matplotlib
from infoplan.files import writing
from infoplan.method_identity import Look
from infoplan.palette import MARKS, RIM
from infoplan.wording import csv_cell, harmless

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]
Rgba = tuple[float, float, float, float]

WHITE: Rgba = (1.0, 1.0, 1.0, 1.0)

COLUMN = 3.5
"""Width of a journal's column, inches."""

PAGE = 7.16
"""Width of two columns, inches."""

SHOWN_SMALL = 5.6
"""Width of a picture that README.md shows at 560 pixels, inches: its letters stay as large."""

SCREEN = 150
"""Dots an inch of a picture in a notebook."""

LONGEST, LONGEST_UNIT = 60, 20
"""So many characters of a user's text does a picture show; more would push the axes aside."""

ELEVATION, DEVIATION, ERROR, DENSITY = "viridis", "cividis", "magma_r", "YlOrBr"
SCORE = "cividis_r"
"""Colour maps; lightness alone tells their values apart."""

TITLE, TEXT, LABEL, SMALL, TINY = 7.5, 7.0, 6.5, 6.0, 5.5
"""Sizes of letters, points: titles, axes, ticks and legends, notes, and what fills cells."""

INK, DARK, FAINT, GRID = "black", "0.35", "0.6", "0.85"
"""Neutral tones: what is measured, arrows, lines to compare with, and the grid."""

# Any: matplotlib types its settings name by name.
SETTINGS: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": TEXT,
    "axes.labelsize": TEXT,
    "axes.titlesize": TITLE,
    "axes.titlepad": 3.0,
    "axes.labelpad": 2.0,
    "figure.labelsize": TEXT,
    "axes.linewidth": 0.6,
    "xtick.labelsize": LABEL,
    "ytick.labelsize": LABEL,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "legend.fontsize": LABEL,
    "legend.frameon": False,
    "grid.color": GRID,
    "grid.linewidth": 0.3,
    "lines.linewidth": 1.2,
    # Type 42 embeds the fonts whole, which publishers ask for.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
}


@contextmanager
def journal() -> Iterator[None]:
    """Draw with the journal's settings inside this context, and leave the user's alone."""
    load_matplotlib()
    import matplotlib as mpl

    with mpl.rc_context(), warnings.catch_warnings():
        # A name in a script that the font has not is drawn as boxes.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def line(look: Look) -> dict[str, Any]:
    """Give colour and style of a method's line as matplotlib's arguments."""
    return {"color": look.colour, "linestyle": (0, look.dashes) if look.dashes else "solid"}


def inert(text: object, longest: int = LONGEST) -> str:
    """Write text of unknown origin for a picture, which shows it as it is: no formulas."""
    shown = harmless(text)
    shown = shown if len(shown) <= longest else f"{shown[: longest - 1]}…"
    return shown.replace("$", r"\$")


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of a size in inches; drawn by Agg, without pyplot's state.

    A notebook shows it as it is, with or without a backend of pyplot's.
    """
    load_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure: Figure = _figure_class()(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


@cache
def _figure_class() -> Any:
    """Make the class of all figures, once matplotlib is needed."""
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        """A figure that a notebook shows in the journal's look."""

        def _repr_png_(self) -> bytes:
            stream = io.BytesIO()
            with journal():
                self.savefig(stream, format="png", dpi=SCREEN)
            return stream.getvalue()

    return NotebookFigure


PRINT_DPI, FIELD_DPI = 300, 200
"""Dots an inch of a figure for print, and of a picture that is wanted in a second."""


def save(
    figure: "Figure",
    folder: Path,
    name: str,
    numbers: pd.DataFrame,
    in_print: bool = True,
) -> list[Path]:
    """Write a figure as PNG and PDF, and what it shows as CSV.

    Parameters
    ----------
    figure
        Complete.
    folder, name
        Where, and the files' stem.
    numbers
        The plotted numbers, one row a point.
    in_print
        False: a PNG alone, as sharp as screens are.

    Returns
    -------
    list of Path
        The pictures, PNG first, then the CSV.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    kinds = ("png", "pdf", "csv") if in_print else ("png", "csv")
    *pictures, table = (folder / f"{name}.{kind}" for kind in kinds)
    texts = {
        str(name): column.map(csv_cell, na_action="ignore")
        for name, column in numbers.items()
        if not pd.api.types.is_numeric_dtype(column)
    }
    with writing(pictures[0]):
        folder.mkdir(parents=True, exist_ok=True)
        for path in pictures:
            # Without a date the same results give the same file.
            undated = {"CreationDate": None} if path.suffix == ".pdf" else None
            figure.savefig(path, dpi=PRINT_DPI if in_print else FIELD_DPI, metadata=undated)
        numbers.assign(**texts).to_csv(table, index=False, float_format="%.10g")
    return [*pictures, table]


def show_map(
    axes: "Axes",
    values: Floats,
    extent: Extent,
    *,
    cmap: str,
    vmin: float | None = None,
    vmax: float | None = None,
    smooth: bool = True,
) -> "ScalarMappable":
    """Draw a map whose nodes lie on the borders of the extent, row 0 at the bottom.

    Parameters
    ----------
    axes
        Where.
    values
        Shape (rows, columns).
    extent
        xmin, xmax, ymin, ymax, workspace units.
    cmap, vmin, vmax
        Colour map and its ends; those of the values if None.
    smooth
        Interpolate between the nodes.

    Returns
    -------
    ScalarMappable
        For a colour bar.
    """
    image = axes.imshow(
        values,
        extent=_pixel_extent(values.shape, extent),
        origin="lower",
        cmap=cmap,
        vmin=vmin,
        vmax=vmax,
        interpolation="bicubic" if smooth else "nearest",
    )
    frame_workspace(axes, extent)
    return image


def show_relief(
    axes: "Axes", elevation: Floats, extent: Extent, *, like: Floats | None = None
) -> "ScalarMappable":
    """Draw an elevation map, hill-shaded from the north-west.

    Parameters
    ----------
    axes, elevation, extent
        As for `show_map`.
    like
        Another elevation map whose range of colours and whose shading are taken.

    Returns
    -------
    ScalarMappable
        For a colour bar.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    like = elevation if like is None else like
    axes.imshow(
        shaded(elevation, extent, like),
        extent=_pixel_extent(elevation.shape, extent),
        origin="lower",
        interpolation="bicubic",
    )
    frame_workspace(axes, extent)
    return ScalarMappable(Normalize(like.min(), like.max()), ELEVATION)


def show_obstacles(axes: "Axes", polygons: Sequence[Sequence[Sequence[float]]]) -> None:
    """Hatch no-go zones.

    Parameters
    ----------
    axes
        Of a map.
    polygons
        Vertices of each, workspace units.
    """
    from matplotlib.collections import PolyCollection

    zones = PolyCollection([np.asarray(polygon, dtype=np.float64) for polygon in polygons])
    # Over maps of any colour: white strokes on a dark veil. Rectangles of a mask join without rims.
    zones.set(facecolor=(0, 0, 0, 0.45), edgecolor="white", linewidth=0, hatch="/////")
    axes.add_collection(zones, autolim=False)


def shaded(elevation: Floats, extent: Extent, like: Floats) -> Floats:
    """Colour an elevation map and shade it, light from the north-west.

    Parameters
    ----------
    elevation, extent, like
        As for `show_relief`.

    Returns
    -------
    ndarray, shape (rows, columns, 4)
        Red, green, blue, opacity.
    """
    from matplotlib import colormaps
    from matplotlib.colors import LightSource, Normalize

    rows, columns = elevation.shape
    dy, dx = (extent[3] - extent[2]) / (rows - 1), (extent[1] - extent[0]) / (columns - 1)
    # Heights and lengths have different units: the steep tenth of the map gets 45 degrees.
    steep = float(np.quantile(np.hypot(*np.gradient(like, dy, dx)), 0.9)) or 1.0
    # The light source takes the first row for the north; ours is the south.
    rgba = LightSource(azdeg=315, altdeg=45).shade(
        elevation[::-1],
        colormaps[ELEVATION],
        norm=Normalize(like.min(), like.max()),
        blend_mode="soft",
        vert_exag=1.0 / steep,
        dx=dx,
        dy=dy,
    )
    return np.asarray(rgba[::-1])


def frame_workspace(axes: "Axes", extent: Extent) -> None:
    """Frame the workspace, axes labelled in its units."""
    from matplotlib.ticker import MaxNLocator

    axes.set(
        xlim=extent[:2],
        ylim=extent[2:],
        aspect="equal",
        xlabel="$x_1$ (workspace units)",
        ylabel="$x_2$ (workspace units)",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))


def colour_bar(
    image: "ScalarMappable",
    axes: "Axes",
    label: str,
    *,
    whole: bool = False,
    extend: str = "neither",
) -> None:
    """Put a slim colour bar beside the axes, as high as they are; `whole`: whole numbers alone."""
    from matplotlib.ticker import MaxNLocator

    place = axes.inset_axes((1.03, 0.0, 0.045, 1.0))
    bar = axes.figure.colorbar(image, cax=place, label=label, extend=extend)
    bar.outline.set_linewidth(0.6)
    place.yaxis.set_major_locator(MaxNLocator(6, integer=whole))


def mark(axes: "Axes", places: pd.DataFrame, name: str, size: float = 5.0, label: str = "") -> None:
    """Mark samples over a coloured map, with a rim that parts them from any colour of it.

    Parameters
    ----------
    axes
        Of the map.
    places
        Samples, with columns ``x1`` and ``x2``.
    name
        What they are: of `infoplan.palette.MARKS`.
    size
        Points.
    label
        For a legend, if it has one.
    """
    look = MARKS[name]
    axes.plot(places["x1"], places["x2"], look.marker, color=look.colour, ms=size, mec=RIM,
              mew=0.1 * size, zorder=3, label=label or None)  # fmt: skip


def panel(axes: "Axes", letter: str, title: str) -> None:
    """Title a panel: (a) what it shows."""
    axes.set_title(f"({letter}) {title}" if letter else title, loc="left")


def _pixel_extent(shape: tuple[int, ...], extent: Extent) -> Extent:
    """Extent of an image whose outer pixels are centred on the borders."""
    half_x = (extent[1] - extent[0]) / (shape[1] - 1) / 2
    half_y = (extent[3] - extent[2]) / (shape[0] - 1) / 2
    return extent[0] - half_x, extent[1] + half_x, extent[2] - half_y, extent[3] + half_y


def score_colours(values: Floats) -> "ScalarMappable":
    """Colour scores, light the best, on a logarithmic scale that ends at the 90th percentile.

    So a few that are far worse than the rest leave it its shades.

    Parameters
    ----------
    values
        Scores above 0; others, and NaN, have no say in the scale.
    """
    load_matplotlib()
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(np.quantile(known, 0.9))) if len(known) else (0.1, 1.0)
    return ScalarMappable(LogNorm(low, max(high, 1.05 * low), clip=True), SCORE)


def rgba(colours: "ScalarMappable", value: float) -> Rgba:
    """Colour of a value: red, green, blue, opacity."""
    red, green, blue, opacity = map(float, colours.to_rgba(np.array(value)))
    return red, green, blue, opacity


def ink_on(colour: Rgba) -> str:
    """Black or white, whichever contrasts more with a colour (relative luminance of WCAG 2)."""
    channels = np.array(colour[:3])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return "black" if float(linear @ (0.2126, 0.7152, 0.0722)) > 0.179 else "white"
