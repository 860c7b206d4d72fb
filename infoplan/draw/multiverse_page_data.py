"""What the page of a multiverse reads: curves of claims, universes, their Fig. 5 and verdicts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd

from infoplan.analyse.claims import COMPARISONS, TEXTS
from infoplan.analyse.judging import Comparison, corrected, overall
from infoplan.analyse.multiverse import (
    ClaimCurve,
    JointTest,
    effects_alone,
    effects_jointly,
    effects_of_rules,
    joint_test,
    nearness,
    pairs_of_choices,
)
from infoplan.analyse.statistics import mean_band
from infoplan.analyse.universe_numbers import Multiverse, OfUniverse
from infoplan.draw.claims_table import effect, stated
from infoplan.draw.line_panels import PANELS
from infoplan.draw.multiverse_table import chosen
from infoplan.draw.report_data import Panel, chart_line, method_looks, rounded
from infoplan.study.universes import CHOICES, METHODS, Universe


@dataclass(frozen=True)
class Moved:
    """What moves one claim.

    Attributes
    ----------
    alone, rules, jointly, pairs
        As `effects_alone`, `effects_of_rules`, `effects_jointly` and `pairs_of_choices` give them.
    test
        Over all universes at once.
    """

    alone: pd.DataFrame
    rules: pd.DataFrame
    jointly: pd.DataFrame
    pairs: pd.DataFrame
    test: JointTest


def what_moves(curve: ClaimCurve, multiverse: Multiverse) -> Moved:
    """Work out all that moves a claim."""
    return Moved(
        effects_alone(curve, multiverse), effects_of_rules(curve, multiverse),
        effects_jointly(curve, multiverse), pairs_of_choices(curve, multiverse), joint_test(curve),
    )  # fmt: skip


def page_data(
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    moved: Mapping[str, Moved],
    nearest: Sequence[str],
    commands: Callable[[Universe], Sequence[str]],
) -> dict[str, Any]:
    """Gather what the page reads; not known is null.

    Parameters
    ----------
    multiverse
        The numbers.
    curves
        Of the claims.
    moved
        What moves them, by name.
    nearest
        Universes nearest to the clip.
    commands
        Commands that fly a universe.
    """
    return {
        "unit": multiverse.unit,
        "axis": list(multiverse.axis),
        "methods": method_looks(METHODS),
        "choices": [{"name": one.name, "levels": list(one.levels)} for one in CHOICES],
        "universes": [
            {
                "name": one.name,
                "chosen": chosen(one),
                "levels": [list(c.levels).index(one.levels[c.name]) for c in CHOICES],
                "near": one.name in nearest,
                "commands": list(commands(one)),
                "panels": _panels(multiverse, multiverse.numbers[one.name]),
                "claims": [_judged(name, multiverse.numbers[one.name]) for name in TEXTS],
            }
            for one in multiverse.universes
        ],
        "claims": [_claim(curve, moved[curve.name], multiverse) for curve in curves],
    }


def summary_data(
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    moved: Mapping[str, Moved],
    nearest: Sequence[str],
) -> dict[str, Any]:
    """Gather how claims fare, for scripts: the page's without missions' curves and commands."""
    return {
        "terrain": multiverse.terrain,
        "unit": multiverse.unit,
        "budget": multiverse.budget,
        "model": multiverse.model,
        "seeds": sorted(int(seed) for seed in multiverse.missions["seed"].unique()),
        "nearest_to_the_clip": list(nearest),
        "distances_to_the_clip": _rows(nearness(multiverse)),
        "universes": {one.name: dict(one.levels) for one in multiverse.universes},
        "claims": [_claim(curve, moved[curve.name], multiverse) for curve in curves],
    }


def _claim(curve: ClaimCurve, moved: Moved, multiverse: Multiverse) -> dict[str, Any]:
    """Give one claim's curve and what moves it."""
    points = dict.fromkeys((one.name for one in multiverse.universes), None)
    found: dict[str, Any] = dict(points)
    for place, universe in enumerate(curve.universes):
        one = curve.interval(place)
        mean, low, high = rounded([one.mean, one.low, one.high])
        found[universe] = {"mean": mean, "low": low, "high": high, "seeds": one.n,
                           "verdict": curve.verdicts[place]}  # fmt: skip
    return {
        "name": curve.name,
        "text": curve.text,
        "what": curve.what,
        "unit": curve.unit,
        "stated": rounded([curve.stated.low, curve.stated.high]),
        "test": _known(asdict(moved.test)),
        "points": list(found.values()),
        "alone": _rows(moved.alone),
        "rules": _rows(moved.rules),
        "jointly": _rows(moved.jointly),
        "pairs": _rows(moved.pairs),
    }


def _judged(name: str, numbers: OfUniverse) -> dict[str, Any]:
    """Judge one claim in one universe."""
    made: Sequence[Comparison] = corrected(COMPARISONS[name](numbers))
    return {
        "name": name,
        "text": TEXTS[name],
        "verdict": overall([one.verdict for one in made]),
        "compared": [
            [one.what, effect(one), stated(one.stated, one.unit), one.verdict] for one in made
        ],
    }


def _panels(multiverse: Multiverse, numbers: OfUniverse) -> list[dict[str, Any]]:
    """Give Fig. 5 of one universe: each method's mean RMSE with its 95 % t interval."""
    panels = []
    for rho, scope in PANELS.values():
        lines = []
        for method in METHODS:
            curves = numbers.numbers("rmse", method, rho, scope)
            if curves is not None:
                # Six digits of a curve are more than anybody sees.
                lines.append(chart_line(method, mean_band(np.stack(list(curves)))))
        judged = any((method, rho, scope) in numbers.runs for method in METHODS)
        panels.append({"title": Panel(rho, scope, {}, {}).title, "lines": lines if judged else []})
    return panels


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [_known({str(k): v for k, v in row.items()}) for row in table.to_dict("records")]


def _known(row: Mapping[str, Any]) -> dict[str, Any]:
    """Put null for what is not known, and round numbers."""
    return {
        name: rounded([value])[0] if isinstance(value, float) else value
        for name, value in row.items()
    }
