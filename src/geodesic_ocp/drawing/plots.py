"""Plots below the scenes, as SVG."""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from geodesic_ocp.drawing.scene import Plot, Span, plain_text
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, line_styles, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.artist import Artist

_WIDTH, _HEIGHT = 5.4, 2.9  # [inch], of which a page shows one in about 72 pixels
_TITLE = 66  # characters of a line of the title at this width
_CHARACTERS, _HANDLE = 84, 8  # of a legend's line at this width, and of the mark before a name
_SHADE = "#e9eef4"
_STYLE: dict[Any, Any] = {
    **{"svg.fonttype": "none", "svg.hashsalt": "plot", "font.size": 9.5},
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#667"},
    **{"text.parse_math": False},  # names are text, not formulas
}
_MARK: dict[str, Any] = {**NEUTRAL, "linewidth": 0.9, "zorder": 1}
_LEGEND: dict[str, Any] = {"loc": "outside lower center", "frameon": False, "fontsize": 8.5}
_PATH, _DIGITS = re.compile(r'\bd="[^"]*"'), re.compile(r"(\.\d\d)\d+")  # more are not seen


def draw_plot(
    plot: Plot, limits: tuple[float, float], label: str, spans: Sequence[Span]
) -> tuple[str, tuple[float, float, float, float]]:
    """Return an SVG of a plot, and left, right, bottom and top of its axes as fractions of its
    size.

    Args:
        plot: what is drawn; every second span is shaded.
        limits: limits of the time axis.
        label: label of the time axis.
    """
    with own_style(_STYLE), warnings.catch_warnings():
        # The browser, which draws the text, has other fonts.
        warnings.filterwarnings("ignore", "Glyph .* missing")
        figure = new_figure(_WIDTH, _HEIGHT)
        axes = figure.subplots()
        for span in spans[1::2]:
            axes.axvspan(span.start, span.stop, color=_SHADE, linewidth=0.0, zorder=0)
        marks = [axes.axhline(value, **_MARK) for value in plot.marks]
        series = iter(line_styles(sum(curve.role is None for curve in plot.curves)))
        lines: list[Artist] = []
        for curve in plot.curves:
            look = next(series) if curve.role is None else ROLES[curve.role]
            front = 2.1 if curve.role == "predicted" else 2.0
            lines += axes.plot(curve.time, curve.values, **look, zorder=front)
        if limits[0] < limits[1]:
            axes.set_xlim(*limits)
        axes.set_xlabel(plain_text(label))
        axes.set_ylabel(plain_text(plot.label))
        axes.set_title(textwrap.fill(plain_text(plot.title), _TITLE), fontsize=10, loc="left")
        # A space in front, because matplotlib leaves out names that start with an underscore.
        names = [f" {plain_text(curve.name)}" for curve in plot.curves]
        if marks and plot.marked:
            lines, names = [*lines, marks[0]], [*names, f" {plain_text(plot.marked)}"]
        columns = max(1, min(4, _CHARACTERS // (max(map(len, names)) + _HANDLE)))
        figure.legend(lines, names, ncols=columns, **_LEGEND)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        place = axes.get_position()
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None})
    svg = file.getvalue()
    drawn = _PATH.sub(lambda path: _DIGITS.sub(r"\1", path[0]), svg[svg.index("<svg") :])
    return drawn, (float(place.x0), float(place.x1), float(place.y0), float(place.y1))
