"""Chromium without a window for tests of pages: how it is found, started and read."""

import importlib.util
import shutil
from pathlib import Path

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
WAIT_S = 20
needs_browser = pytest.mark.skipif(
    not (CHROMIUM and DRIVER),
    reason="needs Chromium and its driver: apt-get install chromium chromium-driver",
)


def synthetic_dataset(folder):
    path = Path(__file__).parent.parent / "unit" / "synthetic.py"
    spec = importlib.util.spec_from_file_location("synthetic", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.write_dataset(folder)


def find(browser, selector: str):
    return browser.find_elements("css selector", selector)


def wait_for(browser, script: str, *arguments):
    """Return the value of a script once it is true."""
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(browser, WAIT_S).until(lambda one: one.execute_script(f"return {script}", *arguments))


def open_page(browser, address: str) -> None:
    """Open a page anew, whatever part of it was open before, and wait until it stands."""
    browser.get("about:blank")
    browser.get(address)
    # on a busy machine `get` may come back too early
    wait_for(browser, "document.readyState === 'complete' && location.href === arguments[0]", address)


def reload_page(browser) -> None:
    """Load the page again and wait until it stands."""
    browser.execute_script("window.before = true")
    browser.refresh()
    wait_for(browser, "document.readyState === 'complete' && window.before === undefined")
