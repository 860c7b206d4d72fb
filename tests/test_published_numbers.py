"""What docs/ says of the paper's study is what the shipped numbers of each seed give."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from infoplan.analyse.claims import COMPARISONS, TEXTS
from infoplan.analyse.judging import USUAL, Claim, corrected, with_holm

DOCS = Path(__file__).parents[1] / "docs"
MARGIN = 60.4
"""Ft, a twentieth of the standard deviation of helens."""

EFFECT = re.compile(r"(-?[\d.]+) \[(-?[\d.]+), (-?[\d.]+)\]")
PARTS = {"final RMSE": "rmse", "less that of BEST": "best_rmse", "learning": "learning",
         "spikes let through": "spikes", "clean samples lost": "lost", "places": "places",
         "BEST itself": "best_itself"}  # fmt: skip
METHODS = ("UCT-NONE", "UCT-COPOD", "PUCT-COPOD")


def t_interval(values) -> tuple[float, float, float]:
    mean = np.mean(values)
    if np.ptp(values) == 0:
        return mean, mean, mean
    return (mean, *stats.t.interval(0.95, len(values) - 1, mean, stats.sem(values)))


def rows_of(page: str, first: str) -> dict[str, list[str]]:
    """Cells of the table whose heading has a cell, by what stands first in a row."""
    text = (DOCS / page).read_text(encoding="utf-8")
    (table,) = (one for one in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE) if first in one)
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {cells[0]: cells[1:] for cells in lines[2:]}


def said(text: str) -> list[tuple[float, float, float]]:
    return [tuple(map(float, found)) for found in EFFECT.findall(text)]


def near(shown: tuple[float, ...], expected: tuple[float, ...]) -> bool:
    """Tell whether numbers are rounded ones of others."""
    step = 0.0005 if abs(expected[0]) < 1 else 0.5
    return bool(np.allclose(shown, expected, rtol=0.0, atol=1.01 * step))


@pytest.fixture(scope="module")
def effects():
    table = pd.read_csv(DOCS / "replication.csv")
    return {key: rows["effect"].to_numpy() for key, rows in table.groupby(["claim", "compared"])}


@pytest.fixture(scope="module")
def claims(effects):
    """Twelve claims judged by the shipped effects; what each states needs no mission."""
    numbers = SimpleNamespace(unit="ft", rules=USUAL, margin=MARGIN, numbers=lambda *_: None)
    judged = []
    for name in TEXTS:
        made = [
            replace(one, values=dict(enumerate(effects[name, one.what])), lacks="")
            for one in COMPARISONS[name](numbers)
        ]
        judged.append(Claim(name, TEXTS[name], corrected(made)))
    return {claim.name: claim for claim in with_holm(judged)}


@pytest.mark.parametrize("name", TEXTS)
def test_the_table_of_claims_is_that_of_the_shipped_effects(name, effects, claims):
    _, told, verdict, survives = rows_of("replication.md", "after Holm")[name]
    own = [t_interval(values) for (claim, _), values in effects.items() if claim == name]
    own += [(-mean, -high, -low) for mean, low, high in own]
    shown = said(told)
    assert shown
    for one in shown:
        assert any(near(one, interval) for interval in own), (one, own)
    assert all(len(values) == 10 for (claim, _), values in effects.items() if claim == name)
    assert verdict == claims[name].verdict
    decided = claims[name].verdict in ("supported", "contradicted")
    assert survives == ({True: "yes", False: "no"}[claims[name].survives] if decided else "-")


def test_the_table_of_parts_is_that_of_the_shipped_gaps():
    table = pd.read_csv(DOCS / "explain.csv").set_index(["method", "part"])
    seeds = table.filter(like="seed_")
    rows = rows_of("explain.md", "| part | UCT-NONE |")
    for method, place in zip(METHODS, range(3), strict=True):
        parts = seeds.loc[method]
        gap = parts.loc["rmse"] - parts.loc["best_rmse"]
        assert parts.drop(["rmse", "best_rmse"]).sum().to_numpy() == pytest.approx(gap.to_numpy())
        for name, part in PARTS.items():
            expected = t_interval(parts.loc[part].to_numpy())
            cell = rows[name][place]
            assert near(said(cell)[0] if "[" in cell else (float(cell),) * 3, expected), cell


def test_the_prose_on_parts_is_theirs():
    text = " ".join((DOCS / "explain.md").read_text(encoding="utf-8").split())
    replication = " ".join((DOCS / "replication.md").read_text(encoding="utf-8").split())
    means = pd.read_csv(DOCS / "explain.csv").pivot(index="part", columns="method", values="mean")
    gaps = means.loc["rmse"] - means.loc["best_rmse"]
    shares = [round(100 * means.loc["learning", one] / gaps[one]) for one in METHODS]
    assert "**learning**: {}, {} and {} %".format(*shares) in text
    assert f"{min(shares)} to {max(shares)} %" in replication
    refit = [round(means.loc["rmse", one] - means.loc["learning", one]) for one in METHODS]
    ends = [round(means.loc["rmse", one]) for one in METHODS]
    assert (
        "they would end at {}, {} and {} ft instead of {}, {} and {}".format(*refit, *ends) in text
    )
    errors = means.loc[["spikes", "lost"], "UCT-COPOD"].sum()
    assert f"cost UCT-COPOD {errors:.0f} ft" in text
    assert f"ends {means.loc['places', 'PUCT-COPOD']:.0f} ft above BEST's" in text
    gained = means["UCT-COPOD"] - means["PUCT-COPOD"]
    assert f"gains on UCT-COPOD here, {gained['rmse']:.0f} ft" in text
    for part, word in (("learning", "learning"), ("spikes", "spikes"), ("lost", "lost samples")):
        assert f"{word} ({gained[part]:.0f})" in text
    assert f"less places ({-gained['places']:.0f})" in text
    assert f"{gained['lost']:.0f} of {gained['rmse']:.0f} ft" in replication
