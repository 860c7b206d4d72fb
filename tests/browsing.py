"""A page in Chromium, for the tests of all pages."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

Page = TypeVar("Page", bound="Browser")


class Browser:
    """A page on a screen of some size."""

    def __init__(self, driver, page: Path):
        self.driver = driver
        self.page = page

    def open(self, width: int = 1200, height: int = 900, dark: bool = False) -> "Browser":
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500},
        )
        self.driver.get_log("browser")
        self.driver.get(self.page.as_uri())
        return self

    def all(self, selector: str) -> list:
        return self.driver.find_elements("css selector", selector)

    def one(self, selector: str):
        return self.driver.find_element("css selector", selector)

    def js(self, code: str, *arguments):
        return self.driver.execute_script(code, *arguments)

    def press(self, *keys: str) -> None:
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def focused(self):
        return self.driver.switch_to.active_element

    def fetched(self) -> list[str]:
        """Name what the page has asked the network for."""
        names = self.js("return performance.getEntriesByType('resource').map((one) => one.name)")
        return [name for name in names if not name.startswith("data:")]


def luminance(colour: str) -> float:
    parts = [int(number) / 255 for number in re.findall(r"\d+", colour)[:3]]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(browser: Browser, selector: str) -> float:
    """Contrast of an element's text with what lies behind it."""
    ink, paper = browser.js(
        "const colour = (one) => getComputedStyle(one).backgroundColor;"
        "let back = arguments[0];"
        "while (colour(back) === 'rgba(0, 0, 0, 0)') back = back.parentElement;"
        "return [getComputedStyle(arguments[0]).color, colour(back)]",
        browser.one(selector),
    )
    low, high = sorted((luminance(ink), luminance(paper)))
    return (high + 0.05) / (low + 0.05)


@contextmanager
def silent(browser: Page) -> Iterator[Page]:
    """Whatever a test does with a page: no error, no warning, no request, no dialogue."""
    yield browser
    assert browser.driver.get_log("browser") == []
    assert browser.fetched() == []


def paper(browser: Browser) -> float:
    """Luminance of the page's ground."""
    return luminance(browser.js("return getComputedStyle(document.body).backgroundColor"))


def assert_readable(browser: Browser, dark: bool, selectors: Iterable[str]) -> None:
    """The ground is of the theme, and texts stand out from what is behind them (WCAG AA)."""
    assert (paper(browser) < 0.05) == dark
    for selector in selectors:
        assert contrast(browser, selector) >= 4.5, selector
