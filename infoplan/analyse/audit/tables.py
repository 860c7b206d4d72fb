"""Checks of the tables themselves: digests, values, rows, configuration, times, grid."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd

from infoplan.analyse.audit.stored import (
    ROUNDING,
    FaultError,
    Floats,
    Partial,
    StoredMission,
    demand,
    demand_close,
    is_told,
)
from infoplan.config import is_survey
from infoplan.study.store import disagreement
from infoplan.tables import DURATIONS, TABLES, Column

CLOCK_SECONDS, CLOCK_SHARE = 1.0, 0.01
"""What a clock that is set right meanwhile may explain, of a duration by two clocks."""


SILENT = ("dropout", "mixed")
"""Faults, besides the user's own, under which an outlier may have no measurement, NaN."""


def check_digests(mission: StoredMission) -> str | Partial:
    """Check that the files hold the values and footers that were written, all of one mission."""
    for name, footer in mission.footers.items():
        if footer.values_sha256 != mission.digests[name]:
            raise FaultError(f"{name} does not hold the values that were written")
    if differing := disagreement(list(mission.footers.values())):
        raise FaultError(f"the tables are not of one mission: their {differing}")
    detail = f"{len(mission.footers)} tables hold what was written"
    # One that does not agree with its footer is not even read.
    without = [name for name, footer in mission.footers.items() if footer.footer_sha256 is None]
    if without:
        return Partial(detail, f"footers of {', '.join(without)}, written without a digest")
    return detail


def check_times(mission: StoredMission) -> str:
    """Check that the times are possible: none negative, parts within the whole, clocks agreeing."""
    durations = [TABLES["curves"].columns[name] for name in DURATIONS]
    parts = mission.curves[[part.name for part in durations if is_told(mission.curves, part)]]
    for name in parts:
        values = parts[name].to_numpy()
        demand(
            np.isfinite(values) & (values >= 0),
            lambda e: f"epoch {e} has {name} {values[e]:g}",  # noqa: B023 - called at once
        )
    footer, spent = mission.footers["curves"], float(parts.to_numpy().sum())
    if spent > footer.seconds * (1 + ROUNDING) + 1e-3:
        raise FaultError(
            f"the epochs took {spent:.6g} s together, the footer says {footer.seconds:.6g} s"
        )
    started, ended = map(datetime.fromisoformat, (footer.started, footer.ended))
    passed = (ended - started).total_seconds()
    if passed < 0:
        raise FaultError(f"it ended {-passed:g} s before it started")
    if abs(passed - footer.seconds) > CLOCK_SECONDS + CLOCK_SHARE * footer.seconds:
        raise FaultError(
            f"{passed:.6g} s lie between start and end, the footer says {footer.seconds:.6g} s "
            "(a machine that slept meanwhile makes the same difference)"
        )
    return f"{spent:.4g} s of {footer.seconds:.4g} s are accounted for"


def check_bounds(mission: StoredMission) -> str:
    """Check that the scores of every epoch are possible at all, recomputed or not."""
    curves, nodes = mission.curves, len(mission.maps)
    rmse, mae = curves["rmse"].to_numpy(), curves["mae"].to_numpy()
    demand(
        (mae >= 0)
        & (mae <= rmse * (1 + ROUNDING))
        & (rmse <= mae * np.sqrt(nodes) * (1 + ROUNDING)),
        lambda e: f"epoch {e} cannot have RMSE {rmse[e]:.6g} and mae {mae[e]:.6g} together",
    )
    inside = curves["coverage95"].to_numpy() * nodes
    demand(
        (inside > -0.5) & (inside < nodes + 0.5) & (np.abs(inside - np.round(inside)) <= 1e-6),
        lambda e: f"epoch {e} has coverage95 {inside[e] / nodes:.6g}, no share of {nodes} nodes",
    )
    _check_followers(mission)
    return f"{len(curves)} epochs have possible scores"


def _check_followers(mission: StoredMission) -> None:
    """Check what follows in every epoch from other columns, the truth and the places."""
    curves, truth = mission.curves, mission.maps["truth"].to_numpy()
    columns = TABLES["curves"].columns
    squares = curves["rmse"].to_numpy() ** 2
    if is_told(curves, columns["smse"]) and np.var(truth) > 0:
        expected = squares / np.var(truth)
        demand_close("smse of epoch", curves["smse"].to_numpy(), expected, ROUNDING * expected)
    if is_told(curves, columns["rmse_flat"]):
        parts = {name: third.mean() for name, third in mission.thirds.items()}
        together = sum(
            share * curves[f"rmse_{name}"].to_numpy() ** 2 for name, share in parts.items()
        )
        demand_close("the square of the rmse of three thirds, epoch", together, squares,
                     ROUNDING * squares)  # fmt: skip
    if is_told(curves, columns["path_length"]):
        steps = np.append(0.0, np.linalg.norm(np.diff(mission.x, axis=0), axis=1))
        ways = np.array([steps[mission.epoch <= e].sum() for e in range(len(curves))])
        demand_close("path_length of epoch", curves["path_length"].to_numpy(), ways,
                     ROUNDING * ways)  # fmt: skip


def check_values(mission: StoredMission) -> str:
    """Check that every number is finite, but for what was never given, and possible."""
    count, surveyed = 0, is_survey(mission.option("terrain.name"))
    for name, table in mission.tables.items():
        for column in TABLES[name].columns.values():
            if column.kind not in ("integer", "double") or column.gaps or column.name in DURATIONS:
                continue
            if column.told_by and mission.is_own(column.told_by):
                continue
            if column.of_truth and surveyed:
                continue
            if is_told(table, column):
                values = table[column.name].to_numpy()
                if column.name == "measured" and _may_be_silent(mission):
                    silent = mission.samples["flagged" if surveyed else "is_outlier"].to_numpy()
                    values = values[mission.told | ~silent]
                _demand_possible(f"{name}.{column.name}", values, column)
                count += len(table) * (column.kind == "double")
    return f"{count} numbers are finite"


def _may_be_silent(mission: StoredMission) -> bool:
    """Tell whether an outlier of a mission, or any sample of a survey, may have no measurement."""
    surveyed = is_survey(mission.option("terrain.name"))
    return surveyed or mission.option("fault.name") in SILENT or mission.is_own("fault")


def _demand_possible(name: str, values: Floats, column: Column) -> None:
    demand(np.isfinite(values), lambda i: f"{name} is {values[i]} in row {i}")
    demand(
        (values >= column.at_least) & (values <= column.at_most),
        lambda i: (
            f"{name} is {values[i]:g} in row {i}, where it can only be "
            f"{column.at_least:g} to {column.at_most:g}"
        ),
    )


def check_rows(mission: StoredMission) -> str:
    """Check that epochs are in order and that the samples match their counts and the budget."""
    curves, epoch = mission.curves, mission.epoch
    last, budget = len(curves) - 1, int(mission.option("budget"))
    demand(
        curves["epoch"].to_numpy() == np.arange(last + 1),
        lambda i: f"row {i} of the curve is epoch {curves['epoch'][i]}",
    )
    demand(
        np.diff(epoch, prepend=0) >= 0,
        lambda i: f"{mission.place(i)} comes after epoch {epoch[i - 1]}",
    )
    counts = np.array([np.sum(epoch <= e) for e in range(last + 1)])
    demand(
        curves["collected"].to_numpy() == counts,
        lambda e: f"epoch {e} says {curves['collected'][e]} collected, the samples {counts[e]}",
    )
    demand(np.diff(counts) > 0, lambda i: f"epoch {i + 1} collected nothing")
    pilot = int(mission.option("pilot.samples"))
    if counts[0] != pilot:
        raise FaultError(f"the pilot has {counts[0]} samples, pilot.samples says {pilot}")
    if not len(epoch) == counts[-1] == budget:
        raise FaultError(
            f"{len(epoch)} samples are stored, the last epoch has {counts[-1]}, the budget {budget}"
        )
    for name, table in mission.tables.items():
        _demand_constant(f"{name}.seed", table["seed"], mission.seed)
    return f"{last} epochs after the pilot, {budget} samples"


def check_configuration(mission: StoredMission) -> str:
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
        raise FaultError(f"detector {detector} is not stored as batch")
    for name, footer in mission.footers.items():
        difference = _difference(mission.configuration, footer.configuration)
        if difference:
            raise FaultError(f"the footer of {name} differs from the YAML: {difference}")
    return f"labels and {len(mission.footers)} footers agree with the YAML"


def _demand_constant(name: str, column: "pd.Series[Any]", expected: Any) -> None:
    values = column.to_numpy()
    demand(values == expected, lambda i: f"{name} is {values[i]} in row {i}, not {expected}")


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


def check_grid(mission: StoredMission) -> str:
    """Check that the map's nodes span the workspace, row by row, y then x."""
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    xmin, xmax, ymin, ymax = mission.extent
    if len(mission.maps) != rows * columns:
        raise FaultError(f"the map has {len(mission.maps)} nodes, not {rows} x {columns}")
    nodes = [
        (xmin + j * (xmax - xmin) / (columns - 1), ymin + i * (ymax - ymin) / (rows - 1))
        for i in range(rows)
        for j in range(columns)
    ]
    found = mission.maps[["x1", "x2"]].to_numpy()
    demand(
        np.abs(found - nodes).max(axis=1) <= mission.length_tolerance,
        lambda i: f"node {i} lies at {_point(found[i])}, not at {_point(nodes[i])}",
    )
    return f"{rows} x {columns} nodes, y then x"


def _point(position: Any) -> str:
    """Write a position."""
    return f"({position[0]:.6g}, {position[1]:.6g})"
