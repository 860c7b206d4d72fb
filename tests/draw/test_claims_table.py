"""Judged claims as table, Markdown and JSON."""

import io
import json
import math
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from infoplan.analyse import Claim, Comparison, Interval, Selection, Stated
from infoplan.draw.claims_table import as_json, markdown, print_claims, stated

NAN = math.nan


def selection(seeds: int = 10) -> Selection:
    missions = pd.DataFrame({"run": ["a"] * seeds, "seed": range(seeds)})
    return Selection(Path("results"), missions, {"a": {}}, "helens", "ft", 2000, ("a note",))


def compared(mean, low, high, side=Stated(high=0.0), n=10, unit="ft", lacks=""):  # noqa: B008
    return Comparison("a - b: final RMSE", unit, side, Interval(mean, low, high, n), mean, lacks)


CLAIMS = [
    Claim("C1", "it is lower", (compared(-40.0, -61.5, -20.0),), where="rho 0.1, batch"),
    Claim("C2", "it is rarer", (compared(-0.01, -0.05, 0.03, unit=""),)),
    Claim("C3", "it holds still", (compared(0.0, -9.0, 9.0),)),
    Claim(
        "C4",
        "it is there",
        (compared(NAN, NAN, NAN, n=0, lacks="a run is missing"),),
        ("infoplan run rho=0.1",),
    ),
    Claim("C5", "it is alone", (compared(-7.0, NAN, NAN, n=1),)),
]


@pytest.fixture
def printed() -> str:
    stream = io.StringIO()
    print_claims(CLAIMS, selection(), Console(file=stream, width=120))
    return stream.getvalue()


def test_table_tells_effect_seeds_and_verdict(printed):
    lines = printed.splitlines()
    assert lines[0].startswith("helens, budget 2000, 10 seeds")
    (row,) = [line for line in lines if "-40.0" in line]
    assert "-40.0 [-61.5, -20.0] ft" in row
    assert row.split()[-4:] == ["<", "0", "10", "supported"]
    assert [line.split()[-1] for line in lines if line.strip().startswith("C")][:3] == [
        "SUPPORTED",
        "UNDECIDED",
        "UNDECIDED",
    ]


def test_table_tells_what_would_help(printed):
    assert "about 150 more seeds would decide it" in printed
    assert "no number of seeds would help" in printed
    assert "a single seed has no interval: run more" in printed
    assert "C4: missing, to be had with infoplan run rho=0.1" in printed
    assert "a note" in printed
    assert "fewer than" not in printed


def test_few_seeds_are_warned_of():
    stream = io.StringIO()
    print_claims(CLAIMS[:1], selection(3), Console(file=stream, width=120))
    assert "with fewer than 5 seeds the intervals are too narrow" in stream.getvalue()


def test_markdown_has_a_row_a_claim():
    rows = [line for line in markdown(CLAIMS, selection()).splitlines() if line.startswith("| C")]
    assert len(rows) == len(CLAIMS)
    assert all(row.count("|") == 6 for row in rows)
    assert rows[0] == (
        "| C1 | it is lower | rho 0.1, batch | "
        "a - b: final RMSE: -40.0 [-61.5, -20.0] ft, n = 10, supported | **supported** |"
    )
    assert "**undecided** (about 150 more seeds would decide it)" in rows[1]


def test_json_is_strict_and_whole():
    document = json.loads(as_json(CLAIMS, selection()), parse_constant=pytest.fail)
    assert (document["terrain"], document["budget"]) == ("helens", 2000)
    first, second, third, fourth, fifth = document["claims"]
    assert first["comparisons"][0]["stated"] == {"low": None, "high": 0.0}
    assert (first["verdict"], first["comparisons"][0]["low"]) == ("supported", -61.5)
    assert (second["more_seeds"], third["more_seeds"], fifth["more_seeds"]) == (150, None, None)
    assert fourth["commands"] == ["infoplan run rho=0.1"]
    assert fourth["comparisons"][0]["effect"] is None


@pytest.mark.parametrize(
    ("side", "text"),
    [
        (Stated(high=0.0), "< 0"),
        (Stated(low=0.0), "> 0"),
        (Stated(low=-60.0), "> -60.0 ft"),
        (Stated(-60.0, 60.0), "within ±60.0 ft"),
    ],
)
def test_stated_sides_in_words(side, text):
    assert stated(side, "ft") == text
