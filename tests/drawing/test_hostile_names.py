"""Names from files are shown on pages as they are, and never read as HTML or as programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing.browser import WIDTH, ask, opened

import geodesic_ocp as go
from geodesic_ocp.drawing.actors import model_actor
from geodesic_ocp.drawing.scene import (
    Curve,
    FrameTrack,
    Gap,
    Playback,
    Plot,
    PointCloud,
    Scene,
    Solid,
    Span,
    Trail,
)
from geodesic_ocp.drawing.viewer import Viewer

pytestmark = pytest.mark.slow
EVIL = (
    "<script>window.hacked = 1</script>",
    "</script><script>window.hacked = 2</script>",
    "<img src=x onerror='window.hacked = 3'>",
    '"><svg onload="window.hacked = 4">',
    "<!--<script>",
    "${window.hacked = 5} $x^$ & _{",
)


@pytest.fixture(scope="module")
def evil() -> Playback:
    """A page on which every name comes from somebody who means harm."""
    script, closing, image, attribute, comment, template = EVIL
    arm, time = go.human_arm(), np.linspace(0.0, 1.0, 5)
    line = np.outer(time, [0.3, 0.2, 0.1])
    actor = replace(model_actor(arm, np.zeros((5, 7)) + time[:, None]), name=image, layer=image)
    scene = Scene(
        *(closing, time, (actor,)),
        trails=(Trail(attribute, line, "observed", line, layer=comment),),
        solids=(Solid(image, np.eye(3), np.array([[0, 1, 2]]), layer=template),),
        frames=(FrameTrack(script, np.eye(3)[None], np.zeros((1, 3))),),
        gaps=(Gap(script, line, line + 0.1, time),),
        clouds=(PointCloud(script, np.zeros((5, 2, 3)), (script, image)),),
        note=image,
    )
    spans = {script: (Span(image, 0.0, 0.6, closing), Span(comment, 0.6, 1.0, attribute))}
    curves = tuple(Curve(name, time, time + k) for k, name in enumerate(EVIL))
    plot = Plot(f"{script} [rad]", curves, title=template)
    return Playback(closing, (scene, replace(scene, title=script)), spans, (plot,), hidden=())


def test_names_are_shown_and_not_run(browser: Any, evil: Playback, tmp_path: Path) -> None:
    file = Viewer(evil).save(tmp_path / "evil.html")
    with opened(browser, file, width=WIDTH, height=560) as page:
        script, closing, image, _, comment, template = EVIL
        assert ask(page, "viewer.panes.length") == 2
        assert page.title() == page.locator("h1").inner_text() == closing
        captions = page.locator(".playback-pane figcaption").all_inner_texts()
        assert captions == [f"{closing} {image}", f"{script} {image}"]
        legend = page.locator(".playback-plot figcaption > span").all_inner_texts()
        assert legend == [f"{name} {k}.00" for k, name in enumerate(EVIL)]
        assert page.locator(".playback-spans button").all_text_contents() == [image, comment]
        for name in (image, comment, template):
            page.get_by_label(name, exact=True).click()
        box = page.locator(".playback-view").first.bounding_box()
        for x in np.linspace(0.3, 0.7, 5):
            page.mouse.move(box["x"] + x * box["width"], box["y"] + 0.5 * box["height"])
            page.wait_for_timeout(150)
        page.locator(".playback-spans button").last.click()
        assert page.evaluate("typeof window.hacked") == "undefined"
