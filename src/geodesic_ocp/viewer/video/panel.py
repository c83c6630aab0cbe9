"""Panel: what is around the panes: titles, the bars of time, and plots with a cursor."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.figures.own_style import own_style
from geodesic_ocp.figures.styles import NEUTRAL, ROLES, line_styles
from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import PARAMETER, Curve, Playback, Plot, Span
from geodesic_ocp.viewer.video.layout import Box, Layout, heading

_DPI = 100.0  # at width 960
_INK, _SOFT = "#22303c", "#6b7682"
_BARS, _NOW = ("#d5dde6", "#b9c5d2"), "#1b3a5c"
_SHADE = "#f0f3f7"
_NAMES, _TIME = 0.12, 0.09  # widths of names and of the time beside the bars, relative to them
_MOST_NAMED = 8  # curves in a legend
_LEGEND, _LETTERS, _LINES = 100, 18, 2  # its width [px], of 960, and the names in it
_LEAST_OF_TITLE = 3  # letters
_STYLE: dict[Any, Any] = {
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#8a939c"},
    **{"text.parse_math": False},  # names are text, not formulas
    **{"font.family": "DejaVu Sans", "xtick.color": _SOFT, "ytick.color": _SOFT},
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
            axes = _axes(figure, place, _within(box, plot, place.unit))
            _plot(axes, plot, playback, shaded)
            _head(axes, plot, box[2] - 46 * place.unit)
            if place.bars:
                cursors.append(axes.axvline(np.nan, color=_INK, linewidth=1.0, animated=True))
                if len(plot.curves) <= _MOST_NAMED:
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
    _shorten(whole, place.width - 24 * place.unit)
    for scene, (left, top, width, _) in zip(playback.scenes, place.panes, strict=True):
        across, down = left + 8 * place.unit, top - 13 * place.unit
        title = _write(figure, place, across, down, scene.title, 9.5, weight="bold")
        box = title.get_window_extent()
        _shorten(title, left + width - across)
        note = _write(figure, place, box.x1 + 10 * place.unit, down, scene.note, 8, color=_SOFT)
        _shorten(note, left + width - box.x1 - 14 * place.unit)


def _write(
    figure: Any, place: Layout, x: float, y: float, text: str, size: float, **look: Any
) -> Any:
    """Write at a pixel, centred vertically."""
    look = {"color": _INK, "va": "center", **look}
    at = x / place.width, 1.0 - y / place.height
    return figure.text(*at, plain_text(text), fontsize=size, **look)


def _shorten(text: Any, width: float) -> None:
    """Leave out the end of a text that is wider than this [px]."""
    whole = text.get_text()
    for kept in range(len(whole) - 1, -1, -1):
        if text.get_window_extent().width <= width:
            return
        text.set_text(f"{whole[:kept].rstrip()}…" if kept else "")


def _axes(figure: Any, place: Layout, box: tuple[float, float, float, float]) -> Any:
    left, top, width, height = box
    bottom = place.height - top - height
    sides = left / place.width, bottom / place.height, width / place.width, height / place.height
    return figure.add_axes(sides)


def _within(box: Box, plot: Plot, unit: float) -> tuple[float, float, float, float]:
    """The frame of the axes in the box of a plot, with room for its labels."""
    left, top, width, height = box
    beside = (60 + _LEGEND if _has_legend(plot) else 60) * unit
    return left + 46 * unit, top + 24 * unit, width - beside, height - 62 * unit


def _has_legend(plot: Plot) -> bool:
    return 1 < len(plot.curves) <= _MOST_NAMED


def _plot(axes: Any, plot: Plot, playback: Playback, shaded: Sequence[Span]) -> None:
    for span in shaded[1::2]:
        axes.axvspan(span.start, span.stop, color=_SHADE, linewidth=0.0, zorder=0)
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
    axes.set_xlabel(plain_text(playback.time_label), fontsize=7.5, color=_SOFT, labelpad=1)
    axes.tick_params(labelsize=7, length=2.5, pad=2)
    axes.locator_params(axis="y", nbins=4)
    if _has_legend(plot):
        # A space in front, because matplotlib leaves out names that start with an underscore.
        names = [f" {_wrapped(curve.name)}" for curve in plot.curves]
        look = {"fontsize": 6.5, "frameon": False, "bbox_to_anchor": (1.0, 1.05)}
        spacing = {"handlelength": 1.8, "labelspacing": 0.2, "borderpad": 0.2}
        axes.legend(lines, names, loc="upper left", **look, **spacing)


def _head(axes: Any, plot: Plot, width: float) -> None:
    """Write what a plot shows above it, with as much of its title as fits into this width [px]."""
    label, title = plain_text(plot.label), plain_text(plot.title)
    look = {"fontsize": 8.5, "loc": "left", "color": _INK, "pad": 4}
    text = axes.set_title(f"{title}: {label}" if title else label, **look)
    for kept in range(len(title) - 1, -1, -1):
        if text.get_window_extent().width <= width:
            return
        text.set_text(f"{title[:kept].rstrip()}…: {label}" if kept > _LEAST_OF_TITLE else label)
    _shorten(text, width)


def _wrapped(name: str) -> str:
    lines = textwrap.wrap(plain_text(name), _LETTERS) or [""]
    more = "…" if len(lines) > _LINES else ""
    return "\n ".join(lines[:_LINES]) + more


def _bars(
    figure: Any, playback: Playback, place: Layout, cursors: list[Any]
) -> tuple[tuple[tuple[tuple[Span, ...], Any, Any], ...], tuple[Any, ...]]:
    rows: list[tuple[tuple[Span, ...], Any, Any]] = []
    clock: tuple[Any, ...] = ()
    start, stop = playback.range
    named = list(playback.spans.items()) or [("", ())]
    names = _NAMES if any(name.strip() for name, _ in named) and len(named) > 1 else 0.0
    for (name, spans), (left, top, width, height) in zip(named, place.bars, strict=False):
        middle = top + height / 2
        label = _write(figure, place, left, middle, name if names else "", 8, color=_SOFT)
        _shorten(label, (names - 0.01) * width)
        box = (left + names * width, top, width * (1.0 - names - _TIME), height)
        axes = _axes(figure, place, box)
        axes.set_axis_off()
        axes.set_xlim(start, stop)
        axes.set_ylim(0.0, 1.0)
        axes.axvspan(start, stop, color=_SHADE, linewidth=0.0)
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
