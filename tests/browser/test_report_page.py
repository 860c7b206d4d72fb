"""The report as a reader meets it: in Chromium, with mouse, keyboard, phone and printer."""

import base64
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import made_methods
import pytest
from browsing import Browser, assert_readable, paper, silent
from flown import short_mission, store

from infoplan.analyse.tables import find_missions, find_study
from infoplan.draw.report import write_report
from infoplan.terrain import Terrain
from infoplan.wording import harmless

pytestmark = pytest.mark.browser

NASTY = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def page(tmp_path_factory, volcano) -> Path:
    folder = tmp_path_factory.mktemp("browsed")
    for planner, detector, scope in (
        ("uct", "none", "batch"),
        ("uct", "best", "batch"),
        ("uct", "copod", "batch"),
        ("puct", "copod", "batch"),
        ("puct", "copod", "historical"),
        ("puct", "none", "batch"),
    ):
        config = short_mission(planner, detector, scope, budget=260)
        store(folder, config, volcano, seeds=[0, 1, 2])
    return write_report(find_study(folder))


class Report(Browser):
    """The report, whose charts have lines."""

    def lines(self, method: str, kind: str = "line") -> int:
        return len(self.all(f"#curve-panels path.{kind}[data-method={method}]"))


@pytest.fixture
def browser(driver, page) -> Iterator[Report]:
    with silent(Report(driver, page)) as opened:
        yield opened


def test_the_page_shows_charts_map_and_tables(browser):
    browser.open()
    assert len(browser.all("#curve-panels figure")) == 2
    assert len(browser.all("#quality-panels figure")) == 4
    assert browser.lines("UCT-BEST") == 2
    assert browser.lines("PUCT-NONE") == 0, "beyond the paper: hidden at first"
    assert browser.js("return document.querySelector('#alarm-map image').getBBox().width") == 400
    assert len(browser.all("#alarm-relief tr")) == 3


def test_what_looks_like_markup_stays_text(browser, volcano, tmp_path):
    terrain = Terrain("file-<b>", volcano.elevation, volcano.extent, NASTY, volcano.sha256)
    config = short_mission("uct", "copod")
    config.terrain = replace(config.terrain, name="file", path="hills.npy")
    store(tmp_path, config, terrain)
    browser.page = write_report(find_study(tmp_path))
    browser.open()
    assert browser.one("h1").text.startswith("file-<b>, budget 200")
    assert NASTY in browser.one("#curve-panels svg").text
    assert browser.all("img, b") == []


@pytest.mark.parametrize(
    "text",
    [
        "</script><script>document.title='executed'</script>",
        "<script>document.title='executed'</script>",
        "</style><img src=x onerror=\"document.title='executed'\">$x$",
        "\x00\x1b[31m\u202e\ud800&lt;b&gt;",
    ],
)
def test_nothing_of_a_users_text_is_executed(browser, volcano, tmp_path, text):
    terrain = Terrain("file-hills", volcano.elevation, volcano.extent, text, volcano.sha256)
    config = short_mission("uct", "copod")
    config.terrain = replace(config.terrain, name="file", path="hills.npy")
    store(tmp_path, config, terrain)
    browser.page = write_report(find_missions(tmp_path))
    browser.open()
    assert browser.driver.title.startswith("infoplan: file-hills, budget 200, 1 seed")
    assert len(browser.all("script")) == 2
    assert len(browser.all("style")) == 1
    assert browser.all("img") == []
    assert harmless(text) in browser.one("#curve-panels svg").text


def test_every_method_has_its_line_and_its_button(browser, tmp_path):
    pairs = [("lawnmower", "local"), ("own.leftmost", "pyod_knn"), ("greedy", "gp_residual")]
    for planner, detector in pairs:
        made_methods.store(tmp_path, planner, detector)
    made_methods.store(tmp_path, "greedy", "local", rmse=[500.0, float("inf"), 1e200, 400.0])
    browser.page = write_report(find_missions(tmp_path))
    browser.open()
    for method in ("LAWNMOWER-LOCAL", "LEFTMOST-PYOD_KNN", "GREEDY-GP_RESIDUAL", "GREEDY-LOCAL"):
        assert browser.lines(method) == 1
        button = browser.one(f"[data-legend=curves] [data-method={method}]")
        button.click()
        assert browser.lines(method) == 0
    assert "gaps" in browser.one("#summary .note").text


def test_bands_end_at_the_axes(browser):
    browser.open(height=4000)
    below = browser.js(
        "return [...document.querySelectorAll('.panels .plot')].flatMap((plot) => {"
        "const axis = plot.querySelector('.axis').getBoundingClientRect();"
        "const steps = [...Array(60).keys()].map((k) => axis.left + axis.width * (k + 0.5) / 60);"
        "return steps.map((x) => document.elementFromPoint(x, axis.top + 3));"
        "}).filter((one) => one?.classList.contains('band')).length"
    )
    assert below == 0
    assert len(browser.all(".panels .band")) > 0


def test_the_legend_hides_and_shows_a_method_everywhere(browser):
    browser.open()
    button = browser.one("[data-legend=curves] [data-method=PUCT-COPOD]")
    assert button.get_attribute("aria-pressed") == "true"
    shown = browser.lines("PUCT-COPOD"), browser.lines("UCT-NONE")
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert browser.lines("PUCT-COPOD") == 0
    assert browser.lines("PUCT-COPOD", "band") == 0
    assert browser.lines("UCT-NONE") == shown[1]
    assert browser.all("#quality-panels path[data-method=PUCT-COPOD]") == []
    twin = browser.one("[data-legend=quality] [data-method=PUCT-COPOD]")
    assert twin.get_attribute("aria-pressed") == "false"
    twin.click()
    assert button.get_attribute("aria-pressed") == "true"
    assert browser.lines("PUCT-COPOD") == shown[0]


def test_single_seeds_come_and_go(browser):
    browser.open()
    assert browser.all("path.seed") == []
    button = browser.one("#seeds")
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    assert browser.lines("UCT-BEST", "seed") == 2 * 3
    browser.one("[data-legend=curves] [data-method=UCT-BEST]").click()
    assert browser.lines("UCT-BEST", "seed") == 0
    button.click()
    assert browser.all("path.seed") == []


def test_the_mouse_reads_values(browser):
    from selenium.webdriver import ActionChains

    browser.open()
    plot = browser.one("#curve-panels .plot")
    browser.js("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    ActionChains(browser.driver).move_to_element(plot).perform()
    (tip,) = [one for one in browser.all(".tip") if one.is_displayed()]
    heading, *rows = tip.text.splitlines()
    samples = int(heading.split()[0])
    assert 160 < samples < 200, "half-way from 100 to 260"
    assert {"UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"} <= set(" ".join(rows).split())
    data = browser.js("return JSON.parse(document.getElementById('data').textContent)")
    best = next(one for one in data["panels"][0]["lines"] if one["method"] == "UCT-BEST")
    value = best["mean"][data["axis"].index(samples)]
    assert f"{value:.0f} [" in re.sub(r"\s+", " ", tip.text)
    assert len(browser.all("#curve-panels .cursor")) == 2, "the charts of a group share the cursor"
    ActionChains(browser.driver).move_to_element(browser.one("h1")).perform()
    assert not any(one.is_displayed() for one in browser.all(".tip"))


def test_the_keyboard_reaches_and_works_everything(browser):
    from selenium.webdriver import Keys

    browser.open()
    browser.press(Keys.TAB)
    assert browser.focused().text == "Skip to the summary"
    browser.press(Keys.ENTER)
    assert browser.js("return location.hash") == "#summary"
    seen = []
    for _ in range(200):
        browser.press(Keys.TAB)
        focused = browser.focused()
        if focused.tag_name == "body":
            break
        seen.append((focused.tag_name, focused.get_attribute("id"), focused.text))
        outline = browser.js("return getComputedStyle(arguments[0]).outlineStyle", focused)
        assert outline != "none", seen[-1]
    wanted = browser.all("button, select, summary, .plot, main a")
    assert len(seen) >= len([one for one in wanted if one.is_displayed()])
    button = browser.one("[data-legend=curves] [data-method=UCT-NONE]")
    browser.js("arguments[0].focus()", button)
    browser.press(Keys.SPACE)
    assert browser.lines("UCT-NONE") == 0
    plot = browser.one("#curve-panels .plot")
    browser.js("arguments[0].focus()", plot)
    assert plot.get_attribute("aria-valuenow") == "260"
    browser.press(Keys.ARROW_LEFT)
    one_back = int(plot.get_attribute("aria-valuenow"))
    assert one_back < 260
    browser.press(Keys.HOME)
    assert plot.get_attribute("aria-valuenow") == "100"
    assert plot.get_attribute("aria-valuetext").startswith("100 samples: ")
    assert "UCT-NONE" not in plot.get_attribute("aria-valuetext"), "hidden lines are not read out"
    assert plot.find_element("css selector", ".tip").is_displayed()
    browser.press(Keys.ESCAPE)
    assert not plot.find_element("css selector", ".tip").is_displayed()
    browser.press(Keys.END, Keys.ARROW_LEFT)
    assert plot.get_attribute("aria-valuenow") == str(one_back)


def test_choices_change_detector_charts_and_map(browser):
    from selenium.webdriver.support.ui import Select

    browser.open()
    before = browser.one("#quality-panels path.line").get_attribute("d")
    choice = Select(browser.one("#quality-choice"))
    assert [option.text for option in choice.options] == [
        "(b) ρ = 0.1, batch scope",
        "(d) ρ = 0.1, historical scope",
    ]
    choice.select_by_index(1)
    assert browser.one("#quality-panels path.line").get_attribute("d") != before
    run = Select(browser.one("#alarm-choice"))
    assert run.first_selected_option.text == "(b) ρ = 0.1, batch scope: PUCT-COPOD"
    counts = browser.one("#alarm-counts").text
    run.select_by_visible_text("(b) ρ = 0.1, batch scope: UCT-COPOD")
    assert browser.one("#alarm-counts").text != counts
    assert len(browser.all("#alarm-map path.false-alarms")) == 2
    browser.one("[data-layer='false alarms']").click()
    assert browser.all("#alarm-map path.false-alarms") == []
    browser.one("[data-layer='outliers missed']").click()
    assert len(browser.all("#alarm-map path.outliers-missed")) == 2


def test_headings_sort_the_runs(browser):
    browser.open()

    def finals() -> list[float]:
        cells = browser.all("table.sortable tbody td:nth-child(3)")
        return [float(cell.text.split(" [")[0]) for cell in cells]

    heading = browser.all("table.sortable thead th")[2]
    heading.find_element("css selector", "button").click()
    assert finals() == sorted(finals())
    assert heading.get_attribute("aria-sort") == "ascending"
    heading.find_element("css selector", "button").click()
    assert finals() == sorted(finals(), reverse=True)


@pytest.mark.parametrize("width", [360, 768])
def test_a_narrow_screen_needs_no_scrolling_sideways(browser, width):
    browser.open(width, 740)
    assert browser.js("return document.documentElement.scrollWidth") <= width
    for plot in browser.all(".plot svg, #alarm-map svg"):
        box = plot.rect
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
    smallest = browser.js(
        "return Math.min(...[...document.querySelectorAll('.plot text, #alarm-map text, td, p')]"
        ".filter((one) => one.getClientRects().length).map((one) => one.getCTM "
        "? parseFloat(getComputedStyle(one).fontSize) * one.getCTM().a "
        ": parseFloat(getComputedStyle(one).fontSize)))"
    )
    assert smallest >= 10
    for button in browser.all("main button"):
        assert button.rect["height"] >= 24


@pytest.mark.parametrize("dark", [False, True])
def test_both_themes_can_be_read(browser, dark):
    browser.open(dark=dark)
    assert_readable(
        browser, dark, ("p", ".muted", "nav a", ".chip", "td.number", "figcaption", "select")
    )


def test_the_button_turns_the_theme(browser):
    browser.open()
    button = browser.one("#theme")
    assert button.get_attribute("aria-pressed") == "false"
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    assert paper(browser) < 0.05
    button.click()
    assert paper(browser) > 0.9


def test_paper_is_white_and_nothing_is_folded(browser):
    browser.open(dark=True)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert paper(browser) > 0.9
    assert not browser.one("nav").is_displayed()
    assert not browser.one("#theme").is_displayed()
    browser.js(
        "window.opened = 0; addEventListener('beforeprint', () => "
        "{ window.opened = document.querySelectorAll('details[open]').length; })"
    )
    printed = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    pdf = base64.b64decode(printed["data"])
    assert pdf.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 15
    assert browser.js("return window.opened") == len(browser.all("details"))
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
