"""Judged claims as table, Markdown and JSON."""

import io
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from scipy import stats

from infoplan.analyse import Claim, Comparison, Selection, Stated
from infoplan.analyse.judging import with_holm
from infoplan.draw.claims_table import as_json, markdown, print_claims, stated

NAN = math.nan


def selection(seeds: int = 10) -> Selection:
    missions = pd.DataFrame({"run": ["a"] * seeds, "seed": range(seeds)})
    return Selection(Path("results"), missions, {"a": {}}, "helens", "ft", 2000, ("a note",))


def compared(mean, half, side=Stated(high=0.0), n=10, unit="ft", lacks=""):  # noqa: B008
    """Compare seeds with that mean and half width of the 95 % t interval."""
    shape = np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(n)
    width = stats.t.ppf(0.975, n - 1) * shape.std(ddof=1) / math.sqrt(n) if n > 1 else 1.0
    values = dict(enumerate((mean + shape * half / width).tolist()))
    return Comparison("a - b: final RMSE", unit, side, values, lacks=lacks)


CLAIMS = with_holm([
    Claim("C1", "it is lower", (compared(-40.0, 20.5),), where="rho 0.1, batch",
          collapsed={"a": (3, 10), "b": (0, 10)}),
    Claim("C2", "it is rarer", (compared(-0.01, 0.04, Stated(high=-0.05), unit=""),)),
    Claim("C3", "it holds still", (compared(-9.0, 9.01),)),
    Claim(
        "C4",
        "it is there",
        (compared(NAN, NAN, n=0, lacks="a run is missing"),),
        ("infoplan run rho=0.1",),
    ),
    Claim("C5", "it is alone", (compared(-7.0, 0.0, n=1),)),
    Claim("C6", "it is near", (compared(-7.0, 6.5),)),
])  # fmt: skip


@pytest.fixture
def printed() -> str:
    stream = io.StringIO()
    print_claims(CLAIMS, selection(), Console(file=stream, width=120))
    return stream.getvalue()


def test_table_tells_effect_seeds_and_verdict(printed):
    lines = printed.splitlines()
    assert lines[0].startswith("helens, budget 2000, 10 seeds")
    (row,) = [line for line in lines if "-40.0" in line]
    assert "-40.0 [-60.5, -19.5] ft" in row
    assert row.split()[-6:] == ["0.002", "<", "0", "ft", "10", "supported"]
    assert [line.split()[-1] for line in lines if line.startswith(" C")][-6:] == [
        "SUPPORTED",
        "UNDECIDED",
        "UNDECIDED",
        "MISSING",
        "UNDECIDED",
        "SUPPORTED",
    ]


def test_table_tells_what_to_know(printed):
    assert "1 seed, at least six are needed" in printed
    assert "end collapsed: a 3 of 10, b 0 of 10" in printed
    assert "after Holm's correction over 6 claims remain: C1; not: C6" in printed
    assert "more seed" not in printed
    assert "C4: missing, to be had with infoplan run rho=0.1" in printed
    assert "a note" in printed
    assert "fewer than" not in printed


def test_few_seeds_are_warned_of():
    stream = io.StringIO()
    print_claims(CLAIMS[:1], selection(3), Console(file=stream, width=120))
    assert "with fewer than six seeds nothing is decided" in stream.getvalue()


def test_markdown_has_a_row_a_claim():
    rows = [line for line in markdown(CLAIMS, selection()).splitlines() if line.startswith("| C")]
    assert len(rows) == len(CLAIMS)
    assert all(row.count("|") == 6 for row in rows)
    assert rows[0] == (
        "| C1 | it is lower | rho 0.1, batch | "
        "a - b: final RMSE: -40.0 [-60.5, -19.5] ft, n = 10, p = 0.002, supported | "
        "**supported** (end collapsed: a 3 of 10, b 0 of 10) |"
    )
    assert "**undecided** (1 seed, at least six are needed)" in rows[4]


def test_json_is_strict_and_whole():
    document = json.loads(as_json(CLAIMS, selection()), parse_constant=pytest.fail)
    assert (document["terrain"], document["budget"]) == ("helens", 2000)
    first, second, third, fourth, fifth, sixth = document["claims"]
    assert first["comparisons"][0]["stated"] == {"low": None, "high": 0.0}
    assert (first["verdict"], first["comparisons"][0]["low"]) == ("supported", pytest.approx(-60.5))
    assert [one["survives_holm"] for one in (first, second, sixth)] == [True, False, False]
    assert third["p_holm"] <= 1
    assert fifth["comparisons"][0]["seeds"] == {"0": -7.0}
    assert first["collapsed"]["a"] == {"collapsed": 3, "missions": 10}
    assert fourth["commands"] == ["infoplan run rho=0.1"]
    assert fourth["comparisons"][0]["effect"] is None


@pytest.mark.parametrize(
    ("side", "text"),
    [
        (Stated(high=0.0), "< 0 ft"),
        (Stated(low=0.0), "> 0 ft"),
        (Stated(low=-60.0), "> -60.0 ft"),
        (Stated(-60.0, 60.0), "within ±60.0 ft"),
    ],
)
def test_stated_sides_in_words(side, text):
    assert stated(side, "ft") == text
