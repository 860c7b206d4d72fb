"""Debian's Chromium, driven by Selenium."""

import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

for folder in ("analyse", "draw"):
    sys.path.append(str(Path(__file__).parents[1] / folder))

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="session")
def driver() -> Iterator[object]:
    try:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service
    except ImportError:
        pytest.fail("the browser tests need Selenium: pip install -e '.[dev]'", pytrace=False)
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    chromedriver = shutil.which("chromedriver")
    if browser is None or chromedriver is None:
        pytest.fail(
            f"the browser tests need Chromium and its driver, and there is "
            f"{browser or 'no Chromium'} and {chromedriver or 'no chromedriver'}: on Debian, "
            "apt-get install chromium chromium-driver",
            pytrace=False,
        )
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for flag in (*FLAGS, f"--user-data-dir={Path(profile) / 'profile'}"):
            options.add_argument(flag)
        chrome = webdriver.Chrome(options=options, service=Service(chromedriver))
        yield chrome
        chrome.quit()
