"""Checks of the tables themselves: values, rows, configuration, grid."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from infoplan.analyse.audit.stored import (
    COLUMNS,
    OF_THE_MODEL,
    FaultError,
    Floats,
    StoredMission,
    demand,
)


def check_values(mission: StoredMission) -> str:
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
    demand(np.isfinite(values), lambda i: f"{name} is {values[i]} in row {i}")


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
    for name in COLUMNS:
        _demand_constant(f"{name}.seed", getattr(mission, name)["seed"], mission.seed)
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
    documents = {name: footer for name, footer in mission.footers.items() if footer}
    for name, footer in documents.items():
        for key, expected in (("run", mission.run), ("seed", mission.seed)):
            if footer.get(key, expected) != expected:
                raise FaultError(f"the footer of {name} is of {key} {footer[key]}")
        difference = _difference(mission.configuration, footer.get("configuration"))
        if difference:
            raise FaultError(f"the footer of {name} differs from the YAML: {difference}")
    return f"labels and {len(documents)} footers agree with the YAML"


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
