"""The page of the multiverse in Chromium: with mouse, keyboard, phone and printer."""

import base64
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browsing import Browser, assert_readable, paper, silent
from universes import AXIS, by_choice, made_up

from infoplan.analyse.multiverse import claim_curves
from infoplan.analyse.universe_numbers import Multiverse, write
from infoplan.cli import main
from infoplan.study.universes import universes

pytestmark = pytest.mark.browser

FLOOR = "noise: floor 1"
THERE = [one for one in universes() if not one.name.startswith("joint")][:8]


@pytest.fixture(scope="module")
def multiverse() -> Multiverse:
    made = made_up(by_choice, there=THERE)
    falling = 1.0 + np.exp(-np.array(AXIS) / 500.0)
    made.missions["rmse"] = [end * falling for end in made.missions["final"]]
    return made


@pytest.fixture(scope="module")
def page(tmp_path_factory, multiverse) -> Path:
    folder = tmp_path_factory.mktemp("explored")
    write(multiverse, folder / "numbers.parquet")
    words = [f"table={folder / 'numbers.parquet'}", f"results_dir={folder}"]
    assert main(["multiverse", *words]) == 0
    return folder / "multiverse.html"


class Explorer(Browser):
    """The page, whose claims and universes are chosen."""

    def choose(self, selector: str, text: str) -> None:
        from selenium.webdriver.support.ui import Select

        choice = Select(self.one(selector))
        choice.select_by_visible_text(
            next(one.text for one in choice.options if one.text.startswith(text))
        )

    def chosen(self) -> str:
        return self.one("#universe-chosen").text.rpartition(": ")[0]

    def effects(self, verdict: str, faded: bool = False) -> int:
        """Count the signs of the curve."""
        kind = f"g.{verdict}{'.faded' if faded else ':not(.faded)'} path.effects"
        return self.one(kind).get_attribute("d").count("z")

    def filter(self, title: str, level: str) -> None:
        self.js("document.getElementById('filters').open = true")
        titles = [one.text.split("\n")[0] for one in self.all("#filter-choices label")]
        self.choose(f"#filter-choices label:nth-child({titles.index(title) + 1}) select", level)


@pytest.fixture
def browser(driver, page) -> Iterator[Explorer]:
    with silent(Explorer(driver, page)) as opened:
        yield opened


def test_the_curve_has_every_universe_by_its_verdict(browser, multiverse):
    browser.open()
    for curve in claim_curves(multiverse, ["C7", "C2"]):
        browser.choose("#claim-choice", f"{curve.name}:")
        for verdict in ("supported", "contradicted", "undecided"):
            assert browser.effects(verdict) == curve.verdicts.count(verdict)
            assert browser.effects(verdict, faded=True) == 0
        shapes = {browser.one(f"#signs svg.{v} path").get_attribute("d") for v in
                  ("supported", "contradicted", "undecided")}  # fmt: skip
        assert len(shapes) == 3, "verdicts differ by shape, not by colour alone"
        assert curve.what in browser.one("#curve-caption").text


def test_a_click_picks_a_universe_with_its_curves_verdicts_and_commands(browser, multiverse):
    from selenium.webdriver import ActionChains

    browser.open()
    browser.choose("#claim-choice", "C7:")
    (curve,) = claim_curves(multiverse, ["C7"])
    order = [curve.universes[place] for place in np.argsort(curve.means, kind="stable")]
    before = browser.one("#curve-panels path.line").get_attribute("d")
    plot = browser.one("#curve-plot")
    browser.js("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    # The last universe by effect lies at the right border.
    right = plot.rect["width"] / 2 - 12
    ActionChains(browser.driver).move_to_element_with_offset(plot, right, -200).click().perform()
    assert browser.chosen() == order[-1] == FLOOR
    assert browser.one("#curve-panels path.line").get_attribute("d") != before
    assert len([one for one in browser.all("#curve-panels figure") if one.is_displayed()]) == 4
    assert len(browser.all("#curve-panels path.band")) == 4 * 4
    verdicts = {
        row.text.split()[0]: row.find_element("css selector", ".chip").text
        for row in browser.all("#universe-claims tr.claim")
    }
    assert len(verdicts) == 12
    for one in claim_curves(multiverse):
        assert verdicts[one.name] == one.verdicts[one.universes.index(FLOOR)]
    commands = browser.one("#universe-commands").text.splitlines()
    (universe,) = [one for one in THERE if one.name == FLOOR]
    assert len(commands) == len(list(universe.lines()))
    assert all("model.min_noise_variance=1" in line and "seeds=6" in line for line in commands)


def test_the_curves_of_a_universe_are_the_missions(browser, multiverse):
    from selenium.webdriver import Keys

    browser.open()
    browser.choose("#universe-choice", FLOOR)
    plot = browser.one("#curve-panels .plot")
    browser.js("arguments[0].focus()", plot)
    browser.press(Keys.END)
    rows = multiverse.missions.query(
        "universe == @FLOOR and method == 'UCT-NONE' and rho == 0.05", local_dict={"FLOOR": FLOOR}
    )
    end = np.mean([rmse[-1] for rmse in rows["rmse"]])
    assert f"UCT-NONE {end:.0f} [" in plot.get_attribute("aria-valuetext")
    assert plot.get_attribute("aria-valuenow") == "2000"


def test_filters_fade_what_does_not_match(browser):
    from selenium.webdriver import Keys

    browser.open()
    browser.choose("#claim-choice", "C7:")
    browser.filter("noise", "floor 1")
    assert browser.one("#matching").text.startswith("1 of 8 universes match")
    assert sum(browser.effects(one) for one in ("supported", "contradicted", "undecided")) == 1
    assert (
        sum(browser.effects(one, True) for one in ("supported", "contradicted", "undecided")) == 7
    )
    plot = browser.one("#curve-plot")
    browser.js("arguments[0].focus()", plot)
    browser.press(Keys.HOME)
    assert browser.chosen() == FLOOR, "keys walk over those that match"
    browser.filter("pilot", "spiky")
    assert browser.one("#matching").text.startswith("0 of 8")
    browser.press(Keys.HOME)
    assert browser.chosen() == FLOOR
    browser.one("#no-filter").click()
    assert browser.one("#matching").text.startswith("8 of 8 universes:")
    assert all(one.get_attribute("value") == "" for one in browser.all("#filter-choices select"))
    browser.filter("the authors' clip", "nearest")
    assert browser.one("#matching").text.startswith("1 of 8")


def test_the_keyboard_walks_the_curve_and_is_told_where_it_is(browser, multiverse):
    from selenium.webdriver import Keys

    browser.open()
    browser.press(Keys.TAB)
    assert browser.focused().text == "Skip to the claims"
    browser.choose("#claim-choice", "C7:")
    (curve,) = claim_curves(multiverse, ["C7"])
    order = [curve.universes[place] for place in np.argsort(curve.means, kind="stable")]
    plot = browser.one("#curve-plot")
    browser.js("arguments[0].focus()", plot)
    assert browser.js("return getComputedStyle(arguments[0]).outlineStyle", plot) != "none"
    browser.press(Keys.HOME)
    assert browser.chosen() == order[0]
    browser.press(Keys.ARROW_RIGHT)
    assert browser.chosen() == order[1]
    assert plot.get_attribute("aria-valuenow") == "2"
    assert plot.get_attribute("aria-valuetext").startswith(f"{order[1]}: ")
    assert curve.verdicts[curve.universes.index(order[1])] in plot.get_attribute("aria-valuetext")
    browser.press(Keys.END)
    assert browser.chosen() == FLOOR
    assert browser.one("#universe-choice").get_attribute("value") == str(
        [one.name for one in THERE].index(FLOOR)
    )


def test_what_moves_a_claim_follows_the_claim(browser):
    browser.open()
    browser.choose("#claim-choice", "C7:")
    rows = {tuple(row.text.split()[:3]): row.text for row in browser.all("#levels tbody tr")}
    text = rows["noise", "floor", "1"]
    assert any(f"{value} [" in text for value in range(485, 516)), text
    told = browser.one("#rules").text
    assert "margin 10 %: supported in 1, contradicted in 7" in told
    assert "early samples" not in told
    assert "64 sign flips" in browser.one("#joint-test").text
    browser.choose("#claim-choice", "C5:")
    assert "early samples 100-300" in browser.one("#rules").text


@pytest.mark.parametrize("width", [360, 768])
def test_a_narrow_screen_needs_no_scrolling_sideways(browser, width):
    browser.open(width, 740)
    browser.js("document.getElementById('filters').open = true")
    assert browser.js("return document.documentElement.scrollWidth") <= width
    for plot in browser.all(".plot svg"):
        assert plot.rect["x"] >= 0
        assert plot.rect["x"] + plot.rect["width"] <= width
    smallest = browser.js(
        "return Math.min(...[...document.querySelectorAll('.plot text, td, p, li')]"
        ".filter((one) => one.getClientRects().length)"
        ".map((one) => parseFloat(getComputedStyle(one).fontSize)"
        " * (one.getCTM ? one.getCTM().a : 1)))"
    )
    assert smallest >= 9.9
    overlapping = browser.js(
        "const boxes = [...document.querySelectorAll('#curve-plot text.level')].map((one) => "
        "one.getBoundingClientRect());"
        "return boxes.filter((a, i) => boxes.some((b, k) => k > i && Math.abs(a.y - b.y) < 3 && "
        "a.x < b.x + b.width - 1 && b.x < a.x + a.width - 1)).length"
    )
    assert overlapping == 0


def test_the_claims_over_all_universes_fit_a_wide_screen(browser):
    browser.open(1280)
    inner, outer = browser.js(
        "const one = document.querySelector('#summary .scroll');"
        "return [one.scrollWidth, one.clientWidth]"
    )
    assert inner <= outer
    assert browser.one("#summary tbody th").rect["width"] >= 180


@pytest.mark.parametrize("dark", [False, True])
def test_both_themes_can_be_read(browser, dark):
    browser.open(dark=dark)
    assert_readable(
        browser, dark, ("p", ".muted", ".chip", "td.number", "figcaption", "select", "pre")
    )


def test_paper_is_white_and_has_the_universe(browser):
    browser.open(dark=True)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert paper(browser) > 0.9
    assert not browser.one("nav").is_displayed()
    printed = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert base64.b64decode(printed["data"]).startswith(b"%PDF")
    assert browser.one("#curve-plot svg").is_displayed()
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_a_single_seed_has_a_page_without_intervals(browser, multiverse, tmp_path):
    few = multiverse.missions.query("seed == 0").reset_index(drop=True)
    about = {name: getattr(multiverse, name) for name in ("axis", "terrain", "unit", "budget",
             "model", "deviation")}  # fmt: skip
    write(Multiverse(few, **about), tmp_path / "one.parquet")
    assert main(["multiverse", f"table={tmp_path / 'one.parquet'}", f"results_dir={tmp_path}"]) == 0
    browser.page = tmp_path / "multiverse.html"
    browser.open()
    assert browser.effects("undecided") == 8
    assert "single seed" in browser.one("#joint-test").text
    data = json.loads(browser.js("return document.getElementById('data').textContent"))
    assert data["claims"][0]["points"][0]["low"] is None
