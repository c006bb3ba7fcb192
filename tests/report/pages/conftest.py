"""A real browser, without a network, and where its screenshots are kept."""

import os
from pathlib import Path

import pytest

from browser import Browser, find_browser

PROGRAM = find_browser()


@pytest.fixture(scope="module")
def screenshots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = os.environ.get("UNBEND_SCREENSHOTS")
    if not folder:
        return tmp_path_factory.mktemp("screenshots")
    Path(folder).mkdir(parents=True, exist_ok=True)
    return Path(folder)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory):
    if PROGRAM is None and not os.environ.get("UNBEND_BROWSER_NEEDED"):
        pytest.skip("no Chromium here: make test-browser installs it")
    assert PROGRAM, "no Chromium was found"
    browser = Browser(PROGRAM, tmp_path_factory.mktemp("browser") / "profile")
    yield browser
    browser.close()


@pytest.fixture
def browser(chromium: Browser):
    """A browser to which nothing bad happens during a test."""
    chromium.problems.clear()
    yield chromium
    assert chromium.problems == []
