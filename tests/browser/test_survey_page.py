"""A survey's page as the one it was sent to meets it: mouse, fingers, keyboard, phone, printer."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browsing import Browser, assert_readable, paper, silent
from survey_logs import (
    HOSTILE,
    LONELY,
    QUICK,
    ROCK,
    SPIKE,
    SPIKES,
    first_log,
    second_log,
    write_hostile_log,
    write_log,
)

from infoplan.analyse.verdicts import Verdict
from infoplan.cli import main
from infoplan.config import SurveyedConfig
from infoplan.draw.page import write_page
from infoplan.draw.survey_page import fill_survey_page
from infoplan.draw.survey_page_data import page_data, sources_of
from infoplan.survey import SurveyLog

pytest.importorskip("pyproj")
pytestmark = pytest.mark.browser

NUMBER = r"-?\d+(?:\.\d+)?"


def survey(folder: Path, log: Path, *options: str) -> Path:
    assert main(["survey", str(log), f"results_dir={folder / 'results'}", *options]) == 0
    return next((folder / "results" / "surveys").glob("*/page.html"))


class Survey(Browser):
    """The page of a survey."""

    def place(self) -> tuple[float, float, float, float]:
        """Easting, northing, latitude and longitude that the page tells."""
        found = re.findall(NUMBER, self.one("#position").text)
        return tuple(float(number) for number in found)

    def metres_a_pixel(self) -> float:
        """By the bar of the scale."""
        number, unit = self.one("#scale-text").text.split()
        metres = float(number) * (1000 if unit == "km" else 1)
        return metres / self.js(
            "return parseFloat(document.getElementById('scale-bar').style.width)"
        )

    def hover(self, right: float = 0, down: float = 0) -> None:
        """Move the mouse to a place beside the middle of the map."""
        from selenium.webdriver import ActionChains

        plan = self.one("#map")
        ActionChains(self.driver, duration=20).move_to_element_with_offset(
            plan, right, down
        ).perform()

    def facts(self) -> dict[str, str]:
        """What the page tells of the sample that is pointed at."""
        if not self.one("#tip").is_displayed():
            return {}
        rows = self.all("#tip tr")
        return {row.text.split()[0]: row.text.partition(" ")[2] for row in rows}

    def choose(self, group: str, text: str) -> None:
        next(one for one in self.all(f"#{group} button") if one.text.startswith(text)).click()

    def painted(self) -> list[int]:
        """All pixels of the map as they are now, after the next frame."""
        return self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => {"
            "const canvas = document.querySelector('#map canvas');"
            "const copy = Object.assign(document.createElement('canvas'),"
            " {width: canvas.width, height: canvas.height});"
            "const pen = copy.getContext('2d', {willReadFrequently: true});"
            "pen.drawImage(canvas, 0, 0);"
            "const pixels = pen.getImageData(0, 0, copy.width, copy.height);"
            "done([...new Uint32Array(pixels.data.buffer)]); }))"
        )

    def centred(self) -> "Survey":
        """Bring the map into view whole."""
        self.js(
            "document.getElementById('map').scrollIntoView({block: 'center', behavior: 'instant'})"
        )
        return self


@pytest.fixture(scope="module")
def bay(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bay")
    return survey(folder, write_log(folder / "bay.csv"), *QUICK)


@pytest.fixture
def browser(driver, bay) -> Iterator[Survey]:
    with silent(Survey(driver, bay)) as opened:
        yield opened


@pytest.fixture(scope="module")
def clean(bay) -> pd.DataFrame:
    return pd.read_csv(bay.with_name("clean.csv"))


def test_the_map_is_drawn_with_scale_bars_and_flags(browser):
    browser.open().centred()
    pixels = np.array(browser.painted(), dtype=np.uint32)
    assert len(np.unique(pixels)) > 200, "colours of the mean"
    # 0xff3d8aff is #ff8a3d, the crosses of flagged samples.
    assert (pixels == 0xFF3D8AFF).sum() > 3 * 10
    assert "Depth, and mean (ft)" in browser.one("#bars").text
    assert browser.one("#flags-caption").text.startswith(
        "3 of 80 samples are flagged by gp_residual"
    )
    assert browser.one(".north").is_displayed()


def test_dragging_moves_and_the_wheel_zooms_about_the_pointer(browser):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    browser.open().centred()
    browser.hover(60, 40)
    east, north, *_ = browser.place()
    scale = browser.metres_a_pixel()
    browser.hover(160, -20)
    assert browser.place()[0] - east == pytest.approx(100 * scale, abs=0.3)
    assert browser.place()[1] - north == pytest.approx(60 * scale, abs=0.3)
    plan = browser.one("#map")
    actions = ActionChains(browser.driver, duration=20).move_to_element_with_offset(plan, 0, 0)
    actions.click_and_hold().move_by_offset(-70, 30).release().perform()
    browser.hover(-10, 70)
    moved = browser.place()
    assert (moved[0] - east, moved[1] - north) == pytest.approx((0, 0), abs=0.3)
    origin = ScrollOrigin.from_element(plan, -10, 70)
    ActionChains(browser.driver).scroll_from_origin(origin, 0, -500).perform()
    browser.painted()
    assert browser.metres_a_pixel() == pytest.approx(scale / np.e, rel=0.01)
    browser.hover(-9, 70)
    browser.hover(-10, 70)
    assert browser.place()[:2] == pytest.approx(moved[:2], abs=0.2)
    browser.one("#whole").click()
    browser.painted()
    assert browser.metres_a_pixel() == pytest.approx(scale, rel=1e-3)


def test_the_place_told_is_that_of_the_log(browser, clean):
    browser.open()
    browser.one("#flag-table tbody button").click()
    browser.centred()
    row = int(browser.one("#flag-table tbody button").text)
    browser.hover()
    assert browser.place()[2:] == pytest.approx(
        (clean["Latitude"][row - 1], -clean["Longitude"][row - 1]), abs=5e-6
    )
    assert " W" in browser.one("#position").text


def test_a_sample_that_is_pointed_at_tells_its_numbers(browser, clean):
    browser.open()
    browser.one("#flag-table tbody button").click()
    browser.press("\ue00c")
    browser.centred()
    row = int(browser.one("#flag-table tbody button").text)
    browser.one("#map").click()  # keeps it
    facts = browser.facts()
    assert facts["row"] == str(row)
    sample = clean.iloc[row - 1]
    assert float(facts["value"].split()[0]) == sample["Depth (ft)"]
    assert facts["value"].endswith(" ft")
    assert float(facts["score"]) == pytest.approx(sample["score"], rel=0.006)
    assert facts["threshold"] == "3.00"
    assert facts["time"] == sample["time"]
    # A spike of 6 ft lies so far from what the others predict.
    assert float(facts["value"].split()[0]) - float(facts["expected"].split()[0]) == pytest.approx(
        6, abs=1
    )
    assert browser.one("#tip strong").text.startswith("flagged by gp_residual")
    assert f"row {row}" in browser.one("#spoken").get_attribute("textContent")
    browser.hover(300, 0)
    assert browser.facts()["row"] == str(row), "it stays"
    browser.press("\ue00c")
    assert browser.facts() == {}


def test_the_mouse_alone_shows_and_hides(browser):
    browser.open()
    browser.one("#flag-table tbody button").click()
    browser.centred()
    browser.one("#map").send_keys("\ue00c")
    assert browser.facts() == {}
    browser.hover(3, 3)
    assert browser.facts()["row"] == browser.one("#flag-table tbody button").text
    from selenium.webdriver import ActionChains

    ActionChains(browser.driver).move_to_element(browser.one("#place-title")).perform()
    assert browser.facts() == {}


def test_the_keyboard_moves_zooms_and_steps(browser, clean):
    browser.open()
    plan = browser.one("#map")
    browser.js("arguments[0].focus()", plan)
    browser.painted()
    scale = browser.metres_a_pixel()
    east, north, *_ = browser.place()
    browser.press("+")
    browser.painted()
    assert browser.metres_a_pixel() == pytest.approx(scale / 1.5, rel=0.01)
    browser.press("\ue014")  # to the right
    assert browser.place()[0] > east + 1
    browser.press("\ue013")  # up
    assert browser.place()[1] > north + 1
    browser.press("0")
    browser.painted()
    assert browser.metres_a_pixel() == pytest.approx(scale, rel=0.01)
    flagged = [row + 1 for row in np.flatnonzero(clean["flagged"])]
    for row in flagged:
        browser.press("N")
        assert browser.facts()["row"] == str(row)
    browser.press("P")
    assert browser.facts()["row"] == str(flagged[-2])
    browser.press("n")
    assert browser.facts()["row"] == str(flagged[-2] + 1)
    assert browser.facts()["time"] == clean["time"][flagged[-2]]
    browser.press("p", "p")
    assert browser.facts()["row"] == str(flagged[-2] - 1)
    assert not browser.one("#tip strong").text.startswith("flagged")


def test_the_detector_and_the_layer_are_switched(browser):
    browser.open().centred()
    first = browser.painted()
    browser.choose("detector-choice", "copod")
    assert re.search(r"8 of 80 samples are flagged by copod", browser.one("#flags-caption").text)
    assert len(browser.all("#flag-table tbody tr")) == 8
    chosen = [one.text for one in browser.all("#detector-choice [aria-pressed=true]")]
    assert chosen == ["copod: 8"]
    second = browser.painted()
    assert first != second
    browser.choose("layer-choice", "deviation")
    third = browser.painted()
    assert np.mean(np.array(second) != np.array(third)) > 0.2
    assert [line for line in browser.one("#bars").text.splitlines() if "(" in line] == [
        "deviation (ft)", "Depth (ft)",
    ]  # fmt: skip
    browser.choose("layer-choice", "outlier density")
    assert "outlier density (flagged samples)" in browser.one("#bars").text
    browser.choose("layer-choice", "track alone")
    assert browser.painted().count(0) > 0.9 * len(third), "nothing but the track"
    browser.choose("detector-choice", "gp_residual")
    browser.choose("layer-choice", "mean")
    again = np.array([browser.painted(), first], dtype=np.uint32).view(np.uint8).astype(int)
    assert np.abs(again[0] - again[1]).max() <= 8, "but for rounding at edges"


def test_headings_sort_the_flagged_samples(browser):
    browser.open()

    def column(number: int) -> list[float]:
        cells = browser.all(f"#flag-table tbody tr > :nth-child({number})")
        return [float(cell.text) for cell in cells]

    scores = column(6)
    assert scores == sorted(scores, reverse=True)
    heading = browser.all("#flag-table thead th")[0]
    heading.find_element("css selector", "button").click()
    assert column(1) == [row + 1 for row in SPIKES]
    assert heading.get_attribute("aria-sort") == "ascending"
    heading.find_element("css selector", "button").click()
    assert column(1) == [row + 1 for row in reversed(SPIKES)]


def touch(browser: Survey, kind: str, *points: tuple[float, float]) -> None:
    box = browser.js(
        "const box = document.getElementById('map').getBoundingClientRect();"
        "return [box.left + box.width / 2, box.top + box.height / 2]"
    )
    fingers = [{"x": box[0] + x, "y": box[1] + y, "id": i} for i, (x, y) in enumerate(points)]
    browser.driver.execute_cdp_cmd(
        "Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers}
    )


def test_fingers_pinch_drag_and_tap(browser):
    browser.open(390, 844).centred()
    browser.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    try:
        browser.painted()
        scale = browser.metres_a_pixel()
        touch(browser, "touchStart", (-30, 0), (30, 0))
        for reach in (40, 60, 75, 90):
            touch(browser, "touchMove", (-reach, 0), (reach, 0))
        touch(browser, "touchEnd")
        browser.painted()
        assert browser.metres_a_pixel() == pytest.approx(scale / 3, rel=0.05)
        east = browser.place()[0]
        touch(browser, "touchStart", (0, 0))
        for way in (20, 40, 60):
            touch(browser, "touchMove", (way, 0))
        touch(browser, "touchEnd")
        browser.painted()
        moved = browser.place()[0] - east
        assert moved == pytest.approx(-60 * browser.metres_a_pixel(), rel=0.1, abs=0.2)
        assert browser.facts() == {}
        browser.one("#next-flag").click()
        row = browser.facts()["row"]
        browser.one("#map").send_keys("\ue00c")
        browser.centred()
        touch(browser, "touchStart", (8, 8))
        touch(browser, "touchEnd")
        assert browser.facts()["row"] == row
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


@pytest.mark.parametrize("width", [360, 768])
def test_a_narrow_screen_needs_no_scrolling_sideways(browser, width):
    browser.open(width, 740)
    assert browser.js("return document.documentElement.scrollWidth") <= width
    browser.one("#next-flag").click()
    tip, plan = browser.one("#tip").rect, browser.one("#map").rect
    assert tip["x"] >= plan["x"]
    assert tip["x"] + tip["width"] <= plan["x"] + plan["width"]
    assert tip["y"] >= plan["y"]
    for button in browser.all("main button"):
        if button.is_displayed():
            assert button.rect["height"] >= 24


@pytest.mark.parametrize("dark", [False, True])
def test_both_themes_can_be_read(browser, dark):
    browser.open(dark=dark)
    browser.one("#next-flag").click()
    assert_readable(
        browser,
        dark,
        (
            "p",
            ".muted",
            "nav a",
            "td.number",
            ".choice [aria-pressed=true]",
            "#tip td",
            "#scale-text",
            ".north",
            "#position",
            ".bar span",
        ),
    )


def test_paper_has_the_map_and_no_buttons(browser):
    browser.open(dark=True)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert paper(browser) > 0.9
    for selector in ("nav", ".zoom", ".steps", "#theme", ".toolbar"):
        assert not browser.one(selector).is_displayed()
    assert browser.one("#map canvas").is_displayed()
    browser.js(
        "addEventListener('beforeprint', () => { window.drawn = "
        "document.querySelector('#map canvas').style.width; })"
    )
    printed = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert len(printed["data"]) > 10_000
    assert 600 < float(browser.js("return window.drawn").removesuffix("px")) <= 640
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_what_looks_like_markup_stays_text(browser, tmp_path):
    browser.page = survey(tmp_path, write_hostile_log(tmp_path), *QUICK, "unit=</script><b>")
    browser.open().centred()
    assert len(browser.all("script")) == 2
    assert browser.all("img, b") == []
    assert f"{HOSTILE}, and mean (</script><b>)" in browser.one("#bars").text
    assert "'<script>alert(1)</script>' is no number" in browser.one("#numbers").text
    browser.one("#next-flag").click()
    assert browser.facts()["value"].endswith(" </script><b>")
    assert browser.one("#position").text.startswith("middle: x ")


def test_samples_in_one_place_are_reached_one_after_the_other(browser, tmp_path):
    log = write_log(tmp_path / "bay.csv")
    lines = log.read_text().splitlines()
    fields = lines[41].split(",")
    lines[42:42] = [",".join([fields[0], *fields[1:3], depth, "again"]) for depth in ("9.9", "9.8")]
    log.write_text("\n".join(lines) + "\n")
    browser.page = survey(tmp_path, log, *QUICK)
    browser.open()
    next(one for one in browser.all("#flag-table button") if one.text == "41").click()
    browser.centred()
    seen = [browser.facts()["row"]]
    for number in (2, 3):
        browser.one("#map").click()
        assert f"{number} of 3 samples in this place" in browser.one("#tip strong").text
        seen.append(browser.facts()["row"])
    browser.one("#map").click()
    assert browser.facts()["row"] == seen[0]
    assert len(set(seen)) == 3


FRAME, CROSS = 0xFFFFC77C, 0xFF3D8AFF
"""Colours of the marks, as a canvas stores them: #7cc7ff where a later log has been, #ff8a3d."""


def colours_about(browser: Survey, row: int) -> set[int]:
    """Colours within ten pixels of a sample of the first log, which is brought into the middle."""
    next(
        line.find_element("css selector", "button")
        for line in browser.all("#flag-table tbody tr")
        if line.text.split()[:2] == [str(row), "may"]
    ).click()
    browser.one("#map").send_keys("\ue00c")  # neither ring nor numbers
    pixels = np.array(browser.painted(), dtype=np.uint32)
    size = browser.js(
        "const canvas = document.querySelector('#map canvas');return [canvas.height, canvas.width]"
    )
    middle = pixels.reshape(size)[size[0] // 2 - 10 : size[0] // 2 + 10]
    return set(middle[:, size[1] // 2 - 10 : size[1] // 2 + 10].ravel().tolist())


def test_what_later_logs_say_of_a_flag_is_marked_told_and_counted(browser, tmp_path):
    logs = first_log(tmp_path / "may.csv"), second_log(tmp_path / "june.csv")
    browser.page = survey(tmp_path, logs[0], str(logs[1]), *QUICK, "detector=local")
    origins = pd.read_parquet(next((tmp_path / "results" / "origins").glob("*/*.parquet")))
    counts = [int((origins["verdict"] == word).sum()) for word in ("confirmed", "cleared")]
    untested = int((origins["verdict"] == "untested").sum())
    assert counts[1] > 0
    browser.open()
    assert browser.one("#flags-caption").text.endswith(
        f"later logs have left {counts[0]} confirmed, {counts[1]} cleared, {untested} untested"
    )
    listed = [line.text.split() for line in browser.all("#flag-table tbody tr")]
    said = {(line[1], int(line[0]) - 1): line[-1] for line in listed}
    for row, word in ((SPIKE, "confirmed"), (ROCK, "cleared"), (LONELY, "untested")):
        assert said["may", row] == word
    table = next(one for one in browser.all("#flags table") if "flagged then" in one.text)
    row = next(line.text.split() for line in table.find_elements("css selector", "tr")
               if line.text.startswith("may"))  # fmt: skip
    assert row[3:6] == [str(counts[0]), str(counts[1]), str(untested)]
    for row, marks in ((SPIKE, {FRAME, CROSS}), (ROCK, {FRAME}), (LONELY, {CROSS})):
        assert colours_about(browser, row + 1) & {FRAME, CROSS} == marks
    browser.one("#map").send_keys("P")
    while browser.facts()["row"] != str(ROCK + 1):
        browser.one("#map").send_keys("P")
    facts = browser.facts()
    assert (facts["log"], facts["later"]) == ("may", "logs cleared")
    assert browser.one("#tip strong").text.startswith("not flagged by local")
    assert browser.one("#marks").is_displayed()
    # They are about the survey's own flags, not about those of another detector.
    browser.choose("detector-choice", "copod")
    assert "later logs" not in browser.one("#flags-caption").text
    assert not browser.one("#marks").is_displayed()
    assert "later" not in browser.facts()


def test_of_one_log_no_later_one_says_anything(browser):
    browser.open()
    assert "later logs" not in browser.one("#flags").text
    assert not browser.one("#marks").is_displayed()


def test_colours_are_those_of_what_was_measured(browser, bay):
    browser.open()
    clean = pd.read_csv(bay.with_name("clean.csv"))
    kept = clean["Depth (ft)"][~clean["flagged"]]
    data = browser.js("return JSON.parse(document.getElementById('data').textContent)")
    mean = data["layers"][0]
    assert (mean["low"], mean["high"]) == pytest.approx((kept.min(), kept.max()))
    assert browser.one("#bars .bar").get_attribute("aria-label") == (
        f"Depth, and mean (ft): {kept.min():.2f} to {kept.max():.1f}"
    )


def many(folder: Path, n: int = 50_000) -> Path:
    """Write the page of a survey of many samples, which nobody has to judge."""
    t = np.arange(n)
    x = np.column_stack([np.abs((t % 1000) - 500.0), t / 100])
    value = np.sin(x[:, 0] / 50) + np.cos(x[:, 1] / 70)
    flagged = t % 100 == 50
    log = SurveyLog(
        name="many", sha256="", columns=pd.DataFrame({"depth": value}), roles={"value": "depth"},
        rows=t, x=x, value=value, time=None, unit="m", crs=None, refused={}, remarks=[],
    )  # fmt: skip
    east, north = (
        side.ravel() for side in np.meshgrid(np.linspace(0, 500, 50), np.linspace(0, 500, 50))
    )
    maps = pd.DataFrame(
        {
            "x1": east,
            "x2": north,
            "mean": np.sin(east / 50),
            "std": 1 + north,
            "outlier_density": 0.0,
        }
    )
    samples = pd.DataFrame({"x1": x[:, 0], "x2": x[:, 1], "measured": value, "flagged": flagged})
    score = np.where(flagged, 4.0, 1.0) + t / n
    verdicts = {f"number{k}": Verdict(flagged, score, value, 3.0) for k in range(5)}
    place = SurveyedConfig(extent=[0.0, 500.0, 0.0, 500.0], origin=[0.0, 0.0])
    data = page_data(samples, sources_of(log), maps, verdicts, log, place) | {"belongs": ""}
    parts = dict.fromkeys(("title", "subtitle", "later", "detectors", "numbers"), "many")
    write_page(folder / "page.html", fill_survey_page(data, parts))
    return folder / "page.html"


def test_of_fifty_thousand_samples_a_part_is_drawn_and_all_are_there(browser, tmp_path):
    browser.page = many(tmp_path)
    assert browser.page.stat().st_size < 6e6
    browser.open()
    browser.painted()
    assert browser.one("#thinned").text == (
        "50000 samples in view: one in 7 is drawn, and all flagged ones; zoom in to see the others."
    )
    assert len(browser.all("#flag-table tbody tr")) == 100
    assert "; 100 are listed" in browser.one("#flags-caption").text
    browser.one("#all-flags").click()
    rows = browser.all("#flag-table tbody tr")
    assert len(rows) == 500
    assert rows[0].text.startswith("49951 ")
    for _ in range(6):
        browser.one("#closer").click()
    browser.painted()
    assert browser.one("#thinned").text == ""
    browser.one("#next").click()
    assert browser.facts()["row"] == "1"
    browser.one("#next-flag").click()
    assert browser.facts()["row"] == "51"
