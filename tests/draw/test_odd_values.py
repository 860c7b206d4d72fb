"""Infinite, absurd and tiny numbers, and any text, are drawn without harm."""

import json
import re
import warnings
from pathlib import Path

import made_methods
import made_tables
import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from rich.console import Console

from infoplan.analyse import find_missions, find_study
from infoplan.analyse.curves import drawable
from infoplan.draw import style
from infoplan.draw.animate import animate
from infoplan.draw.figures import draw_figures
from infoplan.draw.recording import from_tables, read_recording
from infoplan.draw.report import render
from infoplan.draw.scene import Scene

NASTY = ("<script>alert(1)</script>", "$x$", "</style>", "a\x1b[31mb\x00", "$\\frac{", "=1+1",
         "\u202eft", "m" * 300)  # fmt: skip


def embedded(page: str) -> dict:
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1]

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize(
    "bad", [np.inf, *(pytest.param(odd, marks=pytest.mark.long) for odd in (np.nan, 1e200))]
)
def test_errors_beyond_all_measure_are_gaps_and_are_told(bad, tmp_path):
    run = made_methods.store(tmp_path, "uct", "copod", rmse=[500.0, bad, 400.0, bad])
    made_methods.store(tmp_path, "uct", "copod", seed=1)
    made_methods.store(tmp_path, "puct", "copod")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        page = render(find_missions(tmp_path))
        (drawn,) = draw_figures(find_study(tmp_path), ["fig5"])
    lines = {line["method"]: line for line in embedded(page)["panels"][0]["lines"]}
    assert lines["UCT-COPOD"]["mean"][0] is not None
    assert lines["UCT-COPOD"]["mean"][-1] is None
    assert None not in lines["PUCT-COPOD"]["mean"]
    assert "gaps where errors are infinite or beyond all measure" in page
    assert run in page
    assert 'd="Mnan' not in page
    shown = pd.read_csv(drawn.files[2])
    assert shown[shown["method"] == "PUCT-COPOD"]["mean"].max() <= 500.0


@pytest.mark.parametrize(
    "bad", [np.inf, *[pytest.param(bad, marks=pytest.mark.long) for bad in (np.nan, 1e200)]]
)
def test_maps_with_infinite_nodes_are_drawn(bad, tmp_path):
    mean = made_tables.truth()
    mean[3, 4] = bad
    for method in (("uct", "copod"), ("puct", "copod"), ("uct", "none"), ("uct", "best")):
        made_methods.store(tmp_path, *method, mean=mean)
    for drawn in draw_figures(find_study(tmp_path), ["fig1", "fig6", "fig7"]):
        assert len(drawn.files) == 3, drawn.problem
    embedded(render(find_missions(tmp_path)))


def test_what_is_beyond_all_measure():
    values = [1.0, np.inf, -np.inf, np.nan, 2e6, -3.0]
    np.testing.assert_array_equal(
        drawable(values, [2.0, 1.0, np.inf]), [1.0, np.nan, np.nan, np.nan, np.nan, -3.0]
    )
    np.testing.assert_array_equal(drawable([0.0, 5.0], [0.0]), [0.0, 5.0])


def test_small_errors_have_three_digits_everywhere(tmp_path):
    """On a map in km an RMSE of 0.0123 is not 0."""
    rmse = [0.5, 0.2, 0.1, 0.012345]
    for planner in ("uct", "puct"):
        made_methods.store(tmp_path, planner, "copod", rmse=rmse, terrain__unit="km")
    page = render(find_missions(tmp_path))
    assert "UCT-COPOD ends lowest, with an RMSE of 0.0123 km" in page
    assert ">0.0123</td>" in page
    texts = drawn_texts(tmp_path)
    assert "absolute error, RMSE 0.0123 km" in texts


def drawn_texts(folder: Path) -> list[str]:
    """Titles of an animation's picture, as matplotlib is given them."""
    run = next(iter(find_missions(folder).options))
    recording = read_recording(folder, run, 0)
    states = list(from_tables(recording))
    with style.journal():
        scene = Scene(states, recording)
        scene.draw(states[-1])
    return [axes.get_title(loc="left") for axes in scene.figure.axes]


@pytest.mark.parametrize("text", ["".join(NASTY), pytest.param("$x$", marks=pytest.mark.long)])
def test_any_unit_is_inert_in_pictures_and_tables(text, tmp_path):
    for planner in ("uct", "puct"):
        made_methods.store(tmp_path, planner, "copod", terrain__unit=text)
    page = render(find_missions(tmp_path))
    assert len(re.findall("<script", page)) == 2
    assert page.count("</style>") == 1
    assert "\x1b" not in page
    assert "\u202e" not in page
    for drawn in draw_figures(find_study(tmp_path), ["fig5", "fig7"]):
        assert len(drawn.files) == 3
        assert b"<script" not in drawn.files[1].read_bytes()
    with Image.open(animate(tmp_path, Console(), run=next(iter(find_study(tmp_path).options)))):
        pass


@pytest.mark.parametrize("text", NASTY)
def test_pictures_show_text_as_it_is(text):
    with style.journal():
        figure = style.new_figure(3.0, 2.0)
        shown = figure.text(0, 0, style.inert(text))
        assert not mpl.cbook.is_math_text(shown.get_text()) or "$" not in text
        figure.canvas.draw()
    assert "$x$" not in style.inert(text)
    assert len(style.inert(text)) <= style.LONGEST + text.count("$")


def test_a_cell_of_a_csv_is_no_formula(tmp_path):
    with style.journal():
        figure = style.new_figure(2.0, 2.0)
        numbers = pd.DataFrame({"method": ["=1+1", "UCT"], "n": [1, -2], "x": [0.5, np.nan]})
        files = style.save(figure, tmp_path, "figure", numbers)
    assert files[2].read_text() == "method,n,x\n'=1+1,1,0.5\nUCT,-2,\n"


def test_forest_plots_of_a_unit_share_one_axis(tmp_path):
    for seed in (0, 1, 2):
        for (planner, detector), end in {
            ("uct", "none"): 900,
            ("uct", "best"): 100,
            ("uct", "copod"): 700,
            ("puct", "copod"): 500,
        }.items():
            made_methods.store(tmp_path, planner, detector, seed=seed,
                               rmse=[500, 600, 500, end + seed])  # fmt: skip
    page = render(find_missions(tmp_path))
    rows = re.findall(
        r'data-label="">([^<]*): final RMSE</td><td[^>]*>(-?[\d.]+) .*?cx="([\d.]+)"', page
    )
    places = {float(effect): float(x) for _, effect, x in rows}
    assert len(places) >= 4
    effects = sorted(places)
    assert effects[0] < 0 < effects[-1]
    slope, start = np.polyfit(effects, [places[effect] for effect in effects], 1)
    for effect, x in places.items():
        assert x == pytest.approx(start + slope * effect, abs=0.1), "one axis for all"
    zeros = set(re.findall(r'class="zero" d="M([\d.]+) ', page))
    assert f"{start:.1f}" in zeros
