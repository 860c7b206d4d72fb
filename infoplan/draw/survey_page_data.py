"""The numbers behind a survey's page: layers, samples and verdicts, packed."""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.relief import grid_of, on_grid
from infoplan.analyse.verdicts import Verdict
from infoplan.backend import load_matplotlib
from infoplan.config import SurveyedConfig
from infoplan.draw import style
from infoplan.draw.place_layout import end_of_deviation, ends_of_mean
from infoplan.later_logs import CLEARED, CONFIRMED, UNTESTED
from infoplan.survey import SurveyLog
from infoplan.survey.names import BRACKETS
from infoplan.survey.projection import to_degrees
from infoplan.wording import harmless

Floats = NDArray[np.float64]

COLOURS = 64
"""Of a colour map, from its low end to its high one."""

DEGREE = 4
"""Of the polynomials that give latitude and longitude."""

LAYERS = {
    "mean": ("mean", "mean", style.ELEVATION),
    "deviation": ("deviation", "std", style.DEVIATION),
    "density": ("outlier density", "outlier_density", style.DENSITY),
}
"""Title, column of the map and colour map of each layer."""


LATER = ["", CONFIRMED, CLEARED, UNTESTED]
"""What later logs can say of a sample; first nothing."""


def page_data(
    samples: pd.DataFrame,
    sources: pd.DataFrame,
    maps: pd.DataFrame,
    verdicts: Mapping[str, Verdict],
    log: SurveyLog,
    place: SurveyedConfig,
    later: Sequence[str | None] | None = None,
) -> dict[str, Any]:
    """Gather what the page's script reads.

    Parameters
    ----------
    samples, maps
        The survey's tables; of the samples those that have a value, shape (n, ...).
    sources
        Of these samples, as `sources_of` gives them.
    verdicts
        By the detector's name.
    log, place
        As read, and the options of its terrain.
    later
        What the later logs say of each sample (`infoplan.later_logs`); None if there is one log.

    Returns
    -------
    dict
        Positions are metres from ``origin``. Arrays are text (`packed`): single precision, but for
        the samples' values (double), rows (32-bit integers, counted from 1), flags and numbers of
        ``later_words`` (bytes).
    """
    unit, grid = harmless(log.unit), grid_of(maps)
    units = {"mean": unit, "deviation": unit, "density": "flagged samples"}
    kept = samples.loc[~samples["flagged"], "measured"].to_numpy(dtype=float)
    deviation, density = (on_grid(maps, column) for column in ("std", "outlier_density"))
    ends = {
        "mean": ends_of_mean(on_grid(maps, "mean"), kept),
        "deviation": (float(deviation.min()), end_of_deviation(deviation, kept)),
        "density": (float(density.min()), float(density.max())),
    }
    return {
        "value": _value_name(log),
        "unit": unit,
        "logs": [one.name for one in log.parts],
        "crs": None if log.crs is None else harmless(log.crs),
        "origin": list(place.origin),
        "extent": list(grid.extent),
        "degrees": None if log.crs is None else degrees(grid.extent, place.origin, log.crs),
        "grid": {"rows": grid.shape[0], "columns": grid.shape[1]},
        "layers": [
            {
                "name": name,
                "title": title,
                "unit": units[name],
                **_layer(on_grid(maps, column), map_, ends[name]),
            }
            for name, (title, column, map_) in LAYERS.items()
        ],
        "samples": {
            "x": packed(samples["x1"], "<f4"),
            "y": packed(samples["x2"], "<f4"),
            "value": packed(samples["measured"], "<f8"),
            "row": packed(sources["row"], "<i4"),
            "log": packed(sources["log"], "<i4"),
            "time": None if sources["time"].isna().all() else sources["time"].tolist(),
            "later": None
            if later is None
            else packed([LATER.index(one or "") for one in later], "u1"),
        },
        "later_words": LATER,
        "detectors": [
            {
                "name": harmless(name),
                "threshold": one.threshold,
                "flagged": packed(one.flagged, "u1"),
                "score": packed(one.score, "<f4"),
                "expected": packed(one.expected, "<f4"),
            }
            for name, one in verdicts.items()
        ],
    }


def packed(values: Any, kind: str) -> str:
    """Write numbers as text: base 64 of their bytes, as a type of numpy has them."""
    with np.errstate(over="ignore"):  # beyond single precision is infinite
        return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode()


def degrees(extent: tuple[float, float, float, float], origin: Any, crs: str) -> dict[str, Any]:
    """Fit polynomials that turn a place of the map into degrees.

    Parameters
    ----------
    extent
        xmin, xmax, ymin, ymax, metres from the origin.
    origin
        Easting and northing.
    crs
        Of these.

    Returns
    -------
    dict
        ``lat`` and ``lon``, coefficients [i][j] of u^i v^j, where u and v run from -1 to 1 across
        the map, eastwards and northwards. A longitude may be beyond 180.
    """
    xmin, xmax, ymin, ymax = extent
    nodes = np.polynomial.chebyshev.chebpts1(2 * DEGREE + 2)
    u, v = (side.ravel() for side in np.meshgrid(nodes, nodes))
    x = np.column_stack([
        origin[0] + (xmin + xmax + u * (xmax - xmin)) / 2,
        origin[1] + (ymin + ymax + v * (ymax - ymin)) / 2,
    ])  # fmt: skip
    lat, lon = to_degrees(x, crs)
    around = lon[0] + (lon - lon[0] + 180.0) % 360.0 - 180.0  # across 180 degrees without a jump
    basis = np.polynomial.polynomial.polyvander2d(u, v, [DEGREE, DEGREE])
    found = {
        name: np.linalg.lstsq(basis, angle, rcond=None)[0].reshape(DEGREE + 1, DEGREE + 1).tolist()
        for name, angle in (("lat", lat), ("lon", around))
    }
    return found


def _layer(values: Floats, colour_map: str, ends: tuple[float, float]) -> dict[str, Any]:
    """Describe a layer of the map: its values, the south first, their range, and its colours.

    What lies beyond the ends of the colours has the colour of the end.
    """
    load_matplotlib()
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    colours = colormaps[colour_map](np.linspace(0, 1, COLOURS))
    return {
        "values": packed(values, "<f4"),
        "low": ends[0],
        "high": ends[1],
        "range": [float(values.min()), float(values.max())],
        "palette": [to_hex(colour) for colour in colours],
    }


def _value_name(log: SurveyLog) -> str:
    """Name the column of values, without the unit; of several logs that of the first."""
    name = (log.parts or (log,))[0].roles["value"]
    found = BRACKETS.fullmatch(name)
    return _short(found[1] if found and found[1] else name)


def sources_of(log: SurveyLog) -> pd.DataFrame:
    """Say where the samples of a log, or of several made into one, come from.

    Returns
    -------
    DataFrame
        A row a sample: ``log``, its number among `SurveyLog.parts`; ``row`` of that log, from 1;
        ``time`` as it is written there, None where it tells none.
    """
    frames = []
    for number, one in enumerate(log.parts or (log,)):
        names = [one.roles[role] for role in ("date", "time") if role in one.roles]
        cells = one.columns[names].iloc[one.rows].astype(str)
        times = [_short(" ".join(row)) for row in cells.itertuples(index=False)] if names else None
        frames.append(pd.DataFrame({"log": number, "row": one.rows + 1, "time": times}))
    sources = pd.concat(frames, ignore_index=True)
    return sources.assign(time=sources["time"].astype(object).where(sources["time"].notna(), None))


def _short(text: str) -> str:
    """Write text of unknown origin, not longer than a line of the page can be."""
    shown = harmless(text)
    return shown if len(shown) <= style.LONGEST else f"{shown[: style.LONGEST - 1]}…"
