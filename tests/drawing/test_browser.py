"""Pages of results in a browser: what is seen on them, and what can be done with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing.browser import (
    BODY,
    NO_WEBGL,
    WIDTH,
    ask,
    changed_fraction,
    chromium,
    hue_fraction,
    opened,
    panes,
    pictures,
)
from small_retargeting import small_retargeting

import geodesic_ocp as go
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.drawing.scene import Playback
from geodesic_ocp.drawing.styles import ROLES
from geodesic_ocp.drawing.viewer import Viewer

pytestmark = pytest.mark.slow


def near(value: float, tolerance: float = 0.02) -> Any:
    """A time, up to the place of a pointer on the screen."""
    return pytest.approx(value, abs=tolerance)


@pytest.fixture(scope="module")
def swing() -> tuple[go.Motion, go.Model]:
    """A person who moves the trunk and both arms for 20 s, recorded at 100 Hz."""
    model, time = go.human_upper_body(), np.arange(2001) / 100.0
    q = [0.25 * np.sin((0.5 + 0.1 * k) * time + k) for k in range(len(model.joint_names))]
    return go.Motion(time, np.column_stack(q), tuple(model.joint_names)), model


@pytest.fixture(scope="module")
def past_a_lamp() -> go.ocp.Solution:
    start, lamp = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1), go.Ball((0.2, 0.35, -0.15), 0.06)
    reach = go.Reach(go.human_arm(), start, (0.1, 0.45, 0.1), obstacles=[lamp])
    return go.solve(reach)


KINDS = {
    "motion": lambda value: playback_of(*value("swing")),
    "path": lambda value: playback_of(value("past_a_lamp")),
    "analysis": lambda value: playback_of(value("bundled_analysis")),
    "retargeting": lambda value: playback_of(small_retargeting()),
    "several": lambda value: playback_of(value("past_a_lamp"), value("bundled_analysis")),
}
File = Callable[[str], Path]


@pytest.fixture(scope="module")
def playback(request: pytest.FixtureRequest) -> Callable[[str], Playback]:
    made: dict[str, Playback] = {}

    def of(kind: str) -> Playback:
        if kind not in made:
            made[kind] = KINDS[kind](request.getfixturevalue)
        return made[kind]

    return of


@pytest.fixture(scope="module")
def file(playback: Callable[[str], Playback], tmp_path_factory: pytest.TempPathFactory) -> File:
    """The page of a kind of result, on disk."""
    folder = tmp_path_factory.mktemp("pages")

    def of(kind: str) -> Path:
        path = folder / f"{kind}.html"
        return path if path.exists() else Viewer(playback(kind)).save(path)

    return of


@pytest.fixture(scope="module")
def page_of(browser: Any, file: File) -> Iterator[Callable[[str], Any]]:
    """The page of a kind of result, opened once and at its first time, in a small window."""
    pages: dict[str, Any] = {}
    with ExitStack() as stack:

        def of(kind: str) -> Any:
            if kind not in pages:
                small = opened(browser, file(kind), width=WIDTH, height=560)
                pages[kind] = stack.enter_context(small)
            pages[kind].set_viewport_size({"width": WIDTH, "height": 560})
            ask(pages[kind], "viewer.pause() ?? viewer.seek(viewer.range[0]) ?? viewer.reset()")
            return pages[kind]

        yield of


@pytest.mark.parametrize("kind", ["motion", "retargeting"])  # others are drawn below
def test_every_kind_is_drawn_and_moves(
    page_of: Callable[[str], Any], playback: Callable[[str], Playback], kind: str
) -> None:
    page = page_of(kind)
    start, stop = ask(page, "viewer.range")
    assert (start, stop) == pytest.approx(playback(kind).range)
    at_start = panes(page)
    assert len(at_start) == len(playback(kind).scenes)
    ask(page, f"viewer.seek({(start + stop) / 2})")
    halfway = panes(page)
    without = panes(page, canvas=False)
    for index, scene in enumerate(playback(kind).scenes):
        assert changed_fraction(at_start[index], halfway[index]) > 0.002
        assert changed_fraction(without[index], halfway[index], BODY) > 0.02
        for role in {trail.role for trail in scene.trails if trail.layer == "hand path"}:
            assert hue_fraction(halfway[index], ROLES[role]["color"]) > 1e-4


def test_plays_at_any_speed_pauses_and_loops(browser: Any, file: File) -> None:
    with opened(browser, file("path"), width=300, height=300, clock=True) as page:
        ask(page, "viewer.time")
        page.clock.pause_at(1_000_000)
        ask(page, "viewer.play()")
        assert ask(page, "viewer.time") == 0.0
        page.clock.run_for(200)  # [ms]; a path takes 4 s
        assert ask(page, "viewer.time") == near(0.05, 0.01)
        page.get_by_label("speed").select_option("2")
        page.clock.run_for(200)
        assert ask(page, "viewer.time") == near(0.15, 0.01)
        page.get_by_role("button", name="pause").click()
        page.clock.run_for(200)
        assert ask(page, "viewer.time") == near(0.15, 0.01)
        assert not ask(page, "viewer.playing")
        ask(page, "viewer.seek(0.95)")
        page.get_by_label("loop").check()
        page.get_by_role("button", name="play").click()
        page.clock.run_for(200)
        assert ask(page, "viewer.time") == near(0.05, 0.01)
        page.get_by_label("loop").uncheck()
        ask(page, "viewer.seek(0.95)")
        page.clock.run_for(200)
        assert ask(page, "[viewer.time, viewer.playing]") == [1.0, False]


def test_every_way_to_a_time(
    page_of: Callable[[str], Any], playback: Callable[[str], Playback]
) -> None:
    page = page_of("analysis")
    shown = playback("analysis")
    stop = shown.range[1]
    ask(page, "viewer.seek(1e9)")
    assert ask(page, "viewer.time") == stop
    page.get_by_role("slider").fill("2.5")
    assert ask(page, "viewer.time") == near(2.5)
    clock = page.get_by_label("time", exact=True)
    assert "2.50" in clock.inner_text()

    # A click where the cursor is at some time leads to that time.
    plot = page.locator(".playback-plot").first
    cursor, (x, _, width, height) = plot.locator("i").bounding_box(), plot.bounding_box().values()
    at_start = ask(page, "viewer.seek(viewer.range[0])") or plot.locator("i").bounding_box()
    at_end = ask(page, "viewer.seek(viewer.range[1])") or plot.locator("i").bounding_box()
    assert at_start["x"] < cursor["x"] < at_end["x"]
    plot.click(position={"x": cursor["x"] + cursor["width"] / 2 - x, "y": 0.4 * height})
    assert ask(page, "viewer.time") == near(2.5, 2.0 / width * stop)

    span = shown.spans["synergies"][14]
    button = page.locator(".playback-spans button").nth(14)
    assert button.text_content() == span.name
    button.click()
    assert ask(page, "viewer.time") == near(span.start)
    press = page.keyboard.press
    press("ArrowRight")
    assert ask(page, "viewer.time") == near(span.start + 0.1)
    press("Shift+ArrowRight")
    assert ask(page, "viewer.time") == near(shown.spans["synergies"][15].start)
    press(",")
    assert 0.0 < shown.spans["synergies"][15].start - ask(page, "viewer.time") < 0.05
    press("End")
    assert ask(page, "viewer.time") == stop
    press("Home")
    assert ask(page, "viewer.time") == 0.0
    page.locator("h1").click()
    press(" ")
    assert ask(page, "viewer.playing")
    press(" ")
    assert not ask(page, "viewer.playing")


def test_plots_show_values_at_the_cursor_and_curves_of_layers(
    page_of: Callable[[str], Any], playback: Callable[[str], Playback]
) -> None:
    page, shown = page_of("analysis"), playback("analysis")
    ask(page, "viewer.seek(2.5)")
    (index,) = (k for k, plot in enumerate(shown.plots) if plot.label == "hand speed [m/s]")
    figure, curves = page.locator(".playback-plot").nth(index), shown.plots[index].curves
    values = figure.locator("b").all_text_contents()
    for curve, value in zip(curves, values, strict=True):
        now = float(value.replace("\u2212", "-"))
        assert now == pytest.approx(np.interp(2.5, curve.time, curve.values), abs=0.006)
    layer = next(curve.layer for curve in curves if curve.layer)
    entry, lines = figure.get_by_text(layer), figure.locator("div path").all()
    for on in (True, False):
        ask(page, f"viewer.setLayer({layer!r}, {str(on).lower()})")
        assert entry.is_visible() == on
        boxes = [line.bounding_box() for line in lines if line.is_visible()]
        assert len(boxes) == on
        axes = figure.locator("div svg").bounding_box()
        assert all(box["width"] == near(axes["width"], 2.0) for box in boxes)


def test_layers_are_switched(page_of: Callable[[str], Any]) -> None:
    page = page_of("path")
    ask(page, "viewer.seek(0.4)")
    (before,) = panes(page)
    for name, on in ask(page, "viewer.layers").items():
        box = page.get_by_label(name, exact=True)
        assert box.is_checked() == on
        box.click()
        assert ask(page, "viewer.layers")[name] != on
        assert changed_fraction(before, panes(page)[0]) > 2e-4, name
        ask(page, f"viewer.setLayer({name!r}, {str(on).lower()})")
        assert box.is_checked() == on


def test_panes_share_a_camera(page_of: Callable[[str], Any]) -> None:
    page = page_of("several")
    before = panes(page)
    views = "viewer.panes.map(p => p.camera.position.clone().sub(p.controls.target).toArray())"
    one, other = ask(page, views)
    assert one == pytest.approx(other)
    box = page.locator(".playback-view").first.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 140, steps=4)
    page.mouse.up()
    turned, followed = ask(page, views)
    assert turned == pytest.approx(followed)
    assert np.linalg.norm(np.subtract(turned, one)) > 0.2
    assert all(changed_fraction(*each) > 0.02 for each in zip(before, panes(page), strict=True))
    page.locator(".playback-view").last.dblclick()
    assert ask(page, views) == [pytest.approx(one), pytest.approx(other)]


def test_the_wheel_scrolls_the_page_until_a_view_is_clicked(page_of: Callable[[str], Any]) -> None:
    page = page_of("path")
    page.set_viewport_size({"width": WIDTH, "height": 300})
    ask(page, "scrollTo(0, 0)")
    distance = "viewer.panes[0].camera.position.distanceTo(viewer.panes[0].controls.target)"
    box = page.locator(".playback-view").bounding_box()
    page.locator("h1").click()
    before = ask(page, distance)
    page.mouse.move(box["x"] + 60, box["y"] + 60)
    page.mouse.wheel(0, 120)
    page.evaluate("""async () => {
      while (!scrollY) await new Promise(requestAnimationFrame);
    }""")
    assert ask(page, distance) == pytest.approx(before)
    ask(page, "scrollTo(0, 0)")
    page.mouse.click(box["x"] + 60, box["y"] + 60)
    page.mouse.wheel(0, 120)
    assert ask(page, distance) > 1.01 * before
    assert ask(page, "scrollY") == 0.0


def test_keys_turn_a_view_that_was_reached_by_keys(page_of: Callable[[str], Any]) -> None:
    page = page_of("path")
    view = "viewer.panes[0].camera.position.toArray()"
    page.locator("h1").click()
    page.keyboard.press("Tab")
    assert ask(page, "document.activeElement.className") == "playback-view"
    before = ask(page, view)
    page.keyboard.press("ArrowRight")
    assert ask(page, "viewer.time") == 0.0
    assert np.linalg.norm(np.subtract(ask(page, view), before)) > 0.1
    page.keyboard.press("ArrowLeft")
    assert ask(page, view) == pytest.approx(before)
    page.keyboard.press("Shift+ArrowRight")
    assert ask(page, "viewer.time") > 0.0
    page.locator("h1").click()


def test_a_layer_names_each_colour_once(page_of: Callable[[str], Any]) -> None:
    groups = page_of("retargeting").locator(".playback-layers > div").all()
    colours = "each => [...each.querySelectorAll('i')].map(i => i.style.background)"
    found = [group.evaluate(colours) for group in groups]
    assert sum(map(len, found)) > 3
    assert all(len(set(each)) == len(each) for each in found)


def test_fits_a_phone(page_of: Callable[[str], Any]) -> None:
    page = page_of("several")
    page.set_viewport_size({"width": 1280, "height": 800})
    # Playwright's own waiting evaluates text, which the page's policy forbids.
    fits = """async () => {
      const fit = ({ canvas, element }) => canvas.clientWidth === element.clientWidth && %s;
      while (!geodesicOcp.viewers[0].panes.every(fit)) await new Promise(requestAnimationFrame);
    }"""
    page.evaluate(fits % "canvas.clientWidth > 500")
    page.set_viewport_size({"width": 375, "height": 667})
    page.evaluate(fits % "canvas.clientWidth > 300 && canvas.clientWidth < 375")
    assert page.evaluate("document.documentElement.scrollWidth") <= 375
    plots = [plot.bounding_box() for plot in page.locator(".playback-plot:visible").all()]
    assert len({plot["x"] for plot in plots}) == 1 < len(plots)
    assert all(plot["width"] <= 375 for plot in plots)
    assert changed_fraction(panes(page)[0], panes(page, canvas=False)[0], BODY) > 0.02


def test_without_webgl_the_page_says_so(playwright: Any, file: File) -> None:
    with (
        chromium(playwright, *NO_WEBGL) as browser,
        opened(browser, file("analysis"), width=WIDTH, height=560) as page,
    ):
        assert page.get_by_text("needs WebGL").is_visible()
        ask(page, "viewer.seek(3)")
        assert page.locator(".playback-plot i").first.is_visible()
        assert ask(page, "viewer.time") == 3.0


def test_a_view_that_the_browser_closes_says_so(browser: Any, file: File) -> None:
    """Browsers keep some views open, and close the oldest when a page or notebook has more."""
    with opened(browser, file("path"), width=WIDTH, height=560) as page:
        assert not page.get_by_text("closed this view").is_visible()
        ask(page, "viewer.panes[0].renderer.forceContextLoss()")
        page.get_by_text("closed this view").wait_for(state="visible")
        ask(page, "viewer.seek(0.5)")
        assert ask(page, "viewer.time") == 0.5
        ask(page, "viewer.panes[0].renderer.forceContextRestore()")
        page.get_by_text("closed this view").wait_for(state="hidden")


def test_without_javascript_the_page_says_so(browser: Any, file: File) -> None:
    with opened(browser, file("path"), javascript=False) as page:
        sentence = page.locator("noscript p")
        assert sentence.is_visible()
        assert "needs JavaScript" in sentence.inner_text()
        assert not page.locator(".playback-panes").is_visible()


def test_a_notebook_shows_the_same_in_a_frame(
    browser: Any, playback: Callable[[str], Playback], tmp_path: Path
) -> None:
    notebook = tmp_path / "notebook.html"
    notebook.write_text(Viewer(playback("path"))._repr_html_(), encoding="utf-8")
    with opened(browser, notebook, width=WIDTH, height=560) as page:
        frame = page.frames[1]
        frame.evaluate("geodesicOcp.viewers[0].seek(0.5)")
        assert frame.get_by_label("time", exact=True).inner_text() == "s = 0.50"
        content = frame.evaluate("document.body.offsetHeight")
        assert page.locator("iframe").bounding_box()["height"] == near(content, 2.0)
        shown = "document.querySelector('canvas').style.visibility = '%s'"
        for _ in range(50):  # both are drawn when the browser gets to it
            seen = []
            for visibility in ("hidden", "visible"):
                frame.evaluate(shown % visibility)
                page.wait_for_timeout(100.0)
                seen.append(pictures(page, "iframe")[0])
            if changed_fraction(*seen, BODY) > 0.01:
                break
        else:
            pytest.fail("the arm is not drawn in the frame")
