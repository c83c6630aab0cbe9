"""What pages may not do: run scripts of others, or reach the notebook that they are in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.drawing.actors import model_actor
from geodesic_ocp.drawing.page import document, fragment
from geodesic_ocp.drawing.scene import Playback, Scene
from geodesic_ocp.drawing.viewer import Viewer

pytestmark = pytest.mark.slow
ARM = go.human_arm("right")
STILL = Playback("an arm", (Scene("arm", np.zeros(1), (model_actor(ARM, np.zeros((1, 7))),)),), {})
FOREIGN = """<script>window.hacked = 1</script>
<img src="x" onerror="window.hacked = 2">
<a href="javascript:window.hacked = 3">here</a>
<base href="https://example.org/">
<form action="https://example.org/"><button>send</button></form>"""

SENT_NOWHERE = """() => new Promise((done) => {
  const told = (event) => event.effectiveDirective === "form-action" && done(true);
  document.addEventListener("securitypolicyviolation", told);
  document.querySelector("form button").click();
})"""


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    page = browser.new_page()
    page.context.set_offline(True)
    yield page
    page.close()


def test_a_page_runs_its_own_scripts_alone(page: Any, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text(document("t", FOREIGN + fragment(STILL)), encoding="utf-8")
    page.goto(file.as_uri())
    page.get_by_text("here").click()
    assert page.evaluate(SENT_NOWHERE)
    assert page.evaluate("geodesicOcp.viewers[0].panes.length") == 1
    assert page.evaluate("typeof window.hacked") == "undefined"
    assert page.evaluate("document.baseURI") == page.url == file.as_uri()


def test_a_frame_of_a_notebook_cannot_reach_it_and_fills_the_screen(
    page: Any, tmp_path: Path
) -> None:
    file = tmp_path / "notebook.html"
    file.write_text(f"<!DOCTYPE html>{Viewer(STILL)._repr_html_()}", encoding="utf-8")
    page.goto(file.as_uri())
    frame = page.frames[1]
    frame.get_by_role("button", name="full screen").wait_for()
    assert frame.evaluate("geodesicOcp.viewers[0].panes.length") == 1
    reached = "() => { try { return parent.document.title; } catch { return 'blocked'; } }"
    assert frame.evaluate(reached) == "blocked"
    frame.get_by_role("button", name="full screen").click()
    frame.locator(":fullscreen").wait_for()
