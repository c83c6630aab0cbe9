"""Plots of curves over time: as SVG below the scenes of a page, and in the frames of a video."""

from __future__ import annotations

import io
import math
import re
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from geodesic_ocp.drawing.scene import Playback, Plot, Span, plain_text
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, line_styles, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

INK = "#22303c"
SOFT = "#6b7682"
SHADE = "#f0f3f7"
_PAGE: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "plot", "font.size": 9.5}
_PLAIN: dict[Any, Any] = {
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#7a828c"},
    **{"text.parse_math": False},  # names are text, not formulas
}


@contextmanager
def plot_style(settings: dict[Any, Any]) -> Iterator[None]:
    """Draw with these settings, whatever names contain and whatever style the user has chosen."""
    with own_style(_PLAIN | settings), warnings.catch_warnings():
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


def _named(name: str) -> str:
    """Return a name for a legend: matplotlib leaves out names that start with an underscore."""
    return f" {plain_text(name)}"


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
    with plot_style(_PAGE):
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


MOST_NAMED = 8  # curves in a legend
# All [px, of 960]: width of a mark in the legend with its spaces, and of a letter; height of a row.
_MARK = 40.0
_LETTER = 5.2
ROW = 12.0
_POINT = 72.0 / 100.0  # [pt] in a pixel of 960
_MOST_ROWS = 4
_SMALL: dict[str, Any] = {
    **{"fontsize": 6.5, "frameon": False, "bbox_to_anchor": (-0.01, 1.0), "loc": "lower left"},
    **{"handlelength": 2.2, "handletextpad": 0.3, "labelspacing": 0.2},
    **{"columnspacing": 1.2, "borderpad": 0.1, "borderaxespad": 0.2},
}


def draw_chart(axes: Axes, plot: Plot, playback: Playback, width: float) -> list[Line2D]:
    """Draw a plot of a video; the heading and the legend above it are not wider than this [px of
    960]. Return the lines of the curves.
    """
    spans = next(iter(playback.spans.values()), ())
    lines = _draw_curves(axes, plot, playback.range, playback.time_label, spans)
    axes.xaxis.label.set(fontsize=7.5, color=SOFT)
    axes.xaxis.labelpad = 1
    axes.tick_params(labelsize=7, length=2.5, pad=2)
    axes.locator_params(axis="y", nbins=4)
    columns, rows = legend_size(plot, width - 10)
    if rows:
        letters = max(int(((width - 10) / columns - _MARK) / _LETTER), 6)
        names = [_cut(_named(curve.name), letters) for curve in plot.curves]
        axes.legend(lines, names, ncols=columns, **_SMALL)
    head = plain_text(f"{plot.label}: {plot.title}" if plot.title else plot.label)
    pad = 4.0 + rows * ROW * _POINT
    text = axes.set_title(head, fontsize=8.5, loc="left", color=INK, pad=pad)
    shorten(text, width * axes.figure.dpi / 100.0)
    return lines


def shorten(text: Any, width: float) -> None:
    """Leave out the end of a text that is wider than this [px]."""
    whole = text.get_text()
    for kept in range(len(whole) - 1, -1, -1):
        if text.get_window_extent().width <= width:
            return
        text.set_text(f"{whole[:kept].rstrip()}…" if kept else "")


def legend_size(plot: Plot, width: float) -> tuple[int, int]:
    """Return columns and rows of the legend in this width [px of 960]; none for a single curve."""
    if not 1 < len(plot.curves) <= MOST_NAMED:
        return 0, 0
    longest = max(len(plain_text(curve.name)) for curve in plot.curves)
    columns = min(max(int(width / (_MARK + _LETTER * longest)), 1), len(plot.curves))
    # Where these are too many rows, names are cut.
    columns = max(columns, math.ceil(len(plot.curves) / _MOST_ROWS))
    return columns, math.ceil(len(plot.curves) / columns)


def _cut(name: str, letters: int) -> str:
    """Return a name, of which the middle is left out where it is longer."""
    if len(name) <= letters:
        return name
    return f"{name[: (letters - 1) // 2]}…{name[len(name) - letters // 2 :]}"
