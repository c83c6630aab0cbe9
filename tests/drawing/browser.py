"""Pages in a headless Chromium, watched for what they should not do."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from geodesic_ocp.drawing.browser import ENVIRONMENT_VARIABLE, SOFTWARE_RENDERING, find_chromium

LOCAL = ("file:", "data:", "blob:", "about:")
TIMEOUT = 30_000.0  # [ms]; software rendering on a busy machine takes seconds
ARGUMENTS = (
    "--no-sandbox",
    "--no-first-run",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
NO_WEBGL = ("--disable-gpu", "--disable-3d-apis")
WIDTH = 720  # of the window [px], in which two panes are side by side
BODY = 0.25  # by how much bodies differ from the background at least; lines of the floor less


@dataclass
class Watched:
    """A page, and what it did that a self-contained page does not do.

    Attributes:
        page: of playwright.
        complaints: warnings and errors on its console, uncaught errors.
        requests: addresses outside the page and its file.
    """

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.complaints.append(f"uncaught: {error}"))
        self.page.on("request", lambda request: self._request(request.url))
        self.page.on("websocket", lambda socket: self._request(socket.url))

    def _console(self, message: Any) -> None:
        # What a driver of the graphics card says about its own speed is not the page's doing.
        if message.type in ("warning", "error") and "GL Driver Message" not in message.text:
            self.complaints.append(f"{message.type}: {message.text}")

    def _request(self, address: str) -> None:
        if not address.startswith(LOCAL):
            self.requests.append(address)

    def check(self) -> None:
        """It logged nothing, raised nothing, and asked nobody for anything."""
        assert not self.complaints
        assert not self.requests


@contextmanager
def playwright_or_skip() -> Iterator[Any]:
    """The driver of browsers.

    An event loop runs as long as it is open, so that it must not outlast the tests of one file.
    """
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright (extra dev)")
    with sync_api.sync_playwright() as playwright:
        yield playwright


@contextmanager
def chromium(playwright: Any, *arguments: str) -> Iterator[Any]:
    """A browser with software rendering, or with these arguments instead."""
    program = find_chromium(playwright)
    if program is None:
        pytest.skip(f"no Chromium: set {ENVIRONMENT_VARIABLE}, or run: make browser")
    from playwright.sync_api import Error

    try:
        browser = playwright.chromium.launch(
            executable_path=program, args=[*ARGUMENTS, *(arguments or SOFTWARE_RENDERING)]
        )
    except Error as reason:
        pytest.skip(f"{program} cannot be started: {str(reason).splitlines()[0]}")
    try:
        yield browser
    finally:
        browser.close()


@contextmanager
def opened(
    browser: Any,
    file: Path,
    *,
    width: int = 1280,
    height: int = 900,
    javascript: bool = True,
    clock: bool = False,
) -> Iterator[Any]:
    """A page from a file, without a network; it is checked at the end that it was quiet.

    Args:
        browser: of playwright.
        file: with the page.
        width, height: of the window [px].
        javascript: whether it is enabled.
        clock: whether the test can stop its clock, which begins at 0 (`page.clock`).
    """
    context = browser.new_context(
        viewport={"width": width, "height": height},
        java_script_enabled=javascript,
        offline=True,
    )
    context.set_default_timeout(TIMEOUT)
    try:
        watched = Watched(context.new_page())
        if clock:
            watched.page.clock.install(time=0)
        watched.page.goto(file.as_uri())
        yield watched.page
        watched.check()
    finally:
        context.close()


def pictures(page: Any, selector: str) -> list[np.ndarray]:
    """What is on the screen where elements are, (height, width, 3) from 0 to 1 each."""
    page.evaluate("scrollTo(0, 0)")
    screen = matplotlib.image.imread(io.BytesIO(page.screenshot()))[..., :3]
    boxes = [element.bounding_box() for element in page.locator(selector).all()]
    found = []
    for box in boxes:
        left, top, width, height = (round(box[name]) for name in ("x", "y", "width", "height"))
        found.append(screen[top : top + height, left : left + width])
    return found


def ask(page: Any, expression: str) -> Any:
    """What an expression gives of the first viewer of a page."""
    return page.evaluate(f"() => {{ const viewer = geodesicOcp.viewers[0]; return {expression}; }}")


def panes(page: Any, canvas: bool = True) -> list[np.ndarray]:
    """What is seen in each pane, with what is drawn there or the background alone."""
    style = f"canvas => canvas.style.visibility = {'visible' if canvas else 'hidden'!r}"
    for element in page.locator("canvas").all():
        element.evaluate(style)
    return pictures(page, ".playback-view")


def changed_fraction(before: np.ndarray, after: np.ndarray, tolerance: float = 0.04) -> float:
    """The fraction of pixels that differ between two pictures of the same size."""
    assert before.shape == after.shape
    return float(np.mean(np.abs(before - after).max(axis=2) > tolerance))


def hue_fraction(pixels: np.ndarray, colour: str, tolerance: float = 0.05) -> float:
    """The fraction of pixels with the hue of a colour, in light and in shade."""
    import matplotlib.colors

    hue, saturation, _ = matplotlib.colors.rgb_to_hsv(matplotlib.colors.to_rgb(colour))
    seen = matplotlib.colors.rgb_to_hsv(pixels)
    distance = np.abs((seen[..., 0] - hue + 0.5) % 1.0 - 0.5)
    coloured = (seen[..., 1] > 0.4 * saturation) & (seen[..., 2] > 0.1)
    return float(np.mean((distance < tolerance) & coloured))
