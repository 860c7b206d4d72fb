"""Recompute stored missions from their tables with PyOD, scikit-learn and SciPy.

The audit reads what a stranger could read, the Parquet tables and the YAML of a run, and works
every number out again in its own slow and plain way. It shares no code with the mission: an error
made there cannot repeat itself here.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import BPoly, RegularGridInterpolator
from scipy.ndimage import gaussian_filter
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from infoplan.analyse import repeat
from infoplan.errors import UsageError

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

COLUMNS: dict[str, dict[str, str]] = {
    "curves": {
        **dict.fromkeys(["planner", "detector", "scope", "terrain"], "text"),
        **dict.fromkeys(["seed", "epoch", "collected", "accepted"], "integer"),
        **dict.fromkeys(["tp", "fp", "fn", "tn"], "integer"),
        **dict.fromkeys(["rho", "rmse", "mae", "nlpd", "coverage95", "lml"], "double"),
        **dict.fromkeys(["amplitude", "lengthscale_1", "lengthscale_2"], "double"),
        **dict.fromkeys(["noise_std", "jitter"], "double"),
        **dict.fromkeys(["plan_seconds", "fit_seconds"], "double"),
        **dict.fromkeys(["predict_seconds", "detect_seconds"], "double"),
    },
    "samples": {
        **dict.fromkeys(["seed", "epoch"], "integer"),
        **dict.fromkeys(["x1", "x2", "heading", "truth", "measured", "score"], "double"),
        **dict.fromkeys(["is_outlier", "flagged", "used"], "boolean"),
    },
    "maps": {
        "seed": "integer",
        **dict.fromkeys(["x1", "x2", "truth", "mean", "std", "outlier_density"], "double"),
    },
}
"""Columns that every table must have, and what they hold; more may follow."""

CHANCE = 1e-6
"""How rarely an honest mission may fail a test of randomness."""

SIGMAS = 6.0
"""Sensor noise, in standard deviations, that is allowed for where it cannot be known."""

ROUNDING = 1e-9
"""Relative difference that the order of a few additions may explain."""

PRECISION = {"float64": 1e-6, "float32": 3e-3}
"""Relative difference allowed to a prediction, by the precision of the model's matrices."""

OF_THE_MODEL = (
    "amplitude", "lengthscale_1", "lengthscale_2", "noise_std", "jitter", "lml",
)  # fmt: skip
"""Columns of the curve that a model of the user's own need not have."""

REPLAYED_PRECISION = 1e-6
"""Relative difference allowed to a score that comes from a solve with the model's covariance."""

EARLIER_ROWS = 3
"""Rows of the curve before the last whose model is fitted again."""

NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Finding:
    """What one check found in one mission.

    Attributes
    ----------
    run, seed
        The mission.
    check
        Name of the check.
    holds
        Whether the tables agree with what was recomputed.
    detail
        One short sentence with numbers; on failure it names the first offending sample or epoch,
        samples counted from 0 in order of collection.
    """

    run: str
    seed: int
    check: str
    holds: bool
    detail: str


class _FaultError(Exception):
    """A check fails; the message is the finding's detail."""


@dataclass(frozen=True)
class _Mission:
    """A stored mission as it was read."""

    configuration: dict[str, Any]
    curves: pd.DataFrame
    samples: pd.DataFrame
    maps: pd.DataFrame
    footers: dict[str, dict[str, Any]]
    run: str
    seed: int
    terrains: Mapping[str, NDArray[Any]]

    def option(self, name: str) -> Any:
        """Look an option up by its dotted name."""
        value: Any = self.configuration
        for key in name.split("."):
            if not isinstance(value, Mapping) or key not in value:
                raise _FaultError(f"the run's YAML has no {name}")
            value = value[key]
        return value

    def is_own(self, group: str) -> bool:
        """Tell whether the planner, detector or model is the user's own."""
        return "function" in self.option(group)

    def place(self, sample: int) -> str:
        """Say where a sample is to be found."""
        return f"sample {sample} (epoch {self.epoch[sample]})"

    @cached_property
    def epoch(self) -> NDArray[np.int64]:
        """Epoch of each sample, shape (n,)."""
        return self.samples["epoch"].to_numpy(dtype=np.int64)

    @cached_property
    def x(self) -> Floats:
        """Positions of the samples, shape (n, 2)."""
        return self.samples[["x1", "x2"]].to_numpy(dtype=np.float64)

    @cached_property
    def n_pilot(self) -> int:
        """Number of samples before the first decision."""
        return int(np.sum(self.epoch == 0))

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """Bounds xmin, xmax, ymin, ymax of the workspace."""
        xmin, xmax, ymin, ymax = (float(bound) for bound in self.option("terrain.extent"))
        return xmin, xmax, ymin, ymax

    @cached_property
    def length_tolerance(self) -> float:
        """How far rounding may move a position, workspace units."""
        return ROUNDING * max(1.0, *(abs(bound) for bound in self.extent))

    @cached_property
    def elevation_tolerance(self) -> float:
        """How far rounding may move an elevation, terrain's unit."""
        return ROUNDING * max(1.0, float(np.abs(self.maps["truth"]).max()))

    @cached_property
    def judgements(self) -> list[tuple[Floats, Booleans] | None]:
        """Scores and flags of the samples so far as they stood after each epoch, if known."""
        return _replay_detector(self)


def audit(
    results_dir: Path,
    run: str | None = None,
    seeds: list[int] | None = None,
    terrains: Mapping[str, NDArray[Any]] | None = None,
) -> Iterator[Finding]:
    """Recompute all stored missions, or some of them.

    Parameters
    ----------
    results_dir
        The folder that holds ``runs``, ``curves``, ``samples`` and ``maps``.
    run
        Name of a run; None for all.
    seeds
        Seeds to look at; None for all.
    terrains
        Elevations by the digest of the terrain, each of shape (R, C); only a run whose terrain is
        among them has its truth checked.

    Returns
    -------
    iterator of Finding
        Mission by mission, computed as it is asked for.

    Raises
    ------
    UsageError
        If nothing of what is asked for is stored.
    """
    stored = _stored_missions(results_dir)
    if not stored:
        raise UsageError(
            f"results_dir={results_dir} holds no finished mission to audit: fly one with "
            "infoplan run, or name the folder that holds curves/"
        )
    runs = sorted({name for name, _ in stored})
    if run is not None:
        if run not in runs:
            raise UsageError(f"run={run} is not stored in {results_dir}: use {' or '.join(runs)}")
        stored = [(name, seed) for name, seed in stored if name == run]
    if seeds is not None:
        present = sorted({seed for _, seed in stored})
        missing = [seed for seed in seeds if seed not in present]
        if missing:
            raise UsageError(
                f"seeds={missing} of {run or 'any run'} are not stored in {results_dir}: "
                f"use some of {present}"
            )
        stored = [(name, seed) for name, seed in stored if seed in seeds]
    return (
        finding
        for name, seed in stored
        for finding in audit_mission(results_dir, name, seed, terrains=terrains)
    )


def audit_mission(
    results_dir: Path,
    run: str,
    seed: int,
    terrains: Mapping[str, NDArray[Any]] | None = None,
) -> list[Finding]:
    """Recompute one stored mission.

    Parameters
    ----------
    results_dir, run, seed
        Where, and which.
    terrains
        Elevations by the terrain's digest, as in `audit`.

    Returns
    -------
    list of Finding
        One a check. A file that is missing, truncated or of another kind is a failed finding, and
        the only one.
    """
    try:
        mission = _read_mission(results_dir, run, seed, terrains or {})
    except _FaultError as fault:
        return [Finding(run, seed, "files", False, str(fault))]
    columns = sum(len(table.columns) for table in (mission.curves, mission.samples, mission.maps))
    findings = [Finding(run, seed, "files", True, f"3 tables with {columns} columns and a YAML")]
    for name, check in CHECKS.items():
        try:
            detail, holds = check(mission), True
        except _FaultError as fault:
            detail, holds = str(fault), False
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            # The tables are so far off that the recomputation itself breaks.
            detail, holds = f"cannot be recomputed ({type(error).__name__}: {error})", False
        if detail:
            findings.append(Finding(run, seed, name, holds, " ".join(detail.split())))
    return findings


def render(findings: Iterable[Finding]) -> str:
    """Lay findings out as a plain table, grouped by run.

    Parameters
    ----------
    findings
        Of any number of missions.

    Returns
    -------
    str
        A line a run and check: ``holds`` or ``FAILS``, how many missions do, and the detail of
        each that fails, or of the only one there is; the last line counts everything.
    """
    everything = list(findings)
    lines = []
    for run in dict.fromkeys(finding.run for finding in everything):
        of_run = [finding for finding in everything if finding.run == run]
        missions = len({finding.seed for finding in of_run})
        lines.append(f"{run}: {_missions(missions)}")
        for check in dict.fromkeys(finding.check for finding in of_run):
            lines += _render_check([finding for finding in of_run if finding.check == check])
        lines.append("")
    failed = sum(not finding.holds for finding in everything)
    missions = len({(finding.run, finding.seed) for finding in everything})
    verdict = f"{failed} FAIL" if failed else "all hold"
    lines.append(f"{_missions(missions)}, {len(everything)} checks: {verdict}")
    return "\n".join(lines)


def _missions(count: int) -> str:
    return f"{count} mission{'' if count == 1 else 's'}"


def _render_check(findings: list[Finding]) -> list[str]:
    """Lines of one check of one run."""
    failed = [finding for finding in findings if not finding.holds]
    count = f"{len(failed) or len(findings)} of {len(findings)}"
    head = f"  {findings[0].check:<17} {'FAILS' if failed else 'holds'} {count:>9}"
    if failed:
        details = [f"seed {finding.seed}: {finding.detail}" for finding in failed]
    else:
        details = [findings[0].detail] if len(findings) == 1 else [""]
    return [
        f"{head if i == 0 else ' ' * len(head)}  {detail}".rstrip()
        for i, detail in enumerate(details)
    ]


# Reading


def _stored_missions(results_dir: Path) -> list[tuple[str, int]]:
    """Find the run and seed of every finished mission: one whose curve is there."""
    missions = []
    for path in results_dir.glob("curves/run=*/seed=*.parquet"):
        seed = path.stem.removeprefix("seed=")
        if seed.isdecimal():
            missions.append((path.parent.name.removeprefix("run="), int(seed)))
    return sorted(missions)


def _read_mission(
    results_dir: Path, run: str, seed: int, terrains: Mapping[str, NDArray[Any]]
) -> _Mission:
    """Read the YAML and the three tables of a mission, and check their columns."""
    path = results_dir / "runs" / f"{run}.yaml"
    try:
        configuration = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise _FaultError(f"runs/{path.name} cannot be read ({type(error).__name__})") from error
    if not isinstance(configuration, dict):
        raise _FaultError(f"runs/{path.name} is no mapping of options")
    tables, footers = {}, {}
    for table in COLUMNS:
        tables[table], footers[table] = _read_table(results_dir, table, run, seed)
    return _Mission(configuration, **tables, footers=footers, run=run, seed=seed, terrains=terrains)


def _read_table(
    results_dir: Path, name: str, run: str, seed: int
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read a table and the JSON document in its footer (empty if there is none)."""
    path = results_dir / name / f"run={run}" / f"seed={seed}.parquet"
    try:
        # The file alone: reading it as a data set would add the partition's columns.
        with pq.ParquetFile(path) as file:
            table = file.read()
        footer = json.loads((table.schema.metadata or {}).get(b"infoplan", b"{}"))
    except (OSError, pa.ArrowException, ValueError) as error:
        raise _FaultError(f"{name} cannot be read ({type(error).__name__})") from error
    if "run" in table.column_names:
        raise _FaultError(f"{name} holds a column run, which is a partition and no column")
    for column, kind in COLUMNS[name].items():
        if table.column_names.count(column) != 1:
            raise _FaultError(f"{name} has not exactly one column {column}")
        if not _is_kind(table.schema.field(column).type, kind):
            found = table.schema.field(column).type
            raise _FaultError(f"{name}.{column} holds {found}, not {kind}")
        # A score that was never given is NaN, which some writers store as a missing value.
        if table[column].null_count and column != "score":
            raise _FaultError(f"{name}.{column} has {table[column].null_count} missing values")
    if table.num_rows == 0:
        raise _FaultError(f"{name} has no rows")
    return table.to_pandas(), footer if isinstance(footer, dict) else {}


def _is_kind(found: Any, kind: str) -> bool:
    """Tell whether an Arrow type holds what a column must hold."""
    if pa.types.is_dictionary(found):
        found = found.value_type
    if kind == "text":
        return bool(pa.types.is_string(found) or pa.types.is_large_string(found))
    if kind == "integer":
        return bool(pa.types.is_integer(found))
    return bool(found == (pa.float64() if kind == "double" else pa.bool_()))


# Tables


def _check_values(mission: _Mission) -> str:
    """Check that every number is finite, but for scores that were never given."""
    count = 0
    for name, columns in COLUMNS.items():
        table = getattr(mission, name)
        for column, kind in columns.items():
            if kind != "double" or column == "score" or column.endswith("_seconds"):
                continue
            if column in OF_THE_MODEL and mission.is_own("model"):
                continue
            _demand_finite(f"{name}.{column}", table[column].to_numpy())
            count += len(table)
    return f"{count} numbers are finite"


def _demand_finite(name: str, values: Floats) -> None:
    _demand(np.isfinite(values), lambda i: f"{name} is {values[i]} in row {i}")


def _check_rows(mission: _Mission) -> str:
    """Check that epochs are in order and that the samples match their counts and the budget."""
    curves, epoch = mission.curves, mission.epoch
    last, budget = len(curves) - 1, int(mission.option("budget"))
    _demand(
        curves["epoch"].to_numpy() == np.arange(last + 1),
        lambda i: f"row {i} of the curve is epoch {curves['epoch'][i]}",
    )
    _demand(
        np.diff(epoch, prepend=0) >= 0,
        lambda i: f"{mission.place(i)} comes after epoch {epoch[i - 1]}",
    )
    counts = np.array([np.sum(epoch <= e) for e in range(last + 1)])
    _demand(
        curves["collected"].to_numpy() == counts,
        lambda e: f"epoch {e} says {curves['collected'][e]} collected, the samples {counts[e]}",
    )
    _demand(np.diff(counts) > 0, lambda i: f"epoch {i + 1} collected nothing")
    pilot = int(mission.option("pilot.samples"))
    if counts[0] != pilot:
        raise _FaultError(f"the pilot has {counts[0]} samples, pilot.samples says {pilot}")
    if not len(epoch) == counts[-1] == budget:
        raise _FaultError(
            f"{len(epoch)} samples are stored, the last epoch has {counts[-1]}, the budget {budget}"
        )
    for name in COLUMNS:
        _demand_constant(f"{name}.seed", getattr(mission, name)["seed"], mission.seed)
    return f"{last} epochs after the pilot, {budget} samples"


def _check_configuration(mission: _Mission) -> str:
    """Check that the YAML, the curve's labels and the footers tell the same configuration."""
    labels = {
        "planner": "planner.name",
        "detector": "detector.name",
        "scope": "detector.scope",
        "rho": "rho",
        "terrain": "terrain.name",
    }
    for column, name in labels.items():
        _demand_constant(f"curves.{column}", mission.curves[column], mission.option(name))
    detector = mission.option("detector.name")
    if detector in ("none", "best") and mission.option("detector.scope") != "batch":
        raise _FaultError(f"detector {detector} is not stored as batch")
    documents = {name: footer for name, footer in mission.footers.items() if footer}
    for name, footer in documents.items():
        for key, expected in (("run", mission.run), ("seed", mission.seed)):
            if footer.get(key, expected) != expected:
                raise _FaultError(f"the footer of {name} is of {key} {footer[key]}")
        difference = _difference(mission.configuration, footer.get("configuration"))
        if difference:
            raise _FaultError(f"the footer of {name} differs from the YAML: {difference}")
    return f"labels and {len(documents)} footers agree with the YAML"


def _demand_constant(name: str, column: "pd.Series[Any]", expected: Any) -> None:
    values = column.to_numpy()
    _demand(values == expected, lambda i: f"{name} is {values[i]} in row {i}, not {expected}")


def _difference(expected: Any, found: Any, name: str = "") -> str:
    """Describe the first option that two nested mappings do not share; empty if there is none."""
    if isinstance(expected, Mapping) and isinstance(found, Mapping):
        for key in [*expected, *(key for key in found if key not in expected)]:
            dotted = f"{name}.{key}" if name else str(key)
            if key not in expected or key not in found:
                return f"{dotted} is in one of them only"
            inner = _difference(expected[key], found[key], dotted)
            if inner:
                return inner
        return ""
    return "" if expected == found else f"{name or 'configuration'}={found}, the YAML {expected}"


def _check_grid(mission: _Mission) -> str:
    """Check that the map's nodes span the workspace, row by row, y then x."""
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    xmin, xmax, ymin, ymax = mission.extent
    if len(mission.maps) != rows * columns:
        raise _FaultError(f"the map has {len(mission.maps)} nodes, not {rows} x {columns}")
    nodes = [
        (xmin + j * (xmax - xmin) / (columns - 1), ymin + i * (ymax - ymin) / (rows - 1))
        for i in range(rows)
        for j in range(columns)
    ]
    found = mission.maps[["x1", "x2"]].to_numpy()
    _demand(
        np.abs(found - nodes).max(axis=1) <= mission.length_tolerance,
        lambda i: f"node {i} lies at {_point(found[i])}, not at {_point(nodes[i])}",
    )
    return f"{rows} x {columns} nodes, y then x"


# Robot


def _check_pilot(mission: _Mission) -> str:
    """Check that the pilot samples lie on the Bezier curve, even in its parameter."""
    n = mission.n_pilot
    xmin, xmax, ymin, ymax = mission.extent
    fractions = np.asarray(mission.option("pilot.control_points"), dtype=np.float64)
    points = np.array([xmin, ymin]) + fractions * np.array([xmax - xmin, ymax - ymin])
    curve = BPoly(points[:, None, :], [0.0, 1.0])
    expected = curve(np.linspace(0.0, 1.0, n))
    away = np.hypot(*(mission.x[:n] - expected).T)
    _demand(
        away <= mission.length_tolerance,
        lambda i: f"{mission.place(i)} is {away[i]:.3g} off the Bezier curve",
    )
    tangent = curve.derivative()(1.0)
    if np.hypot(*tangent) > mission.length_tolerance:
        turn = _wrapped(mission.samples["heading"][n - 1] - math.atan2(tangent[1], tangent[0]))
        if not abs(turn) <= ROUNDING:
            raise _FaultError(f"{mission.place(n - 1)} heads {turn:.3g} rad off the curve's end")
    return f"{n} samples within {away.max():.1g} of a curve of degree {len(points) - 1}"


def _driven(mission: _Mission) -> tuple[Floats, NDArray[np.int64]]:
    """Work out the direction in which each sample after the pilot was driven to.

    Returns
    -------
    direction : ndarray, shape (n - n_pilot,)
        Heading before the move, turns on the spot included, radians.
    spot_turns : ndarray of int, shape (n - n_pilot,)
        Turns of pi/8 before the move, modulo 16; 0 but at the first sample of an epoch.
    """
    start = mission.n_pilot - 1
    heading = mission.samples["heading"].to_numpy()[start:-1]
    step = np.diff(mission.x[start:], axis=0)
    first = np.diff(mission.epoch[start:]) != 0
    eighths = (np.arctan2(step[:, 1], step[:, 0]) - heading) / (np.pi / 8)
    spot_turns = np.where(first, np.round(eighths).astype(np.int64) % 16, 0)
    return heading + spot_turns * np.pi / 8, spot_turns


def _check_steps(mission: _Mission) -> str:
    """Check that each sample is one step along the heading before it (Euler, move then turn)."""
    start, speed = mission.n_pilot, float(mission.option("robot.speed"))
    direction, _ = _driven(mission)
    expected = mission.x[start - 1 : -1] + speed * np.column_stack(
        [np.cos(direction), np.sin(direction)]
    )
    away = np.hypot(*(mission.x[start:] - expected).T)
    _demand(
        away <= mission.length_tolerance,
        lambda i: (
            f"{mission.place(start + i)} is {away[i]:.3g} off one step of {speed:g} "
            "along the heading before it"
        ),
    )
    return f"{len(away)} steps of {speed:g} within {away.max():.1g}"


def _check_actions(mission: _Mission) -> str:
    """Check that turns are steering angles, constant within an action; epochs are whole actions."""
    start, length = mission.n_pilot, int(mission.option("robot.samples_per_action"))
    limit = mission.option("planner.execute_actions")
    steering = _steering(mission)
    direction, _ = _driven(mission)
    turn = _wrapped(mission.samples["heading"].to_numpy()[start:] - direction)
    off = np.abs(turn[:, None] - steering).min(axis=1)
    _demand(
        off <= ROUNDING,
        lambda i: f"{mission.place(start + i)} turns by {turn[i]:.6g}, which is no steering angle",
    )
    actions, last = 0, int(mission.epoch[-1])
    for e in range(1, last + 1):
        batch = np.flatnonzero(mission.epoch == e)
        if e < last and len(batch) % length:
            raise _FaultError(f"epoch {e} has {len(batch)} samples, no whole actions of {length}")
        count = math.ceil(len(batch) / length)
        if limit is not None and count > int(limit):
            raise _FaultError(f"epoch {e} drives {count} actions, execute_actions={limit}")
        for i in batch.tolist():
            begin = batch[0] + (i - batch[0]) // length * length
            if not abs(turn[i - start] - turn[begin - start]) <= ROUNDING:
                raise _FaultError(
                    f"{mission.place(i)} turns by {turn[i - start]:.6g}, its action at first by "
                    f"{turn[begin - start]:.6g}"
                )
        actions += count
    return f"{actions} actions of {length} samples in {last} epochs"


def _check_spot_turns(mission: _Mission) -> str:
    """Check that the car turns on the spot only where no action stays in the workspace."""
    _, spot_turns = _driven(mission)
    heading = mission.samples["heading"].to_numpy()
    turned = np.flatnonzero(spot_turns)
    for i in turned:
        before = mission.n_pilot + int(i) - 1
        count = int(spot_turns[i])
        ways = (range(count), range(0, count - 16, -1))
        # The direction of the turn is not laid down: one of both ways must have been blocked.
        if not any(
            all(_is_blocked(mission, before, heading[before] + k * np.pi / 8) for k in way)
            for way in ways
        ):
            raise _FaultError(
                f"{mission.place(before + 1)} follows a turn on the spot by {count} pi/8, though "
                "an action was left"
            )
    return f"{len(turned)} epochs begin with a turn on the spot"


def _is_blocked(mission: _Mission, sample: int, heading: float) -> bool:
    """Tell whether every action from a sample's position leaves the workspace."""
    speed = float(mission.option("robot.speed"))
    xmin, xmax, ymin, ymax = mission.extent
    inset = mission.length_tolerance
    for u in _steering(mission):
        angles = heading + u * np.arange(int(mission.option("robot.samples_per_action")))
        x = mission.x[sample, 0] + np.cumsum(speed * np.cos(angles))
        y = mission.x[sample, 1] + np.cumsum(speed * np.sin(angles))
        in_x = (x >= xmin + inset) & (x <= xmax - inset)
        if np.all(in_x & (y >= ymin + inset) & (y <= ymax - inset)):
            return False
    return True


def _check_workspace(mission: _Mission) -> str:
    """Check that no sample lies outside the workspace, and headings are in [0, 2 pi)."""
    xmin, xmax, ymin, ymax = mission.extent
    low, high = np.array([xmin, ymin]), np.array([xmax, ymax])
    outside = np.maximum(low - mission.x, mission.x - high).max(axis=1)
    _demand(
        outside <= mission.length_tolerance,
        lambda i: f"{mission.place(i)} lies {outside[i]:.3g} outside the workspace",
    )
    heading = mission.samples["heading"].to_numpy()
    _demand(
        (heading >= 0.0) & (heading < 2.0 * np.pi),
        lambda i: f"{mission.place(i)} has the heading {heading[i]:.6g}, not in [0, 2 pi)",
    )
    return f"{len(heading)} samples in [{xmin:g}, {xmax:g}] x [{ymin:g}, {ymax:g}]"


def _steering(mission: _Mission) -> Floats:
    """Return the turns a sample of the actions, even in [-max, max]; one alone is straight."""
    count = int(mission.option("robot.steering_angles"))
    largest = float(mission.option("robot.max_steering"))
    return np.linspace(-largest, largest, count) if count > 1 else np.zeros(1)


# Sensing


def _check_truth(mission: _Mission) -> str:
    """Check that the truth of samples and map is the bilinear terrain, if the terrain is given."""
    terrain = mission.terrains.get(mission.option("terrain.sha256"))
    if terrain is None:
        return ""
    xmin, xmax, ymin, ymax = mission.extent
    rows, columns = terrain.shape
    axes = (np.linspace(ymin, ymax, rows), np.linspace(xmin, xmax, columns))
    surface = RegularGridInterpolator(axes, terrain, bounds_error=False, fill_value=None)
    largest = 0.0
    for name, table in (("node", mission.maps), ("sample", mission.samples)):
        expected = surface(table[["x2", "x1"]].to_numpy())
        found = table["truth"].to_numpy()
        _demand_close(f"the truth of {name}", found, expected, mission.elevation_tolerance)
        largest = max(largest, float(np.abs(found - expected).max()))
    return f"truth within {largest:.1g} of the bilinear terrain"


def _check_sensor(mission: _Mission) -> str:
    """Check that measurements without a spike are the truth plus the sensor's Gaussian noise."""
    sigma = float(mission.option("sensor.noise_std"))
    clean = np.flatnonzero(~mission.samples["is_outlier"].to_numpy())
    noise = (mission.samples["measured"] - mission.samples["truth"]).to_numpy()[clean]
    n = len(noise)
    # Every bound holds for an honest sensor but for a chance of CHANCE, shared by both sides.
    reach = stats.norm.isf(CHANCE / 2 / n) * sigma + mission.elevation_tolerance
    _demand(
        np.abs(noise) <= reach,
        lambda i: f"{mission.place(clean[i])} is {noise[i]:.3g} off the truth without a spike",
    )
    mean, std = float(noise.mean()), float(np.sqrt(np.mean(noise**2)))
    if not abs(mean) <= stats.norm.isf(CHANCE / 2) * sigma / math.sqrt(n) + reach * ROUNDING:
        raise _FaultError(f"the noise has mean {mean:.3g} over {n} samples, sigma {sigma:g}")
    low, high = np.sqrt(stats.chi2.ppf([CHANCE / 2, 1 - CHANCE / 2], n) / n) * sigma
    if not low - mission.elevation_tolerance <= std <= high + mission.elevation_tolerance:
        raise _FaultError(f"the noise has deviation {std:.4g} over {n} samples, not {sigma:g}")
    return f"noise of mean {mean:.3g} and deviation {std:.4g} over {n} samples"


def _spiked_epochs(mission: _Mission) -> range:
    """Epochs whose batches get spikes."""
    return range(0 if mission.option("pilot.outliers") else 1, len(mission.curves))


def _check_spike_count(mission: _Mission) -> str:
    """Check that as many samples of each batch are spikes as rho and the rule of counting say."""
    rho, rule = float(mission.option("rho")), mission.option("outliers.count")
    spiked = mission.samples["is_outlier"].to_numpy()
    if not mission.option("pilot.outliers"):
        _demand(
            ~spiked[mission.epoch == 0],
            lambda i: f"{mission.place(i)} is a spike, but the pilot has none",
        )
    sizes = {e: int(np.sum(mission.epoch == e)) for e in _spiked_epochs(mission)}
    for e, n in sizes.items():
        count = int(np.sum(spiked[mission.epoch == e]))
        if rule == "bernoulli":
            wrong = stats.binomtest(count, n, rho).pvalue < CHANCE / len(sizes)
        else:
            # A product such as 0.29 * 100 falls just short of the integer that is meant.
            exact = round(rho * n) if rule == "round" else math.floor(rho * n + ROUNDING)
            wrong = count != exact
        if wrong:
            raise _FaultError(f"epoch {e} has {count} spikes in {n} samples at rho {rho:g}, {rule}")
    total, judged = int(np.sum(spiked)), sum(sizes.values())
    if rule == "bernoulli" and sizes and stats.binomtest(total, judged, rho).pvalue < CHANCE:
        raise _FaultError(f"{total} spikes in {judged} samples at rho {rho:g}, bernoulli")
    return f"{total} spikes in {judged} samples of {len(sizes)} batches, {rule}"


def _spikes(mission: _Mission) -> pd.DataFrame:
    """List the spikes: sample, signed size, and bounds of the data range of its batch.

    What the noisy value of a spiked sample was before is known to within `SIGMAS` only, and so are
    the quantiles of its batch: they rise with every value, which bounds them.
    """
    reach = SIGMAS * float(mission.option("sensor.noise_std"))
    quantiles = [float(q) for q in mission.option("outliers.quantiles")]
    truth = mission.samples["truth"].to_numpy()
    measured = mission.samples["measured"].to_numpy()
    spiked = mission.samples["is_outlier"].to_numpy()
    records = []
    for e in _spiked_epochs(mission):
        batch = np.flatnonzero(mission.epoch == e)
        lowest = np.quantile(np.where(spiked, truth - reach, measured)[batch], quantiles)
        highest = np.quantile(np.where(spiked, truth + reach, measured)[batch], quantiles)
        # The range itself is no narrower than nothing.
        narrow = max(lowest[1] - highest[0], 0.0)
        records += [
            {
                "sample": i,
                "rank": (position + 0.5) / len(batch),
                "batch": len(batch),
                "size": measured[i] - truth[i],
                "narrow": narrow,
                "wide": highest[1] - lowest[0],
            }
            for position, i in enumerate(batch)
            if spiked[i]
        ]
    return pd.DataFrame(
        records, columns=["sample", "rank", "batch", "size", "narrow", "wide"]
    ).astype({"sample": np.int64})


def _check_spike_size(mission: _Mission) -> str:
    """Check that each spike is as high as an amplitude within its bounds makes it."""
    smallest, largest = (float(bound) for bound in mission.option("outliers.amplitude"))
    reach = SIGMAS * float(mission.option("sensor.noise_std")) + mission.elevation_tolerance
    spikes = _spikes(mission)
    if spikes.empty:
        return "no spikes"
    size = spikes["size"].abs().to_numpy()
    low = smallest * spikes["narrow"].to_numpy() - reach
    high = largest * spikes["wide"].to_numpy() + reach
    _demand(
        (size >= low) & (size <= high),
        lambda i: (
            f"{mission.place(spikes['sample'][i])} is a spike of {size[i]:.4g}, not within "
            f"{max(low[i], 0.0):.4g} and {high[i]:.4g}"
        ),
    )
    return f"{len(spikes)} spikes from {size.min():.4g} to {size.max():.4g}"


def _check_spike_draws(mission: _Mission) -> str:
    """Check that amplitudes are uniform, signs and places in the batch even."""
    smallest, largest = (float(bound) for bound in mission.option("outliers.amplitude"))
    reach = SIGMAS * float(mission.option("sensor.noise_std"))
    spikes = _spikes(mission)
    m = len(spikes)
    if m:
        # Without replacement the places spread less than this: the bound is on the safe side.
        variance = np.sum((1 - 1 / spikes["batch"] ** 2) / 12) / m**2
        shift = spikes["rank"].mean() - 0.5
        if not abs(shift) <= stats.norm.isf(CHANCE / 2) * math.sqrt(variance) + ROUNDING:
            raise _FaultError(f"{m} spikes lie {shift:+.3f} of a batch off its middle on average")
    middle = (spikes["narrow"] + spikes["wide"]) / 2
    # Only spikes far above the noise tell their sign and amplitude.
    blur = (reach + largest * (spikes["wide"] - spikes["narrow"]) / 2) / middle.where(middle > 0)
    clear = blur < 0.05 * (largest - smallest)
    k = int(clear.sum())
    if not k:
        return f"{m} spikes, none clear of the noise"
    positive = int((spikes["size"][clear] > 0).sum())
    if smallest > 0.05 * (largest - smallest) and stats.binomtest(positive, k).pvalue < CHANCE:
        raise _FaultError(f"{positive} of {k} spikes point up")
    amplitude = (spikes["size"].abs() / middle)[clear].to_numpy()
    uniform = stats.uniform(smallest, largest - smallest)
    distance = stats.kstest(amplitude, uniform.cdf).statistic
    # An amplitude that is off by its blur moves the distribution by no more than that share.
    certain = distance - float(blur[clear].max()) / (largest - smallest)
    if certain > 0 and stats.kstwo.sf(certain, k) < CHANCE:
        raise _FaultError(
            f"the amplitudes of {k} spikes, mean {amplitude.mean():.3f}, are not uniform in "
            f"[{smallest:g}, {largest:g}]"
        )
    return f"{k} clear spikes: mean amplitude {amplitude.mean():.3f}, {positive} point up"


# Detector


def _replay_detector(mission: _Mission) -> list[tuple[Floats, Booleans] | None]:
    """Judge the samples again, epoch by epoch, on what was there by then.

    Returns
    -------
    list of (scores, flags) or None
        One entry for each epoch, of all samples collected by then, as the mission then held them:
        scope batch keeps a sample's first judgement, historical the latest; the pilot is judged
        by historical only. None where a detector that cannot be repeated has judged since; what
        it said at last is taken from the table.
    """
    if not _is_repeatable(mission):
        return _stored_judgements(mission)
    historical = mission.option("detector.scope") == "historical"
    scores, flags = np.full(mission.n_pilot, np.nan), np.zeros(mission.n_pilot, dtype=bool)
    judgements: list[tuple[Floats, Booleans] | None] = [(scores, flags)]
    for e in range(1, len(mission.curves)):
        n = int(np.sum(mission.epoch <= e))
        kept = 0 if historical else len(scores)
        accepted = np.append(~flags[:kept], np.ones(n - kept, dtype=bool))
        new_scores, new_flags = _judge(mission, e, accepted, np.arange(n) >= kept)
        scores = np.concatenate([scores[:kept], new_scores[kept:]])
        flags = np.concatenate([flags[:kept], new_flags[kept:]])
        judgements.append((scores, flags))
    return judgements


def _is_repeatable(mission: _Mission) -> bool:
    """Tell whether the detector can be repeated: not if it is, or needs, the user's own code."""
    needs_model = mission.option("detector.name") == "gp_residual"
    return not (mission.is_own("detector") or (needs_model and mission.is_own("model")))


def _judge(
    mission: _Mission, epoch: int, candidates: Booleans, judged: Booleans
) -> tuple[Floats, Booleans]:
    """Judge the samples collected by the end of an epoch.

    Parameters
    ----------
    epoch
        Which.
    candidates
        What the model holds unless it is flagged now, shape (n,).
    judged
        Whose judgement counts, shape (n,).

    Returns
    -------
    scores, flags : ndarrays, shape (n,)
    """
    n, name = len(judged), str(mission.option("detector.name"))
    measured = mission.samples["measured"].to_numpy()[:n]
    if name == "copod":
        return _copod(mission, measured)
    if name == "local":
        scores = repeat.local_scores(
            mission.x[:n], measured, candidates, judged, int(mission.option("detector.neighbours"))
        )
        return scores, scores > float(mission.option("detector.threshold"))
    if name == "gp_residual":
        x, y = _scaled_samples(mission)
        state = mission.curves.iloc[epoch - 1]  # the model has not seen the batch
        noise = state["noise_std"] ** 2 * _noise_factor(mission) + state["jitter"]
        return repeat.gp_residuals(
            x[:n], y[:n], _kernel(state), noise, candidates, judged,
            float(mission.option("detector.threshold")),
            bool(mission.option("detector.one_by_one")),
        )  # fmt: skip
    if name.startswith("pyod_"):
        columns = {"x1": "x1", "x2": "x2", "y": "measured"}
        features = [columns[feature] for feature in mission.option("detector.features")]
        return repeat.pyod_judgement(
            mission.samples[features].to_numpy()[:n],
            str(mission.option("detector.model")),
            float(mission.option("detector.contamination")),
            mission.option("detector.params"),
            np.random.SeedSequence(mission.seed, spawn_key=(4, epoch)),
        )
    outlier = mission.samples["is_outlier"].to_numpy()[:n]
    return np.full(n, np.nan), outlier if name == "best" else np.zeros(n, dtype=bool)


def _stored_judgements(mission: _Mission) -> list[tuple[Floats, Booleans] | None]:
    """Take the judgements of a detector that cannot be repeated from the table."""
    scores, flags = mission.samples["score"].to_numpy(), mission.samples["flagged"].to_numpy()
    last = len(mission.curves) - 1
    judgements: list[tuple[Floats, Booleans] | None] = []
    for e in range(last + 1):
        n = int(np.sum(mission.epoch <= e))
        known = e in (0, last) or mission.option("detector.scope") == "batch"
        nothing = (np.full(n, np.nan), np.zeros(n, dtype=bool))
        judgements.append((nothing if e == 0 else (scores[:n], flags[:n])) if known else None)
    return judgements


def _copod(mission: _Mission, measured: Floats) -> tuple[Floats, Booleans]:
    """Score and flag measurements by COPOD (paper, Section IV-A), shapes (n,)."""
    contamination = float(mission.option("detector.contamination"))
    if mission.option("detector.score") == "pyod":
        # PyOD imports a plotting library: only an audit that needs it waits for that.
        from pyod.models.copod import COPOD

        detector = COPOD(contamination=contamination).fit(measured.reshape(-1, 1))
        return detector.decision_scores_, detector.labels_ == 1
    n = len(measured)
    left = np.array([np.count_nonzero(measured <= y) for y in measured]) / n
    right = np.array([np.count_nonzero(measured >= y) for y in measured]) / n
    corrected = left if stats.skew(measured) < 0 else right
    scores = np.max([-np.log(left), -np.log(right), -np.log(corrected)], axis=0)
    return scores, scores > np.percentile(scores, 100 * (1 - contamination))


def _check_scores(mission: _Mission) -> str:
    """Check that the detector's scores are PyOD's, or those of its formula."""
    if not _is_repeatable(mission):
        return ""
    judgement = mission.judgements[-1]
    assert judgement is not None
    expected, _ = judgement
    found = mission.samples["score"].to_numpy()
    solved = mission.option("detector.name") == "gp_residual"
    allowed = REPLAYED_PRECISION if solved else ROUNDING
    _demand(
        np.isclose(found, expected, rtol=allowed, atol=allowed, equal_nan=True),
        lambda i: f"{mission.place(i)} has the score {found[i]:.6g}, not {expected[i]:.6g}",
    )
    return f"{np.isfinite(expected).sum()} scores agree"


def _check_flags(mission: _Mission) -> str:
    """Check that the flags are the detector's, and what is not flagged is used."""
    judgement = mission.judgements[-1]
    assert judgement is not None
    _, expected = judgement
    flagged, used = mission.samples["flagged"].to_numpy(), mission.samples["used"].to_numpy()
    _demand(
        flagged == expected,
        lambda i: f"{mission.place(i)} is {'' if flagged[i] else 'not '}flagged, wrongly",
    )
    _demand(
        used != flagged,
        lambda i: f"{mission.place(i)} is {'both' if used[i] else 'neither'} flagged and used",
    )
    return f"{flagged.sum()} of {len(flagged)} samples are flagged"


def _check_confusion(mission: _Mission) -> str:
    """Check that confusion counts and accepted samples of every epoch follow from the flags."""
    outlier = mission.samples["is_outlier"].to_numpy()
    for e, judgement in enumerate(mission.judgements):
        if judgement is None:
            continue
        _, flags = judgement
        judged = mission.epoch[: len(flags)] == e
        if mission.option("detector.scope") == "historical":
            judged[:] = True
        if e == 0:
            judged[:] = False
        expected = {
            "accepted": int(np.sum(~flags)),
            "tp": int(np.sum(judged & flags & outlier[: len(flags)])),
            "fp": int(np.sum(judged & flags & ~outlier[: len(flags)])),
            "fn": int(np.sum(judged & ~flags & outlier[: len(flags)])),
            "tn": int(np.sum(judged & ~flags & ~outlier[: len(flags)])),
        }
        for column, count in expected.items():
            if mission.curves[column][e] != count:
                raise _FaultError(
                    f"epoch {e} has {column} {mission.curves[column][e]}, recounted {count}"
                )
    counts = [f"{column} {mission.curves[column].sum()}" for column in ("tp", "fp", "fn", "tn")]
    return f"{len(mission.curves)} epochs recounted, sums {', '.join(counts)}"


def _check_density(mission: _Mission) -> str:
    """Check that the outlier density is the smoothed count of flagged samples by nearest node."""
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    xmin, xmax, ymin, ymax = mission.extent
    extent, last = np.array([ymax - ymin, xmax - xmin]), np.array([rows - 1, columns - 1])
    counts = np.zeros((rows, columns))
    for x, y in mission.x[mission.samples["flagged"].to_numpy()]:
        # Multiplied before dividing: the car may start exactly half-way between two nodes.
        nearest = np.floor((np.array([y, x]) - [ymin, xmin]) * last / extent + 0.5).astype(int)
        row, column = np.clip(nearest, 0, last)
        counts[row, column] += 1
    sigma = float(mission.option("planner.smoothing")) * last / extent
    expected = gaussian_filter(counts, sigma, mode="nearest").ravel()
    found = mission.maps["outlier_density"].to_numpy()
    allowed = ROUNDING * max(1.0, float(counts.max()))
    _demand_close("the outlier density at node", found, expected, allowed)
    return f"{counts.sum():.0f} flagged samples, largest density {expected.max():.4g}"


# Model


def _check_hyperparameters(mission: _Mission) -> str:
    """Check that hyperparameters keep their floors, and stay where nothing is learned."""
    if mission.is_own("model"):
        return ""
    curves = mission.curves
    floor = float(mission.option("model.min_noise_variance"))
    names = ["amplitude", "lengthscale_1", "lengthscale_2", "noise_std"]
    _demand(
        (curves[names] > 0).all(axis=1).to_numpy(),
        lambda e: f"a hyperparameter of epoch {e} is not positive",
    )
    _demand(
        (curves["noise_std"] ** 2 >= floor * (1 - ROUNDING)).to_numpy(),
        lambda e: f"the noise variance of epoch {e} is {curves['noise_std'][e] ** 2:.4g} < {floor}",
    )
    jitter = float(mission.option("model.jitter"))
    _demand(
        (curves["jitter"] >= jitter * (1 - ROUNDING)).to_numpy(),
        lambda e: f"the jitter of epoch {e} is {curves['jitter'][e]:.4g} < {jitter}",
    )
    if mission.option("model.pilot_iterations") == 0:
        untouched = curves if mission.option("model.iterations") == 0 else curves[:1]
        for name, start in zip(names, ["amplitude", "lengthscale", "lengthscale"], strict=False):
            expected = float(mission.option(f"model.{start}"))
            values = untouched[name].to_numpy()
            _demand_close(f"{name} of untrained epoch", values, expected, ROUNDING * expected)
    last = curves.iloc[-1]
    return "at the end " + ", ".join(f"{name} {last[name]:.4g}" for name in [*names, "jitter"])


def _fit(mission: _Mission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Fit scikit-learn's Gaussian process with the hyperparameters of a row of the curve.

    Parameters
    ----------
    row
        Epoch whose hyperparameters count.
    used
        Which of the first samples the model holds, shape (m,).

    Returns
    -------
    mean, std : ndarrays, shape (rows * columns,)
        Latent prediction on the query grid, terrain's unit.
    lml : float
        Log marginal likelihood, scaled units.
    """
    state = mission.curves.iloc[row]
    model = GaussianProcessRegressor(
        _kernel(state), alpha=state["noise_std"] ** 2 + state["jitter"], optimizer=None
    )
    x, y = _scaled_samples(mission)
    model.fit(x[: len(used)][used], y[: len(used)][used])
    mean, std = model.predict(_scaled(mission, mission.maps), return_std=True)
    centre, scale = _elevation_scaler(mission)
    return centre + scale * mean, scale * std, float(model.log_marginal_likelihood_value_)


def _fit_student_t(mission: _Mission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Do as `_fit` for Student-t noise, from the stored map: the posterior's mode nearest to it."""
    state = mission.curves.iloc[row]
    x, y = _scaled_samples(mission)
    centre, scale = _elevation_scaler(mission)
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    axes = (np.unique(mission.maps["x2"]), np.unique(mission.maps["x1"]))
    surface = RegularGridInterpolator(
        axes, mission.maps["mean"].to_numpy().reshape(rows, columns), bounds_error=False,
        fill_value=None,
    )  # fmt: skip
    start = (surface(mission.x[: len(used)][used][:, ::-1]) - centre) / scale
    mean, std, lml = repeat.student_t(
        x[: len(used)][used], y[: len(used)][used], _scaled(mission, mission.maps), _kernel(state),
        state["noise_std"], float(mission.option("model.dof")), state["jitter"], start,
    )  # fmt: skip
    return centre + scale * mean, scale * std, lml


def _elevation_scaler(mission: _Mission) -> tuple[float, float]:
    """Mean and deviation of the pilot's measurements."""
    pilot = mission.samples["measured"].to_numpy()[: mission.n_pilot]
    return float(pilot.mean()), float(pilot.std())


def _scaled(mission: _Mission, places: pd.DataFrame) -> Floats:
    """Positions in units of the pilot's bounding box, shape (n, 2)."""
    pilot = mission.x[: mission.n_pilot]
    low, high = pilot.min(axis=0), pilot.max(axis=0)
    scaled: Floats = 2.0 * (places[["x1", "x2"]].to_numpy() - low) / (high - low) - 1.0
    return scaled


def _scaled_samples(mission: _Mission) -> tuple[Floats, Floats]:
    """Positions and measurements of all samples, scaled as the model has them."""
    centre, scale = _elevation_scaler(mission)
    return _scaled(mission, mission.samples), (
        mission.samples["measured"].to_numpy() - centre
    ) / scale


def _kernel(state: "pd.Series[Any]") -> Any:
    """Kernel with the hyperparameters of a row of the curve."""
    lengthscales = [state["lengthscale_1"], state["lengthscale_2"]]
    return ConstantKernel(state["amplitude"] ** 2, "fixed") * RBF(lengthscales, "fixed")


def _noise_factor(mission: _Mission) -> float:
    """Variance of the observation noise over its squared scale."""
    if mission.option("model.name") != "student_t":
        return 1.0
    dof = float(mission.option("model.dof"))
    return dof / (dof - 2.0)


def _precision(mission: _Mission) -> float:
    """Relative difference to allow to the model's numbers."""
    model = mission.configuration.get("model", {})
    return PRECISION[model.get("dtype", "float64")]


def _compare_row(mission: _Mission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Fit the model of a row of the curve, compare its scores, and return its prediction.

    Returns
    -------
    mean, std : ndarrays, shape (rows * columns,)
        As `_fit` gives them.
    tolerance : float
        What may lie between them and the mission's, terrain's unit.
    """
    fit = _fit_student_t if mission.option("model.name") == "student_t" else _fit
    mean, std, lml = fit(mission, row, used)
    precision = _precision(mission)
    measured = mission.samples["measured"].to_numpy()
    tolerance = precision * float(measured[: mission.n_pilot].std())
    recorded = float(mission.curves["lml"][row])
    if not abs(recorded - lml) <= precision * max(abs(lml), float(np.sum(used))):
        raise _FaultError(f"epoch {row} has lml {recorded:.8g}, recomputed {lml:.8g}")
    _compare_scores(mission, row, mean, std, tolerance, precision)
    return mean, std, tolerance


def _compare_scores(
    mission: _Mission, row: int, mean: Floats, std: Floats, tolerance: float, precision: float
) -> None:
    """Compare the scores of a row of the curve with those of a prediction.

    Parameters
    ----------
    row
        Epoch.
    mean, std
        Prediction on the query grid, shape (rows * columns,), terrain's unit.
    tolerance
        Difference allowed to errors and to the prediction, terrain's unit.
    precision
        Difference allowed to the negative log predictive density, relative above 1.
    """
    truth = mission.maps["truth"].to_numpy()
    error = np.abs(mean - truth)
    nlpd = float(-np.mean(stats.norm.logpdf(truth, mean, std)))
    expected = {
        "rmse": (float(np.sqrt(np.mean(error**2))), tolerance),
        "mae": (float(np.mean(error)), tolerance),
        "nlpd": (nlpd, precision * max(1.0, abs(nlpd))),
    }
    for name, (value, allowed) in expected.items():
        recorded = float(mission.curves[name][row])
        if not abs(recorded - value) <= allowed:
            raise _FaultError(f"epoch {row} has {name} {recorded:.8g}, recomputed {value:.8g}")
    # Nodes so near the bound that rounding decides may count or not.
    least = np.mean(error + tolerance <= NORMAL_95 * (std - tolerance))
    most = np.mean(error - tolerance <= NORMAL_95 * (std + tolerance))
    recorded = float(mission.curves["coverage95"][row])
    if not least - ROUNDING <= recorded <= most + ROUNDING:
        raise _FaultError(
            f"epoch {row} has coverage95 {recorded:.6g}, recomputed {least:.6g} to {most:.6g}"
        )


def _check_final_scores(mission: _Mission) -> str:
    """Check that the last row of the curve scores the stored map."""
    mean, std = mission.maps["mean"].to_numpy(), mission.maps["std"].to_numpy()
    _demand(std > 0, lambda i: f"node {i} has the standard deviation {std[i]:.6g}")
    last = len(mission.curves) - 1
    _compare_scores(mission, last, mean, std, mission.elevation_tolerance, ROUNDING)
    return f"RMSE {mission.curves['rmse'][last]:.6g} follows from the map"


def _check_final_model(mission: _Mission) -> str:
    """Check that scikit-learn, given the samples in use, predicts the stored map and last row.

    Student-t noise, which it has not, is recomputed step by step.
    """
    if mission.is_own("model"):
        return ""
    last = len(mission.curves) - 1
    used = mission.samples["used"].to_numpy()
    mean, std, tolerance = _compare_row(mission, last, used)
    parts = []
    for name, expected in (("mean", mean), ("std", std)):
        found = mission.maps[name].to_numpy()
        _demand_close(f"the {name} at node", found, expected, tolerance)
        parts.append(f"{name} within {np.abs(found - expected).max():.1g}")
    return f"{used.sum()} samples: {', '.join(parts)}"


def _check_earlier_models(mission: _Mission) -> str:
    """Check that scikit-learn, given what was in use by then, gives earlier rows of the curve."""
    if mission.is_own("model") or mission.option("model.name") == "student_t":
        return ""  # no map of then is stored, from which to find the same mode
    last = len(mission.curves) - 1
    rows = sorted({last * i // EARLIER_ROWS for i in range(EARLIER_ROWS)} - {last})
    known = {row: judgement for row in rows if (judgement := mission.judgements[row]) is not None}
    for row, (_, flags) in known.items():
        _compare_row(mission, row, ~flags)
    return f"epochs {', '.join(map(str, known)) or 'none'} give their rows"


CHECKS: dict[str, Callable[[_Mission], str]] = {
    "values": _check_values,
    "rows": _check_rows,
    "configuration": _check_configuration,
    "grid": _check_grid,
    "pilot": _check_pilot,
    "steps": _check_steps,
    "actions": _check_actions,
    "spot turns": _check_spot_turns,
    "workspace": _check_workspace,
    "truth": _check_truth,
    "sensor": _check_sensor,
    "spike count": _check_spike_count,
    "spike size": _check_spike_size,
    "spike draws": _check_spike_draws,
    "scores": _check_scores,
    "flags": _check_flags,
    "confusion": _check_confusion,
    "outlier density": _check_density,
    "hyperparameters": _check_hyperparameters,
    "final scores": _check_final_scores,
    "final model": _check_final_model,
    "earlier models": _check_earlier_models,
}
"""Checks by name, in order; one that does not apply returns an empty sentence."""


# Tools


def _demand(holds: NDArray[np.bool_], describe: Callable[[int], str]) -> None:
    """Raise the description of the first entry that does not hold."""
    wrong = np.flatnonzero(~np.asarray(holds, dtype=bool))
    if len(wrong):
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        raise _FaultError(describe(int(wrong[0])) + more)


def _demand_close(name: str, found: Floats, expected: Any, allowed: float) -> None:
    """Raise the first entry that differs from its expected value by more than is allowed."""
    wanted = np.broadcast_to(np.asarray(expected, dtype=np.float64), found.shape)
    _demand(
        np.abs(found - wanted) <= allowed,
        lambda i: f"{name} {i} is {found[i]:.8g}, recomputed {wanted[i]:.8g}",
    )


def _wrapped(angle: Any) -> Any:
    """Angle in [-pi, pi), radians."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _point(position: Any) -> str:
    """Write a position."""
    return f"({position[0]:.6g}, {position[1]:.6g})"
