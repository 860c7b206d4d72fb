"""The numbers behind the report's charts and tables."""

import base64
import io
import math
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.claims import METHODS
from infoplan.analyse.curves import (
    collapsed_ends,
    common_axis,
    drawable,
    missions,
    moving_ends,
    on_common_axis,
    summarise,
)
from infoplan.analyse.detection import detector_quality
from infoplan.analyse.relief import by_relief, grid_of, on_grid
from infoplan.analyse.statistics import Interval, mean_band, mean_interval, ratio_band
from infoplan.analyse.stretches import load_scored_curves
from infoplan.analyse.tables import Selection, load_samples
from infoplan.backend import load_matplotlib
from infoplan.collapse import counted_ends, share_text
from infoplan.config import is_survey
from infoplan.draw.calibration import coverage
from infoplan.draw.line_panels import PANELS
from infoplan.draw.page import dash_array
from infoplan.method_identity import NEVER_ERRS, looks
from infoplan.study.records import Footer
from infoplan.study.store import read_footer, read_table, table_path

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]

CURVE_POINTS = 80
"""Points of a learning curve on the page."""
QUALITY_BINS = 20
"""Stretches of a mission over which a detector's counts are pooled."""
MAP_POINTS = 1500
"""Most points of a kind that the map shows of a run."""
SHADE_PIXELS = 400
"""Side of the hill-shaded map."""

LETTERS = {condition: letter for letter, condition in PANELS.items()}
"""The paper's panels by rho and scope."""

DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True)
class Panel:
    """Runs that belong into one chart: one share of outliers, one scope.

    Attributes
    ----------
    rho, scope
        Which.
    runs
        Name of each method's run, in the order of a legend.
    judging
        Those of them whose detector can err.
    """

    rho: float
    scope: str
    runs: dict[str, str]
    judging: dict[str, str]

    @property
    def title(self) -> str:
        """Its title, with the letter of the paper's panel."""
        letter = LETTERS.get((self.rho, self.scope))
        return f"{f'({letter}) ' if letter else ''}ρ = {self.rho:g}, {self.scope} scope"


def panels_of(selection: Selection) -> list[Panel]:
    """List the panels that the stored runs fill, the paper's first."""
    missions = selection.missions
    judging = missions[~missions["detector"].isin(NEVER_ERRS)]
    if is_survey(selection.terrain):  # nobody can say whether a detector errs
        judging = judging.iloc[:0]
    can_err = set(judging["run"])
    keys = set(zip(judging["rho"], judging["scope"], strict=True))
    # NONE and BEST go with either scope: they make a panel of their own only where they are alone.
    if is_survey(selection.terrain):
        keys = set(zip(missions["rho"], missions["scope"], strict=True))
    keys |= {(rho, "batch") for rho in set(missions["rho"]) - {rho for rho, _ in keys}}
    ordered = sorted(keys, key=lambda key: (LETTERS.get(key, "other"), key[1], key[0]))
    panels = []
    for rho, scope in ordered:
        found = {method: selection.run(method, rho, scope) for method in looks(missions["method"])}
        runs = {method: run for method, run in found.items() if run}
        errs = {method: run for method, run in runs.items() if run in can_err}
        panels.append(Panel(float(rho), scope, runs, errs))
    return panels


@dataclass(frozen=True)
class Findings:
    """What the curves say.

    Attributes
    ----------
    axis
        Numbers of collected samples.
    curves
        RMSE there, one column a mission (levels run and seed), terrain's unit.
    summaries
        One row a mission, as `infoplan.analyse.summarise` gives it.
    ends
        Whether each mission, by run and seed, ends with a collapsed model.
    moving
        Whether its hyperparameters were still on the way.
    """

    axis: NDArray[np.int64]
    curves: pd.DataFrame
    summaries: pd.DataFrame
    ends: dict[tuple[str, int], bool | None]
    moving: dict[tuple[str, int], bool | None]

    def interval(self, run: str, name: str) -> Interval:
        """Mean over a run's seeds of a number a mission, with its 95 % interval."""
        return mean_interval(self.summaries.loc[[run], name])

    def collapsed(self, run: str) -> str:
        """How many of a run's missions end with a collapsed model."""
        of_run = [end for (name, _), end in self.ends.items() if name == run]
        return share_text(*counted_ends(of_run))

    def gaps(self, runs: Iterable[str]) -> list[str]:
        """Those of some runs that have errors which no chart shows."""
        return [run for run in runs if not np.isfinite(self.shown[run].to_numpy()).all()]

    @cached_property
    def shown(self) -> pd.DataFrame:
        """The curves with gaps where an error is infinite or beyond all measure."""
        values = self.curves.to_numpy()
        return self.curves.mask(np.isnan(drawable(values, values)))

    def pooled(self, run: str) -> dict[str, float]:
        """Confusion counts of all of a run's missions together."""
        of_run = self.summaries.loc[[run]]
        return {name: float(of_run[name].sum()) for name in ("tp", "fp", "fn", "tn")}


def read_findings(selection: Selection) -> Findings:
    """Read the curves, put them on one axis and sum them up."""
    curves = load_scored_curves(selection)
    whole = common_axis(curves)
    axis = np.unique(np.linspace(whole[0], whole[-1], CURVE_POINTS).round().astype(np.int64))
    ends = collapsed_ends(curves, selection.results_dir)
    moving = moving_ends(curves, selection.results_dir)
    return Findings(axis, on_common_axis(curves, axis), summarise(curves), ends, moving)


def method_looks(present: Collection[str]) -> list[dict[str, Any]]:
    """Name, colour, line and first state of each method; the paper's are shown first."""
    papers_own = set(present) & set(METHODS)
    return [
        {
            "name": method,
            "colour": look.colour,
            "dash": dash_array(look),
            "shown": method in (papers_own or set(present)),
        }
        for method, look in looks(present).items()
    ]


def curve_charts(panels: Sequence[Panel], findings: Findings) -> list[dict[str, Any]]:
    """Lines of each panel: RMSE of each run, mean with 95 % band, and single seeds."""
    charts = []
    for panel in panels:
        lines = []
        for method, run in panel.runs.items():
            seeds = findings.shown[run]
            singles = {str(seed): rounded(seeds[seed]) for seed in seeds}
            lines.append(chart_line(method, mean_band(seeds.to_numpy().T)) | {"seeds": singles})
        charts.append({"title": panel.title, "lines": lines})
    return charts


def calibration_charts(selection: Selection, panels: Sequence[Panel]) -> dict[str, Any]:
    """Lines of each panel: share of the map within central intervals, by their level.

    Returns
    -------
    dict
        ``axis``: the levels; ``panels``: a title and the lines, a mean with its 95 % band each.
    """
    axis: list[float] = []
    charts = []
    for panel in panels:
        lines = []
        for method, run in panel.runs.items():
            seeds = coverage(selection.only([run]))
            axis = seeds.index.tolist()
            lines.append(chart_line(method, mean_band(seeds.to_numpy().T)))
        charts.append({"title": panel.title, "lines": lines})
    return {"axis": axis, "panels": charts}


Parts = Callable[[pd.DataFrame], tuple["pd.Series[float]", "pd.Series[float]"]]

RATIOS: dict[str, Parts] = {
    "Precision": lambda rows: (rows["tp"], rows["tp"] + rows["fp"]),
    "Recall": lambda rows: (rows["tp"], rows["tp"] + rows["fn"]),
    "False-alarm rate": lambda rows: (rows["fp"], rows["fp"] + rows["tn"]),
    "Area under the ROC curve": lambda rows: (
        rows["roc_auc"].fillna(0.0),
        rows["roc_auc"].notna() * 1.0,
    ),
}
"""What tells a detector's quality: numerator and denominator of an epoch."""


def quality_charts(selection: Selection, panels: Sequence[Panel]) -> dict[str, Any]:
    """Quality of the detectors that can err, along the mission, pooled over seeds.

    Returns
    -------
    dict
        ``axis``: the middles of the stretches; ``panels``: a title and the charts, one for each of
        `RATIOS`.
    """
    judging = [panel for panel in panels if panel.judging]
    if not judging:
        return {"axis": [], "panels": []}
    quality = detector_quality(selection.only(r for p in judging for r in p.judging.values()))
    bins = min(QUALITY_BINS, int(quality["epoch"].max()))
    edges = np.linspace(quality["collected"].min(), quality["collected"].max() + 1, bins + 1)
    quality["stretch"] = np.searchsorted(edges, quality["collected"], side="right") - 1
    of_run = {str(run): rows for run, rows in quality.groupby("run")}
    described = []
    for panel in judging:
        charts = []
        for name, parts in RATIOS.items():
            lines = [
                chart_line(method, pooled_ratio(of_run[run], *parts(of_run[run]), bins))
                for method, run in panel.judging.items()
            ]
            charts.append({"title": name, "lines": lines})
        described.append({"title": panel.title, "charts": charts})
    middles = (edges[:-1] + edges[1:]) / 2
    return {"axis": middles.round().astype(int).tolist(), "panels": described}


def pooled_ratio(
    rows: pd.DataFrame, part: "pd.Series[float]", whole: "pd.Series[float]", bins: int
) -> Floats:
    """Ratio of sums over seeds and epochs in each stretch, with a 95 % band over seeds.

    Parameters
    ----------
    rows
        Epochs of a run: ``seed`` and ``stretch``, from 0 to bins - 1.
    part, whole
        Numerator and denominator of each row.
    bins
        Number of stretches.

    Returns
    -------
    ndarray, shape (3, bins)
        Ratio, lower and upper end; NaN where the denominator is 0, and at the ends for a single
        seed.
    """
    seeds, seed = np.unique(rows["seed"], return_inverse=True)
    parts, wholes = np.zeros((2, len(seeds), bins))
    np.add.at(parts, (seed, rows["stretch"]), part)
    np.add.at(wholes, (seed, rows["stretch"]), whole)
    return ratio_band(parts, wholes)


def alarm_map(selection: Selection, panels: Sequence[Panel]) -> dict[str, Any]:
    """Hill-shaded map, and where each run raised false alarms, caught and missed outliers.

    Returns
    -------
    dict
        ``image`` as a data URI, ``extent``; ``runs``: panel, method, obstacles, number of
        missions, the layers with their count and packed points, the split by relief.
    """
    first = selection.missions.iloc[0]
    key = (first["run"], int(first["seed"]))
    maps = read_table(selection.results_dir, "maps", *key).to_pandas()
    extent = grid_of(maps).extent
    runs = [
        {
            "panel": panel.title,
            "method": method,
            "obstacles": selection.options[run].get("terrain.obstacles", []),
        }
        | _alarms_of(selection.only([run]), extent)
        for panel in panels
        for method, run in panel.judging.items()
    ]
    return {"image": hill_shade(on_grid(maps, "truth"), extent), "extent": extent, "runs": runs}


def _alarms_of(run: Selection, extent: Extent) -> dict[str, Any]:
    """Count and place a run's flags, and split its errors and false alarms by terrain relief."""
    samples = load_samples(run)
    thirds = pd.concat(
        by_relief(rows, read_table(run.results_dir, "maps", *key).to_pandas())
        for key, rows in missions(samples)
    ).groupby("class", sort=False)
    alarms = thirds[["false_alarms", "clean"]].sum()
    split = thirds[["relief", "rmse"]].mean()
    split["rate"] = alarms["false_alarms"] / alarms["clean"].where(alarms["clean"] > 0)
    flown = samples[samples["epoch"] > 0]
    flagged, outlier = flown["flagged"].astype(bool), flown["is_outlier"].astype(bool)
    layers = {
        "false alarms": flagged & ~outlier,
        "outliers caught": flagged & outlier,
        "outliers missed": ~flagged & outlier,
    }
    return {
        "missions": len(run.missions),
        "layers": [
            {"name": name, "count": int(chosen.sum()), "points": packed(flown[chosen], extent)}
            for name, chosen in layers.items()
        ],
        "relief": [
            {"land": land, **{name: rounded([value])[0] for name, value in row.items()}}
            for land, row in split.to_dict("index").items()
        ],
    }


def packed(samples: pd.DataFrame, extent: Extent) -> str:
    """Pack positions into text, four characters each; of many, an even choice.

    Parameters
    ----------
    samples
        Columns x1 and x2, workspace units.
    extent
        xmin, xmax, ymin, ymax.

    Returns
    -------
    str
        For each position x and y as two digits to the base 36: 0 to 1295 across the extent.
    """
    samples = samples[np.isfinite(samples[["x1", "x2"]].to_numpy(dtype=float)).all(axis=1)]
    chosen = np.linspace(0, len(samples) - 1, min(len(samples), MAP_POINTS)).round().astype(int)
    xmin, xmax, ymin, ymax = extent
    x, y = samples[["x1", "x2"]].to_numpy()[chosen].T
    steps = np.stack([(x - xmin) / (xmax - xmin), (y - ymin) / (ymax - ymin)], axis=1) * 1295
    whole = np.clip(steps.round(), 0, 1295).astype(int).ravel()
    return "".join(DIGITS[step // 36] + DIGITS[step % 36] for step in whole.tolist())


def hill_shade(elevation: Floats, extent: Extent) -> str:
    """Shade a map in grey, light from the north-west; returns a PNG as a data URI."""
    load_matplotlib()
    from matplotlib.colors import LightSource
    from PIL import Image
    from scipy.ndimage import zoom

    fine = zoom(
        np.nan_to_num(elevation), [SHADE_PIXELS / nodes for nodes in elevation.shape], order=3
    )
    dx, dy = (extent[1] - extent[0]) / SHADE_PIXELS, (extent[3] - extent[2]) / SHADE_PIXELS
    # Heights and lengths have different units: the steep tenth of the map gets 45 degrees.
    steep = float(np.quantile(np.hypot(*np.gradient(fine, dy, dx)), 0.9)) or 1.0
    # An image begins with the north, our maps with the south.
    grey = LightSource(315, 45).hillshade(fine[::-1], vert_exag=1 / steep, dx=dx, dy=dy)
    # Neither black nor white, so that points stand out; 40 greys are enough.
    levels = (95 + np.round(grey * 40) * 4).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(levels).save(stream, format="PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"


def run_records(selection: Selection, findings: Findings) -> list[dict[str, Any]]:
    """One record a run: its labels, seeds, when it was computed, how long a mission took."""
    records = []
    for run, of_run in selection.missions.groupby("run"):
        footers = read_footers(selection.only([str(run)]))
        first = of_run.iloc[0]
        records.append(
            {
                "run": str(run),
                "method": first["method"],
                "rho": float(first["rho"]),
                "scope": first["scope"],
                "seeds": selection.seeds(str(run)),
                "started": min(footer.started for footer in footers),
                "ended": max(footer.ended for footer in footers),
                "seconds": float(np.median([footer.seconds for footer in footers])),
                "final": findings.interval(str(run), "final"),
            }
        )
    return records


def read_footers(selection: Selection) -> list[Footer]:
    """Read the provenance of each mission."""
    return [
        read_footer(table_path(selection.results_dir, "curves", str(run), int(seed)))
        for run, seed in selection.missions[["run", "seed"]].itertuples(index=False)
    ]


def provenance_facts(footers: Sequence[Footer]) -> dict[str, Counter[str]]:
    """Count, for each fact about the tables' making, how many missions have which value."""
    facts: dict[str, Counter[str]] = {}
    for footer in footers:
        for name, value in _facts(footer).items():
            facts.setdefault(name, Counter())[value] += 1
    return facts


def _facts(footer: Footer) -> dict[str, str]:
    libraries = dict(footer.libraries)
    git = footer.git or {}
    commit = git.get("commit") or "not recorded (not run from a repository)"
    blas = sorted({f"{one['internal_api']} {one['version']} ({one['architecture']})"
                   for one in footer.blas})  # fmt: skip
    program, *arguments = footer.command or ["not recorded"]
    if arguments and not arguments[0].startswith("-"):
        program, *arguments = arguments
    return {
        "terrain": footer.terrain["name"],
        "terrain sha256": footer.terrain["sha256"],
        "infoplan": str(libraries.pop("infoplan", None)),
        "commit": commit + (", with uncommitted changes" if git.get("dirty") else ""),
        "numerics version": str(footer.configuration["numerics_version"]),
        "schema version": str(footer.schema_version),
        "processor": footer.cpu,
        "system": footer.platform,
        "Python": footer.python,
        "libraries": ", ".join(f"{name} {version}" for name, version in libraries.items()),
        "BLAS": ", ".join(blas) or "not recorded",
        "command": shlex.join([Path(program).name, *arguments]),
    }


def chart_line(method: str, band: Floats) -> dict[str, Any]:
    """Give a method's mean and the ends of its band, as charts take them."""
    mean, low, high = band
    return {"method": method, "mean": rounded(mean), "low": rounded(low), "high": rounded(high)}


def rounded(values: Iterable[float]) -> list[float | None]:
    """Four digits are more than a chart shows; None where there is no finite value."""
    return [float(f"{value:.4g}") if math.isfinite(value) else None for value in values]
