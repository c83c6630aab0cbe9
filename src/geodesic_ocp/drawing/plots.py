"""Plots of curves over time: as SVG beside or below the scenes of a page."""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from geodesic_ocp.drawing.scene import Plot, Span, plain_text
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, line_styles, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_STYLE: dict[Any, Any] = {
    **{"svg.fonttype": "none", "svg.hashsalt": "plot", "font.size": 9.5},
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#7a828c"},
    **{"text.parse_math": False},  # names are text, not formulas
}


@contextmanager
def _plot_style() -> Iterator[None]:
    """Draw as pages do, whatever names contain and whatever style the user has chosen."""
    with own_style(_STYLE), warnings.catch_warnings():
        # The browser, which draws the text of pages, has other fonts.
        warnings.filterwarnings("ignore", "Glyph .* missing")
        yield


def curve_styles(plot: Plot) -> list[dict[str, Any]]:
    """Return the line style of each curve, as Matplotlib names it."""
    series = iter(line_styles(sum(curve.role is None for curve in plot.curves)))
    return [next(series) if curve.role is None else ROLES[curve.role] for curve in plot.curves]


def _draw_curves(
    axes: Axes, plot: Plot, limits: tuple[float, float], label: str, spans: Sequence[Span]
) -> list[Line2D]:
    """Draw the curves and marks, every second span shaded; return the lines of the curves."""
    for span in spans[1::2]:
        axes.axvspan(span.start, span.stop, color="#e9eef4", linewidth=0.0, zorder=0)
    lines = []
    for curve, look in zip(plot.curves, curve_styles(plot), strict=True):
        front = 2.1 if curve.role == "predicted" else 2.0
        lines += axes.plot(curve.time, curve.values, **look, zorder=front)
    for value in plot.marks:
        axes.axhline(value, **{**NEUTRAL, "linewidth": 0.9, "zorder": 1})
    if limits[0] < limits[1]:
        axes.set_xlim(*limits)
    axes.set_xlabel(plain_text(label))
    return lines


_WIDTH = 5.4  # [inch], of which a page shows one in about 72 pixels
_HEIGHT = 2.5  # [inch], of which a page shows one in about 72 pixels
_TITLE = 66  # characters of a line of the title at this width
# more are not seen
_PATH = re.compile(r'\bd="[^"]*"')
_DIGITS = re.compile(r"(\.\d\d)\d+")


def draw_plot(
    plot: Plot, limits: tuple[float, float], label: str, spans: Sequence[Span]
) -> tuple[str, tuple[float, ...]]:
    """Return an SVG of a plot without a legend; left, right, bottom and top of its axes as
    fractions of its size; and the values at their bottom and top.

    Args:
        plot: what is drawn; every second span is shaded. Curves of layers only have room.
        limits: limits of the time axis.
        label: label of the time axis.
    """
    with _plot_style():
        figure = new_figure(_WIDTH, _HEIGHT)
        axes = figure.subplots()
        lines = _draw_curves(axes, plot, limits, label, spans)
        axes.set_ylabel(plain_text(plot.label))
        axes.set_title(textwrap.fill(plain_text(plot.title), _TITLE), fontsize=10, loc="left")
        for line, curve in zip(lines, plot.curves, strict=True):
            line.set_visible(not curve.layer)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        place = axes.get_position()
        (low, high) = axes.get_ylim()
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None})
    svg = file.getvalue()
    drawn = _PATH.sub(lambda path: _DIGITS.sub(r"\1", path[0]), svg[svg.index("<svg") :])
    edges = (place.x0, place.x1, place.y0, place.y1, low, high)
    return drawn, tuple(float(edge) for edge in edges)
