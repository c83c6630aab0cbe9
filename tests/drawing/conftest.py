"""A browser for the tests of pages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from drawing.browser import chromium, playwright_or_skip


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    """The driver of browsers, closed before tests of another file begin."""
    with playwright_or_skip() as driver:
        yield driver


@pytest.fixture(scope="module")
def browser(playwright: Any) -> Iterator[Any]:
    """A Chromium with WebGL in software."""
    with chromium(playwright) as program:
        yield program
