"""The leaderboard as a reader meets it: in Chromium, on a phone, in the dark, on paper."""

import base64
from collections.abc import Iterator
from pathlib import Path

import made_methods
import pytest
from browsing import Browser, assert_readable, contrast, luminance, silent

from infoplan.cli import main
from infoplan.method_identity import PAPERS

pytestmark = pytest.mark.browser

PAIRS = [("uct", "none"), ("uct", "copod"), ("puct", "copod"), ("lawnmower", "local")]


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("ranked")
    for planner, detector in PAIRS:
        made_methods.store(folder, planner, detector)
    assert main(["leaderboard", "--html", f"results_dir={folder}"]) == 0
    return folder / "leaderboard.html"


@pytest.fixture
def browser(driver, page) -> Iterator[Browser]:
    with silent(Browser(driver, page)) as opened:
        yield opened


def key(browser: Browser, method: str) -> tuple[str, str]:
    """Colour and dashes of a method's piece of line."""
    return browser.js(
        "const row = [...document.querySelectorAll('.board tbody tr')]"
        ".find((one) => one.querySelector('th').textContent === arguments[0]);"
        "const line = row.querySelector('.key path');"
        "const rule = getComputedStyle(line);"
        "return [rule.getPropertyValue('--colour'), line.getAttribute('stroke-dasharray')]",
        method,
    )


def test_methods_have_their_colours_and_lines(browser):
    browser.open()
    for method in ("UCT-NONE", "UCT-COPOD", "PUCT-COPOD"):
        colour, dashes = key(browser, method)
        assert colour == PAPERS[method].colour
        assert [float(one) / 2 for one in dashes.split()] == list(PAPERS[method].dashes)


@pytest.mark.parametrize("dark", [False, True])
def test_both_themes_can_be_read(browser, dark):
    browser.open(dark=dark)
    assert_readable(browser, dark, ("p", ".muted", ".brand", ".board td", ".board th"))


def test_dark_colours_are_lightened_in_the_dark(browser):
    stroke = (
        "const pen = document.createElement('canvas').getContext('2d');"
        "const line = document.querySelectorAll('.key path')[arguments[0]];"
        "pen.fillStyle = getComputedStyle(line).stroke;"
        "pen.fillRect(0, 0, 1, 1);"
        "return `rgb(${[...pen.getImageData(0, 0, 1, 1).data].slice(0, 3).join()})`"
    )
    for number in range(len(PAIRS)):
        browser.open(dark=False)
        light = luminance(browser.js(stroke, number))
        browser.open(dark=True)
        assert luminance(browser.js(stroke, number)) >= max(light, 0.12)


@pytest.mark.parametrize("width", [360, 768])
def test_a_narrow_screen_needs_no_scrolling_sideways(browser, width):
    browser.open(width, 740)
    assert browser.js("return document.documentElement.scrollWidth") <= width
    for method in browser.all(".board tbody th"):
        assert method.rect["height"] < 60  # its name stands beside its piece of line


def test_paper_is_white(browser):
    browser.open(dark=True)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        paper = browser.js("return getComputedStyle(document.body).backgroundColor")
        assert luminance(paper) > 0.9
        assert contrast(browser, ".board td") >= 4.5
        printed = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
        assert base64.b64decode(printed["data"]).startswith(b"%PDF")
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
