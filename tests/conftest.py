"""Fixtures that several files of tests share."""

from __future__ import annotations

import pytest

# before it is first imported: helpers' assertions tell what they found
pytest.register_assert_rewrite("tests.browser")

from .browser import Browser, awaited_browser  # noqa: E402


@pytest.fixture(scope="module")
def running():
    if awaited_browser() is None:
        pytest.skip("needs Chromium")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def browser(running):
    """A window of a desktop in the light; the page must not have complained, nor asked for anything."""
    running.window(740, 420)
    running.dark(False)
    yield running
    assert running.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in running.requests)
