"""One palette for everything: told apart by all eyes, legible, and said nowhere else."""

import re
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from infoplan.draw.page import style_sheet
from infoplan.draw.page_theme import site_variables
from infoplan.method_identity import OTHERS, PAPERS
from infoplan.palette import ERROR_PARTS, MARKS, PAGE, TERMINAL, VERDICTS

sys.path.append(str(Path(__file__).parents[1]))
from colours import CONES_LACKING, ciede2000, contrast_of, lab

ROOT = Path(__file__).parents[2]
DRAW = ROOT / "infoplan" / "draw"
PAPERS_COLOURS = {name: look.colour for name, look in PAPERS.items()}
TONES = ("supported", "contradicted", "undecided")

APART = 10.0
"""Least difference (CIEDE2000) of colours that mean something; 1 can just be seen."""

MANY_APART = 7.0
"""The same among sixteen methods, whose lines differ, too."""


@pytest.mark.parametrize(
    ("one", "other", "difference"),
    [
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 2.5, 0), (50, 0, -2.5), 4.3065),
        ((50, 2.5, 0), (58, 24, 15), 19.4535),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_differences_are_those_of_the_published_pairs(one, other, difference):
    assert ciede2000(np.array(one), np.array(other)) == pytest.approx(difference, abs=1e-4)


@pytest.mark.parametrize("lacking", CONES_LACKING)
@pytest.mark.parametrize(
    ("colours", "least"),
    [
        (PAPERS_COLOURS, APART),
        (PAPERS_COLOURS | dict(enumerate(OTHERS[:10])), MANY_APART),
        ({name: mark.colour for name, mark in VERDICTS.items()}, APART),
        ({name: MARKS[name].colour for name in ("caught", "missed", "false-alarm")}, APART),
        (ERROR_PARTS, APART),
        ({name: PAGE[name][0] for name in TONES}, APART),
        ({name: PAGE[name][1] for name in TONES}, APART),
    ],
    ids=["paper", "methods", "verdicts", "marks", "parts", "light", "dark"],
)
def test_colours_are_told_apart_without_a_kind_of_cones(colours, least, lacking):
    for a, b in combinations(colours, 2):
        apart = ciede2000(lab(colours[a], lacking), lab(colours[b], lacking))
        assert apart >= least, (a, b)


def test_nothing_is_told_by_colour_alone():
    assert len({look.dashes for look in PAPERS.values()}) == len(PAPERS)
    assert len({mark.marker for mark in VERDICTS.values()}) == len(VERDICTS)
    judged = [MARKS[name].marker for name in ("caught", "missed", "false-alarm")]
    assert len(set(judged)) == len(judged)


@pytest.mark.parametrize("side", [0, 1], ids=["light", "dark"])
def test_text_can_be_read_on_page_and_panel(side):
    for name in (*TONES, "text", "muted", "accent", "caution", "missing"):
        for paper in ("page", "panel"):
            assert contrast_of(PAGE[name][side], PAGE[paper][side]) >= 4.5, (name, paper)


def test_every_verdict_has_a_tone_on_pages_and_on_the_terminal():
    for verdict in (*VERDICTS, "missing"):
        assert verdict in PAGE
        assert verdict in TERMINAL


def test_colours_stand_in_the_palette_alone():
    held = {ROOT / "infoplan" / "palette.py", ROOT / "infoplan" / "method_identity.py"}
    files = [path for kind in ("py", "css", "js", "html") for path in DRAW.glob(f"*.{kind}")]
    files += [*(ROOT / "infoplan").glob("*.py"), *(ROOT / "scripts").glob("*.py")]
    files += [*(ROOT / "benchmarks").glob("*.py"), *(ROOT / "docs" / "_static").glob("*.css")]
    assert len(files) > 100
    for path in sorted({*files} - held):
        assert not re.findall(r"#[0-9a-fA-F]{6}\b", path.read_text(encoding="utf-8")), path


def test_every_property_that_a_page_asks_for_is_defined():
    pages = {path.stem for path in DRAW.glob("*_page.css")}
    assert {"report_page", "survey_page", "leaderboard_page"} <= pages
    for page in sorted(pages):
        sheet = style_sheet("page", "charts", page)
        defined = set(re.findall(r"--([\w-]+):", sheet)) | {"colour"}  # a method's own
        assert set(re.findall(r"var\(--([\w-]+)", sheet)) <= defined, page
        script = DRAW / f"{page}.js"
        asked = re.findall(r'ink\("([\w-]+)"\)', script.read_text()) if script.exists() else []
        assert set(asked) <= defined


def test_the_site_has_the_colours_of_the_pages():
    sheet = style_sheet("page")
    for theme, variables in site_variables().items():
        assert variables["font-stack"] in sheet
        for name in ("primary", "secondary"):
            assert f": {variables[f'color-background-{name}']};" in sheet, theme
    light, dark = site_variables().values()
    assert light["color-background-primary"] != dark["color-background-primary"]
