"""Plots below the scenes: text that can be read, and axes where the cursor believes them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from geodesic_ocp.drawing.plots import draw_plot
from geodesic_ocp.drawing.scene import SECONDS, Curve, Plot, Span
from geodesic_ocp.drawing.styles import ROLES

SVG = "{http://www.w3.org/2000/svg}"
TIME = np.linspace(0.0, 2.0, 2001)
SPANS = [Span("a", 0.0, 0.5), Span("b", 0.5, 1.5), Span("c", 1.5, 2.0)]


def drawn(
    *curves: Curve, label: str = "speed [m/s]", title: str = "", spans: tuple[Span, ...] = ()
) -> tuple[ElementTree.Element, tuple[float, float, float, float]]:
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
    svg, (left, right, bottom, top) = drawn(Curve("c", TIME, TIME**2, "observed"))
    _, _, width, height = map(float, svg.get("viewBox", "").split())
    line = max(strokes(svg, colour), key=len)  # the curve, not its mark in the legend
    np.testing.assert_allclose(line[[0, -1], 0], [left * width, right * width], atol=0.1)
    assert np.all(line[:, 1] > (1.0 - top) * height)
    assert np.all(line[:, 1] < (1.0 - bottom) * height)


def test_curves_have_the_colours_and_names_of_their_roles() -> None:
    curves = [Curve(role, TIME, TIME * k, role) for k, role in enumerate(ROLES)]
    svg, _ = drawn(*curves, Curve("another", TIME, TIME - 1.0))
    assert {*ROLES, "another", "speed [m/s]", "time [s]"} <= set(texts(svg))
    for style in ROLES.values():
        assert len(strokes(svg, style["color"])) == 2  # and in the legend


def test_names_are_text_whatever_they_contain() -> None:
    names = ["_first", "$x^2$", "<script>", "a & b", "\u95a2\u7bc0", "nul\x00 and\nline"]
    svg, _ = drawn(*(Curve(name, TIME, TIME) for name in names), label="$q$ [rad]", title="<b>")
    shown = texts(svg)
    assert {"_first", "$x^2$", "<script>", "a & b", "\u95a2\u7bc0", "$q$ [rad]", "<b>"} <= set(
        shown
    )
    assert "nul  and line" in shown


def test_every_second_span_is_shaded() -> None:
    curve = Curve("c", TIME, TIME, "observed")
    bare, _ = drawn(curve)
    shaded, _ = drawn(curve, spans=tuple(SPANS))
    count = [len(list(svg.iter(f"{SVG}path"))) for svg in (bare, shaded)]
    assert count[1] == count[0] + 1


def test_lines_that_are_marked_have_a_name() -> None:
    plot = Plot("x [m]", (Curve("c", TIME, TIME),), marks=(0.5, 1.5), marked="limits")
    svg, _ = draw_plot(plot, (0.0, 2.0), SECONDS, ())
    assert texts(ElementTree.fromstring(svg)).count("limits") == 1


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
