"""A finished mission laid out as tables."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from infoplan.config import is_survey
from infoplan.errors import RunError
from infoplan.methods import method_label
from infoplan.study.columns import lay_out
from infoplan.study.identity import Run

if TYPE_CHECKING:
    from infoplan.scoring import CurveRow, State, StretchScore


ERRORS = ("rmse", "mae", "nlpd", "coverage95")
"""Columns of the curve that score the model."""

COUNTS = ("tp", "fp", "fn", "tn")
"""Columns of the curve that score the detector."""


@dataclass
class MissionTables:
    """The tables of a finished mission; one that it has not is None."""

    curves: pa.Table
    samples: pa.Table
    maps: pa.Table
    stretches: pa.Table | None = None
    origins: pa.Table | None = None


def build_tables(
    run: Run,
    seed: int,
    rows: "Sequence[CurveRow]",
    last: "State",
    stretches: "Sequence[StretchScore]" = (),
    origins: Mapping[str, Any] | None = None,
) -> MissionTables:
    """Lay a finished mission out as tables: the columns of `infoplan.tables`, and what rows add.

    Parameters
    ----------
    run, seed
        Whose.
    rows
        Of all its states.
    last
        The last of them.
    stretches
        Those of all states of a survey, whose columns that need the truth are null.
    origins
        Of a survey of several logs, the columns of that table but for the seed.

    Raises
    ------
    RunError
        If an error is not finite though the truth is known: the model has predicted nonsense.
    """
    config, n, samples, maps = run.config, len(rows), last.samples, last.maps
    unknown = is_survey(config.terrain.name)
    if np.isfinite(maps.truth).all():
        for row in rows:
            _demand_finite(row, method_label(config.model))
    labels = {
        "planner": method_label(config.planner),
        "detector": method_label(config.detector),
        "scope": config.detector.scope,
        "rho": config.rho,
        "terrain": run.terrain.name,
    }
    return MissionTables(
        curves=lay_out(
            "curves",
            {name: [value] * n for name, value in labels.items()}
            | {"seed": [seed] * n}
            | _columns(rows)
            | ({count: [None] * n for count in COUNTS} if unknown else {}),
        ),
        samples=lay_out(
            "samples",
            {
                "seed": np.full(len(samples), seed),
                "epoch": samples.epoch,
                "x1": samples.x[:, 0],
                "x2": samples.x[:, 1],
                "heading": samples.heading,
                "truth": samples.truth,
                "measured": samples.measured,
                "score": samples.score,
                "is_outlier": [None] * len(samples) if unknown else samples.is_outlier,
                "flagged": samples.flagged,
                "used": ~samples.flagged,
            },
        ),
        maps=lay_out(
            "maps",
            {
                "seed": np.full(len(maps.x), seed),
                "x1": maps.x[:, 0],
                "x2": maps.x[:, 1],
                "truth": maps.truth,
                "mean": maps.mean,
                "std": maps.std,
                "outlier_density": maps.outlier_density,
            },
        ),
        stretches=lay_out("stretches", {"seed": [seed] * len(stretches)} | _columns(stretches))
        if stretches
        else None,
        origins=lay_out("origins", {"seed": [seed] * len(samples), **origins}) if origins else None,
    )


def _columns(rows: "Sequence[CurveRow | StretchScore]") -> dict[str, list[Any]]:
    """Turn rows into columns; a field that is a mapping gives a column for each of its names."""
    flat = [
        {name: value for item in fields(row)
         for name, value in _named(item.name, getattr(row, item.name)).items()}
        for row in rows
    ]  # fmt: skip
    return {name: [row[name] for row in flat] for name in flat[0]}


def _named(name: str, value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {name: value}


def _demand_finite(row: "CurveRow", model: str) -> None:
    wrong = [name for name in ERRORS if not math.isfinite(getattr(row, name))]
    if wrong:
        said = ", ".join(f"{name} is {getattr(row, name)}" for name in wrong)
        raise RunError(
            f"the model {model} predicts what cannot be scored in epoch {row.epoch} ({said}): "
            "choose other options of the model"
        )
