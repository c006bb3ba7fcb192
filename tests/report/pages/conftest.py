"""A real browser, without a network."""

import pytest

from browser import Browser, start_browser


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory):
    browser = start_browser(tmp_path_factory.mktemp("browser"))
    yield browser
    browser.close()


@pytest.fixture
def browser(chromium: Browser):
    """A browser to which nothing bad happens during a test."""
    chromium.problems.clear()
    chromium.notes.clear()
    yield chromium
    assert chromium.problems == []
