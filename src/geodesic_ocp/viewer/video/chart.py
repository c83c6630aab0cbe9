"""Chart: a plot beside or below the panes, with its heading and legend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from geodesic_ocp.figures.styles import NEUTRAL, ROLES, line_styles
from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import Playback, Plot, Span
from geodesic_ocp.viewer.video.layout import Box

INK, SOFT, SHADE = "#22303c", "#6b7682", "#f0f3f7"
MOST_NAMED = 8  # curves in a legend
# All [px, of 960]: width of a mark in the legend with its spaces, and of a letter; height of a row.
_MARK, _LETTER, _ROW = 40.0, 5.2, 12.0
_POINT = 72.0 / 100.0  # [pt] in a pixel of 960
_MOST_ROWS = 4
_LEAST_OF_TITLE = 3  # letters


def chart_frame(box: Box, plot: Plot, unit: float) -> tuple[float, float, float, float]:
    """The frame of the axes in the box of a plot, with room for labels and legend."""
    left, top, width, height = box
    above = 24 * unit + _columns(plot, width / unit - 60)[1] * _ROW * unit
    return left + 46 * unit, top + above, width - 60 * unit, height - above - 38 * unit


def draw_chart(
    axes: Any, plot: Plot, playback: Playback, shaded: Sequence[Span], width: float
) -> None:
    """Draw the curves; every second span is shaded, the heading is not wider than this [px of 960].

    The curves are the first lines of the axes.
    """
    for span in shaded[1::2]:
        axes.axvspan(span.start, span.stop, color=SHADE, linewidth=0.0, zorder=0)
    series = iter(line_styles(sum(curve.role is None for curve in plot.curves)))
    looks = [next(series) if curve.role is None else ROLES[curve.role] for curve in plot.curves]
    lines = [
        axes.plot(curve.time, curve.values, **look)[0]
        for curve, look in zip(plot.curves, looks, strict=True)
    ]
    for value in plot.marks:
        axes.axhline(value, **{**NEUTRAL, "linewidth": 0.8}, zorder=1)
    start, stop = playback.range
    if start < stop:
        axes.set_xlim(start, stop)
    axes.set_xlabel(plain_text(playback.time_label), fontsize=7.5, color=SOFT, labelpad=1)
    axes.tick_params(labelsize=7, length=2.5, pad=2)
    axes.locator_params(axis="y", nbins=4)
    columns, rows = _columns(plot, width - 10)
    if rows:
        letters = max(int(((width - 10) / columns - _MARK) / _LETTER), 6)
        # A space in front, because matplotlib leaves out names that start with an underscore.
        names = [f" {_cut(plain_text(curve.name), letters)}" for curve in plot.curves]
        look = {"fontsize": 6.5, "frameon": False, "ncols": columns, "bbox_to_anchor": (-0.01, 1.0)}
        spacing = {"handlelength": 2.2, "handletextpad": 0.3, "labelspacing": 0.2}
        spacing |= {"columnspacing": 1.2, "borderpad": 0.1, "borderaxespad": 0.2}
        axes.legend(lines, names, loc="lower left", **look, **spacing)
    _head(axes, plot, width * axes.figure.dpi / 100.0, 4.0 + rows * _ROW * _POINT)


def shorten(text: Any, width: float) -> None:
    """Leave out the end of a text that is wider than this [px]."""
    whole = text.get_text()
    for kept in range(len(whole) - 1, -1, -1):
        if text.get_window_extent().width <= width:
            return
        text.set_text(f"{whole[:kept].rstrip()}…" if kept else "")


def _columns(plot: Plot, width: float) -> tuple[int, int]:
    """Columns and rows of the legend in this width [px of 960]; none for a single curve."""
    if not 1 < len(plot.curves) <= MOST_NAMED:
        return 0, 0
    longest = max(len(plain_text(curve.name)) for curve in plot.curves)
    columns = min(max(int(width / (_MARK + _LETTER * longest)), 1), len(plot.curves))
    # Where these are too many rows, names are cut.
    columns = max(columns, math.ceil(len(plot.curves) / _MOST_ROWS))
    return columns, math.ceil(len(plot.curves) / columns)


def _cut(name: str, letters: int) -> str:
    """A name, of which the middle is left out where it is longer."""
    if len(name) <= letters:
        return name
    return f"{name[: (letters - 1) // 2]}…{name[len(name) - letters // 2 :]}"


def _head(axes: Any, plot: Plot, width: float, pad: float) -> None:
    """Write what a plot shows above it, with as much of its title as fits into this width [px]."""
    label, title = plain_text(plot.label), plain_text(plot.title)
    look = {"fontsize": 8.5, "loc": "left", "color": INK, "pad": pad}
    text = axes.set_title(f"{title}: {label}" if title else label, **look)
    for kept in range(len(title) - 1, -1, -1):
        if text.get_window_extent().width <= width:
            return
        text.set_text(f"{title[:kept].rstrip()}…: {label}" if kept > _LEAST_OF_TITLE else label)
    shorten(text, width)
