"""Plots below the scenes: text that can be read, and axes where the cursor believes them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from geodesic_ocp.drawing.page import fragment
from geodesic_ocp.drawing.plots import draw_plot
from geodesic_ocp.drawing.scene import SECONDS, Curve, Playback, Plot, Scene, Span
from geodesic_ocp.drawing.styles import ROLES, line_styles

SVG = "{http://www.w3.org/2000/svg}"
TIME = np.linspace(0.0, 2.0, 2001)
SPANS = [Span("a", 0.0, 0.5), Span("b", 0.5, 1.5), Span("c", 1.5, 2.0)]


def drawn(
    *curves: Curve, label: str = "speed [m/s]", title: str = "", spans: tuple[Span, ...] = ()
) -> tuple[ElementTree.Element, tuple[float, ...]]:
    svg, place = draw_plot(Plot(label, curves, title), (0.0, 2.0), SECONDS, spans)
    return ElementTree.fromstring(svg), place


def texts(svg: ElementTree.Element) -> list[str]:
    return ["".join(element.itertext()).strip() for element in svg.iter(f"{SVG}text")]


def strokes(svg: ElementTree.Element, colour: str) -> list[np.ndarray]:
    """Points of all lines of a colour, in the SVG's coordinates."""
    found = []
    for path in svg.iter(f"{SVG}path"):
        if f"stroke: {colour}" in path.get("style", ""):
            numbers = re.findall(r"-?\d+(?:\.\d+)?", path.get("d", ""))
            found.append(np.array(numbers, dtype=float).reshape(-1, 2))
    return found


def test_the_time_axis_is_where_the_cursor_believes_it() -> None:
    colour = ROLES["observed"]["color"]
    switched = Curve("d", TIME, 2.0 * TIME**2, layer="another")  # is given room, but not drawn
    svg, (left, right, bottom, top, low, high) = drawn(
        Curve("c", TIME, TIME**2, "observed"), switched
    )
    _, _, width, height = map(float, svg.get("viewBox", "").split())
    (line,) = strokes(svg, colour)
    np.testing.assert_allclose(line[[0, -1], 0], [left * width, right * width], atol=0.1)
    shares = (np.array([0.0, 4.0]) - low) / (high - low)
    expected = height * (1.0 - bottom - shares * (top - bottom))
    np.testing.assert_allclose(line[[0, -1], 1], expected, atol=0.1)
    assert high > 8.0
    assert not strokes(svg, line_styles(1)[0]["color"])


def test_curves_have_the_colours_of_their_roles() -> None:
    curves = [Curve(role, TIME, TIME * k, role) for k, role in enumerate(ROLES)]
    svg, _ = drawn(*curves, Curve("another", TIME, TIME - 1.0))
    assert {"speed [m/s]", "time [s]"} <= set(texts(svg))
    for style in ROLES.values():
        assert len(strokes(svg, style["color"])) == 1


def test_names_are_text_whatever_they_contain() -> None:
    title = "_first $x^2$ <script> a & b \u95a2\u7bc0 nul\x00 and\nline"
    svg, _ = drawn(Curve("c", TIME, TIME), label="$q$ [rad]", title=title)
    assert "$q$ [rad]" in texts(svg)
    assert "_first $x^2$ <script> a & b \u95a2\u7bc0 nul  and line" in texts(svg)


def test_names_that_no_file_can_hold_are_made_plain() -> None:
    plot = Plot("q", (Curve("c", TIME, TIME),), "a\u202eb")
    svg, _ = draw_plot(plot, (0.0, 2.0), "t\x00 [s]", ())
    assert {"a b", "t  [s]"} <= set(texts(ElementTree.fromstring(svg)))


@pytest.mark.slow
def test_every_second_span_is_shaded() -> None:
    curve = Curve("c", TIME, TIME, "observed")
    bare, _ = drawn(curve)
    shaded, _ = drawn(curve, spans=tuple(SPANS))
    count = [len(list(svg.iter(f"{SVG}path"))) for svg in (bare, shaded)]
    assert count[1] == count[0] + 1


def test_the_legend_names_curves_and_marks() -> None:
    curves = (Curve("one", TIME, TIME), Curve("other", TIME, TIME, layer="another"))
    plot = Plot("x [m]", curves, marks=(0.5, 1.5), marked="limits")
    page = fragment(Playback("", (Scene("", TIME[[0, -1]]),), {}, (plot,)))
    (legend,) = re.findall("<figcaption>(<span.*?)</figcaption>", page)
    entries = re.findall(r"<span( hidden)?>.*?</svg>(\w+) <b></b></span>", legend)
    assert entries == [("", "one"), (" hidden", "other"), ("", "limits")]


def test_a_plot_is_small_and_always_the_same() -> None:
    plot = Plot("x [m]", (Curve("c", TIME, np.sin(9.0 * TIME), "observed"),), marks=(0.5,))
    first, again = (draw_plot(plot, (0.0, 2.0), SECONDS, SPANS) for _ in range(2))
    assert first == again
    assert len(first[0]) < 25_000


@pytest.mark.slow
def test_unknown_values_and_a_still_time_are_drawn() -> None:
    values = np.where(TIME < 1.0, np.nan, TIME)
    drawn(Curve("c", TIME, values, "observed"))
    svg, _ = draw_plot(Plot("x", (Curve("c", np.zeros(1), np.ones(1)),)), (0.0, 0.0), SECONDS, ())
    assert svg.startswith("<svg")
