"""Panel: what is around the panes: titles, the bars of time, and plots with a cursor."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.figures.own_style import own_style
from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import PARAMETER, Curve, Playback, Span
from geodesic_ocp.viewer.video.chart import (
    INK,
    MOST_NAMED,
    SHADE,
    SOFT,
    chart_frame,
    draw_chart,
    shorten,
)
from geodesic_ocp.viewer.video.layout import Box, Layout, heading

_DPI = 100.0  # at width 960
_BARS, _NOW = ("#d5dde6", "#b9c5d2"), "#1b3a5c"
_NAMES, _TIME = 112, 84  # widths [px, of 960] of names and of the time beside the bars
_LARGEST = 0.3  # of these, relative to the whole
_STYLE: dict[Any, Any] = {
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#8a939c"},
    **{"text.parse_math": False},  # names are text, not formulas
    **{"font.family": "DejaVu Sans", "xtick.color": SOFT, "ytick.color": SOFT},
}


@dataclass(frozen=True, eq=False, repr=False)
class Panel:
    """A matplotlib canvas whose static part is drawn once.

    Attributes:
        playback: what is shown.
        canvas: of the figure.
        still: its static part.
        cursors, dots: lines in the plots and the values where they cross the curves.
        rows: for each bar its spans, the mark of the present one, and that one's name.
        clock: the text of the time, and a line across the bars.
    """

    playback: Playback
    canvas: Any
    still: Any
    cursors: tuple[Any, ...]
    dots: tuple[tuple[Any, Curve], ...]
    rows: tuple[tuple[tuple[Span, ...], Any, Any], ...]
    clock: tuple[Any, ...]

    def picture(
        self, instant: float, panes: Sequence[tuple[Box, NDArray[np.uint8]]]
    ) -> NDArray[np.uint8]:
        """The frame at an instant, (height, width, 3), with the pictures of the panes in it."""
        figure = self.canvas.figure
        self.canvas.restore_region(self.still)
        for spans, mark, name in self.rows:
            present = [span for span in spans if span.start <= instant <= span.stop]
            mark.set_visible(bool(present))
            name.set_text(plain_text(present[-1].name) if present else "")
            if present:
                mark.set_x(present[-1].start)
                mark.set_width(present[-1].stop - present[-1].start)
                _place_name(name, mark)
        for cursor in self.cursors:
            cursor.set_xdata([instant, instant])
        for dot, curve in self.dots:
            inside = curve.time[0] <= instant <= curve.time[-1]
            value = np.interp(instant, curve.time, curve.values) if inside else np.nan
            dot.set_data([instant], [value])
        if self.clock:
            self.clock[0].set_text(clock_text(self.playback, instant))
        with own_style(_STYLE), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")
            marks = [mark for _, mark, _ in self.rows]
            names = [name for _, _, name in self.rows]
            dots = [dot for dot, _ in self.dots]
            for artist in (*marks, *self.cursors, *dots, *names, *self.clock):
                figure.draw_artist(artist)
        frame = np.array(self.canvas.buffer_rgba())[..., :3].copy()
        for (left, top, width, height), picture in panes:
            frame[top : top + height, left : left + width] = picture[:height, :width]
        return frame


def panel(playback: Playback, place: Layout) -> Panel:
    """Draw the static part of a panel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with own_style(_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")
        dpi = _DPI * place.unit
        size = ((place.width + 1e-3) / dpi, (place.height + 1e-3) / dpi)
        figure = Figure(figsize=size, dpi=dpi)
        canvas: Any = FigureCanvasAgg(figure)
        _titles(figure, playback, place)
        cursors: list[Any] = []
        dots: list[tuple[Any, Curve]] = []
        shaded = next(iter(playback.spans.values()), ())
        for plot, box in zip(playback.plots, place.plots, strict=False):
            axes = _axes(figure, place, chart_frame(box, plot, place.unit))
            draw_chart(axes, plot, playback, shaded, (box[2] / place.unit) - 50)
            if place.bars:
                cursors.append(axes.axvline(np.nan, color=INK, linewidth=1.0, animated=True))
                if len(plot.curves) <= MOST_NAMED:
                    lines = axes.get_lines()[: len(plot.curves)]
                    for line, curve in zip(lines, plot.curves, strict=True):
                        look = {"color": line.get_color(), "markersize": 4.5}
                        dots.append((axes.plot([], [], "o", **look, animated=True)[0], curve))
        rows, clock = _bars(figure, playback, place, cursors)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
    return Panel(playback, canvas, still, tuple(cursors), tuple(dots), rows, clock)


def _place_name(name: Any, mark: Any) -> None:
    """Centre a name in its span, as far as it stays within the bar."""
    axes = mark.axes
    start, stop = axes.get_xlim()
    middle = (mark.get_x() + mark.get_width() / 2.0 - start) / (stop - start)
    half = 0.5 * name.get_window_extent().width / axes.bbox.width + 0.005
    name.set_x(min(max(middle, half), max(1.0 - half, half)))


def clock_text(playback: Playback, instant: float) -> str:
    """The time as it is shown below the panes."""
    if playback.time_label == PARAMETER:
        return f"s = {instant:.2f}"
    unit = playback.time_label.partition("[")[2].partition("]")[0]
    return f"{instant:.2f} {plain_text(unit)}"


def _titles(figure: Any, playback: Playback, place: Layout) -> None:
    middle = place.width / 2
    whole = _write(figure, place, middle, 18 * place.unit, heading(playback), 11, ha="center")
    shorten(whole, place.width - 24 * place.unit)
    for scene, (left, top, width, _) in zip(playback.scenes, place.panes, strict=True):
        across, down = left + 8 * place.unit, top - 13 * place.unit
        title = _write(figure, place, across, down, scene.title, 9.5, weight="bold")
        box = title.get_window_extent()
        shorten(title, left + width - across)
        note = _write(figure, place, box.x1 + 10 * place.unit, down, scene.note, 8, color=SOFT)
        shorten(note, left + width - box.x1 - 14 * place.unit)


def _write(
    figure: Any, place: Layout, x: float, y: float, text: str, size: float, **look: Any
) -> Any:
    """Write at a pixel, centred vertically."""
    look = {"color": INK, "va": "center", **look}
    at = x / place.width, 1.0 - y / place.height
    return figure.text(*at, plain_text(text), fontsize=size, **look)


def _axes(figure: Any, place: Layout, box: tuple[float, float, float, float]) -> Any:
    left, top, width, height = box
    bottom = place.height - top - height
    sides = left / place.width, bottom / place.height, width / place.width, height / place.height
    return figure.add_axes(sides)


def _bars(
    figure: Any, playback: Playback, place: Layout, cursors: list[Any]
) -> tuple[tuple[tuple[tuple[Span, ...], Any, Any], ...], tuple[Any, ...]]:
    rows: list[tuple[tuple[Span, ...], Any, Any]] = []
    clock: tuple[Any, ...] = ()
    start, stop = playback.range
    named = list(playback.spans.items()) or [("", ())]
    names = _NAMES if any(name.strip() for name, _ in named) and len(named) > 1 else 0
    for (name, spans), (left, top, width, height) in zip(named, place.bars, strict=False):
        middle = top + height / 2
        before = min(names * place.unit, _LARGEST * width)
        after = min(_TIME * place.unit, _LARGEST * width)
        label = _write(figure, place, left, middle, name if names else "", 8, color=SOFT)
        shorten(label, before - 10 * place.unit)
        box = (left + before, top, width - before - after, height)
        axes = _axes(figure, place, box)
        axes.set_axis_off()
        axes.set_xlim(start, stop)
        axes.set_ylim(0.0, 1.0)
        axes.axvspan(start, stop, color=SHADE, linewidth=0.0)
        for index, span in enumerate(spans):
            axes.axvspan(span.start, span.stop, color=_BARS[index % 2], linewidth=0.0)
        mark = axes.axvspan(start, start, color=_NOW, linewidth=0.0, animated=True)
        cursors.append(axes.axvline(np.nan, color="#e07b00", linewidth=2.0, animated=True))
        right = left + width
        text = _write(figure, place, right, middle, "", 9, ha="right", animated=True)
        if not clock:
            clock = (text,)
        row_name = axes.text(
            0.012,
            0.46,
            "",
            transform=axes.transAxes,
            fontsize=7.5,
            va="center",
            ha="center",
            color="white",
            animated=True,
            bbox={"boxstyle": "round,pad=0.15", "fc": _NOW, "ec": "none"},
        )
        rows.append((tuple(spans), mark, row_name))
    return tuple(rows), clock
