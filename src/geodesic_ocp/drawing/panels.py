"""The frame of a video: the places of panes, bars and plots, and what Matplotlib draws there."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.drawing.scene import PARAMETER, Curve, Playback, Plot, Span, plain_text
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, line_styles, own_style

MOST_PLOTS = 3
_COLUMNS = 4  # panes side by side
_EDGE, _TITLE, _HEADER, _BAR, _BELOW, _PLOTS = 12, 34, 26, 20, 10, 162  # [px], of 960
_NARROWEST = 0.55  # of a pane beside plots, of the width
_LEAST_UNIT = 0.75  # below which letters could not be read
_BESIDE, _PANE, _PLOT = 700, 180, 270  # [units], least widths: of a pane with plots, and of each

Box = tuple[int, int, int, int]  # left, top, width and height [px]


@dataclass(frozen=True)
class Layout:
    """Boxes [px] in a frame, from its upper left corner.

    Attributes:
        width, height: width and height of the frame, even.
        unit: pixels in place of one of a frame of width 960; not below what can be read.
        panes, bars, plots: boxes; those of the panes are below their titles.
    """

    width: int
    height: int
    unit: float
    panes: tuple[Box, ...]
    bars: tuple[Box, ...]
    plots: tuple[Box, ...]


def layout(playback: Playback, width: int, aspect: float) -> Layout:
    """Place panes of height / width `aspect`, if that is not extreme, in a frame of this width."""
    unit = max(width / 960.0, _LEAST_UNIT)
    edge, title, header, bar, below, plots_height = (
        round(unit * each) for each in (_EDGE, _TITLE, _HEADER, _BAR, _BELOW, _PLOTS)
    )
    count, plots = len(playback.scenes), min(len(playback.plots), MOST_PLOTS)
    inner = width - 2 * edge
    beside = count == 1 and plots > 0 and inner >= _BESIDE * unit
    if not beside:
        plots = min(plots, max(1, int(inner / (_PLOT * unit))))
    columns = count if count <= _COLUMNS else math.ceil(count / 2)
    columns = min(columns, max(1, int(inner / (_PANE * unit))))
    pane_width = round(_NARROWEST * inner) if beside else inner // columns
    pane_height = round(pane_width * min(max(aspect, 0.62 if columns > 1 else 0.55), 1.25))
    pane_height = max(pane_height, 0 if not beside else plots * plots_height)
    if columns == 1:
        pane_height = min(pane_height, round(0.68 * width))
    top = title if heading(playback) else edge // 2
    panes: list[Box] = []
    for index in range(count):
        row, column = divmod(index, columns)
        left = edge + column * pane_width
        panes.append((left, top + header + row * (header + pane_height), pane_width, pane_height))
    rows = math.ceil(count / columns)
    bottom = top + rows * (header + pane_height) + below
    bars: list[Box] = []
    start, stop = playback.range
    if start < stop:
        for _ in range(max(len(playback.spans), 1)):
            bars.append((edge, bottom, inner, bar))
            bottom += bar + below // 2
        bottom += below // 2
    charts: list[Box] = []
    if beside:
        each = (header + pane_height) // plots
        left = edge + pane_width
        charts = [(left, top + index * each, inner - pane_width, each) for index in range(plots)]
    elif plots:
        each = inner // plots
        charts = [(edge + index * each, bottom, each, plots_height) for index in range(plots)]
        bottom += plots_height
    height = bottom + edge // 2
    return Layout(width, height + height % 2, unit, tuple(panes), tuple(bars), tuple(charts))


def heading(playback: Playback) -> str:
    """Return the title above all panes: none if that of a single pane says the same."""
    only = playback.scenes[0].title if len(playback.scenes) == 1 else ""
    return "" if playback.title == only else playback.title


INK, SOFT, SHADE = "#22303c", "#6b7682", "#f0f3f7"
MOST_NAMED = 8  # curves in a legend
# All [px, of 960]: width of a mark in the legend with its spaces, and of a letter; height of a row.
_MARK, _LETTER, _ROW = 40.0, 5.2, 12.0
_POINT = 72.0 / 100.0  # [pt] in a pixel of 960
_MOST_ROWS = 4
_LEAST_OF_TITLE = 3  # letters


def chart_frame(box: Box, plot: Plot, unit: float) -> tuple[float, float, float, float]:
    """Return the frame of the axes in the box of a plot, with room for labels and legend."""
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
        canvas: canvas of the figure.
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
        """Get the frame at an instant, (height, width, 3), with the pictures of the panes in it."""
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
    """Return the time as it is shown below the panes."""
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
