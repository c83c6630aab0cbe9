"""Pages in a headless Chromium, in which they are shot one instant after the other."""

from __future__ import annotations

import base64
import io
import math
import os
import shutil
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.drawing.page import page, web_file
from geodesic_ocp.drawing.scene import Playback

Frame: TypeAlias = NDArray[np.uint8]  # (height, width, 3)

ENVIRONMENT_VARIABLE = "GEODESIC_OCP_CHROMIUM"
_ON_PATH = ("chromium", "chromium-browser", "google-chrome", "msedge", "microsoft-edge")
# The same pictures whatever the graphics card. What is around the scenes is faster without OpenGL.
SOFTWARE_RENDERING = (
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-gpu-rasterization", "--disable-gpu-compositing"),
)
_MISSING = (
    "Pictures and videos of scenes are shot by a browser: pip install 'geodesic_ocp[show]', and "
    "a Chromium by `playwright install chromium` or from the system's packages, or named in "
    f"{ENVIRONMENT_VARIABLE}"
)
_WIDTH = 960  # [px] of a page that is as wide as its picture, or is enlarged to it
_LEAST = 0.75  # pixels of a picture in place of one of the page; letters below could not be read
# A JPEG, whose rounding is not seen, is there in two thirds of the time that a PNG takes.
_SHOT = {"format": "jpeg", "quality": 100, "optimizeForSpeed": True}
_AHEAD = 1  # pictures that are shot while an earlier one is written
_PATIENCE = 120_000.0  # [ms], after which a browser does not answer any more


def find_chromium(playwright: Any) -> str | None:
    """Return the program that the environment names, playwright's own, or one on the path."""
    if named := os.environ.get(ENVIRONMENT_VARIABLE):
        return named
    own = playwright.chromium.executable_path
    if Path(own).exists():
        return str(own)
    return next((found for name in _ON_PATH if (found := shutil.which(name))), None)


@contextmanager
def chromium() -> Iterator[tuple[ThreadPoolExecutor, Any]]:
    """Start a browser in a thread of its own, as event loops such as a notebook's forbid it theirs.

    Yields:
        The thread, and the browser, which must be used there.

    Raises:
        ImportError: there is no playwright, or no Chromium that starts.
    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as reason:
        raise ImportError(_MISSING) from reason

    with ThreadPoolExecutor(1, "browser") as thread:

        def launch(driver: Any) -> Any:
            program = find_chromium(driver)
            if program is None:
                raise ImportError(_MISSING)
            try:
                return driver.chromium.launch(executable_path=program, args=[*SOFTWARE_RENDERING])
            except Error as reason:
                said = str(reason).splitlines()[0]
                raise ImportError(f"{program} does not start ({said}). {_MISSING}") from reason

        driver = thread.submit(lambda: sync_playwright().start()).result()
        try:
            yield thread, thread.submit(launch, driver).result()
        finally:
            thread.submit(driver.stop).result()  # which ends its browsers


def frames(
    playback: Playback,
    instants: Sequence[float],
    *,
    width: int,
    turns: Sequence[float] | None = None,
) -> Iterator[Frame]:
    """Yield pictures of a playback: of its page, without what is there for the hand.

    Args:
        playback: what is shown.
        instants: instants of the pictures, in the playback's time.
        width: width of the pictures [px], even.
        turns: turns of the camera at each instant [rad]; None: it stands still.

    Raises:
        ImportError: there is no browser.
    """
    angles = [0.0] * len(instants) if turns is None else turns
    with chromium() as (thread, browser):
        shoot = thread.submit(_film, browser, playback, width, turns is not None).result()
        shots: deque[Future[bytes]] = deque()
        for instant, angle in zip(instants, angles, strict=True):
            shots.append(thread.submit(shoot, instant, angle))
            if len(shots) > _AHEAD:
                yield _picture(shots.popleft().result())
        for shot in shots:
            yield _picture(shot.result())


def _film(
    browser: Any, playback: Playback, width: int, around: bool
) -> Callable[[float, float], bytes]:
    """Open the page of a playback; return what shoots it at an instant, the camera turned."""
    wide = min(_WIDTH, round(width / _LEAST))
    context = browser.new_context(
        viewport={"width": wide, "height": wide},
        device_scale_factor=width / wide,
        offline=True,
    )
    context.set_default_timeout(_PATIENCE)
    sheet = context.new_page()
    sheet.set_content(page(playback))
    sheet.add_style_tag(content=web_file("film.css"))
    sheet.evaluate(web_file("film.js"))
    height = sheet.evaluate("around => geodesicOcp.film(around)", around)
    box = {"width": wide, "height": math.ceil(height)}
    sheet.set_viewport_size(box)
    devtools = context.new_cdp_session(sheet)
    clip = {"x": 0, "y": 0, "scale": width / wide, **box}

    def shoot(instant: float, turn: float) -> bytes:
        sheet.evaluate("([time, angle]) => geodesicOcp.frame(time, angle)", [instant, turn])
        shot = devtools.send("Page.captureScreenshot", {**_SHOT, "clip": clip})
        return base64.b64decode(shot["data"])

    return shoot


def _picture(data: bytes) -> Frame:
    """Return a picture of an even height, as videos need it."""
    from PIL import Image

    with Image.open(io.BytesIO(data)) as image:
        pixels: Frame = np.asarray(image.convert("RGB"))
    return pixels[: len(pixels) // 2 * 2]
