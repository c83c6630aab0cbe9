"""The frame of a video: the places of panes, bars and plots, and what Matplotlib draws there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.drawing.plots import (
    INK,
    MOST_NAMED,
    ROW,
    SHADE,
    SOFT,
    draw_chart,
    legend_size,
    plot_style,
    shorten,
)
from geodesic_ocp.drawing.scene import PARAMETER, Curve, Playback, Span, plain_text
from geodesic_ocp.drawing.styles import CUT_LINES

MOST_PLOTS = 3
_COLUMNS = 4  # panes side by side
_EDGE = 12  # [px], of 960
_TITLE = 34  # [px], of 960
_HEADER = 26  # [px], of 960
_BAR = 20  # [px], of 960
_BELOW = 10  # [px], of 960
_PLOTS = 162  # [px], of 960
_NARROWEST = 0.55  # of a pane beside plots, of the width
_LEAST_UNIT = 0.75  # below which letters could not be read
_BESIDE = 700  # [units], least widths: of a pane with plots, and of each
_PANE = 180  # [units], least widths: of a pane with plots, and of each
_PLOT = 270  # [units], least widths: of a pane with plots, and of each

Box: TypeAlias = tuple[int, int, int, int]  # left, top, width and height [px]
# An artist, and what changes it to how it is at an instant.
Moving: TypeAlias = tuple[Any, Callable[[float], object]]


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
    count = len(playback.scenes)
    plots = min(len(playback.plots), MOST_PLOTS)
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
    row = header + pane_height
    top = title if heading(playback) else edge // 2
    panes = [
        (
            edge + k % columns * pane_width,
            top + header + k // columns * row,
            pane_width,
            pane_height,
        )
        for k in range(count)
    ]
    bottom = top + math.ceil(count / columns) * row + below
    bars: list[Box] = []
    if playback.range[0] < playback.range[1]:
        step = bar + below // 2
        number = max(len(playback.spans), 1)
        bars = [(edge, bottom + k * step, inner, bar) for k in range(number)]
        bottom += number * step + below // 2
    if beside:
        each = row // plots
        left = edge + pane_width
        charts = [(left, top + k * each, inner - pane_width, each) for k in range(plots)]
    else:
        each = inner // max(plots, 1)
        charts = [(edge + k * each, bottom, each, plots_height) for k in range(plots)]
        bottom += plots_height if plots else 0
    height = bottom + edge // 2
    return Layout(width, height + height % 2, unit, tuple(panes), tuple(bars), tuple(charts))


def heading(playback: Playback) -> str:
    """Return the title above all panes: none if that of a single pane says the same."""
    only = playback.scenes[0].title if len(playback.scenes) == 1 else ""
    return "" if playback.title == only else playback.title


_DPI = 100.0  # at width 960
_BARS = ("#d5dde6", "#b9c5d2")
_NOW = "#1b3a5c"
_CURSOR = "#e07b00"
# widths [px, of 960] of names and of the time beside the bars
_NAMES = 112
_TIME = 84
_LARGEST = 0.3  # of these, relative to the whole
_STYLE: dict[Any, Any] = {"font.family": "DejaVu Sans", "xtick.color": SOFT, "ytick.color": SOFT}


@dataclass(frozen=True, eq=False, repr=False)
class Panel:
    """A matplotlib canvas whose static part is drawn once."""

    canvas: Any  # canvas of the figure
    still: Any  # its static part
    moving: tuple[Moving, ...]  # what changes with time

    def picture(
        self, instant: float, panes: Sequence[tuple[Box, NDArray[np.uint8]]]
    ) -> NDArray[np.uint8]:
        """Get the frame at an instant, (height, width, 3), with the pictures of the panes in it."""
        self.canvas.restore_region(self.still)
        with plot_style(_STYLE):
            for artist, change in self.moving:
                change(instant)
                self.canvas.figure.draw_artist(artist)
        frame = np.array(self.canvas.buffer_rgba())[..., :3].copy()
        for (left, top, width, height), picture in panes:
            frame[top : top + height, left : left + width] = picture[:height, :width]
        return frame


def panel(playback: Playback, place: Layout) -> Panel:
    """Draw the static part of a panel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with plot_style(_STYLE):
        dpi = _DPI * place.unit
        size = ((place.width + 1e-3) / dpi, (place.height + 1e-3) / dpi)
        figure = Figure(figsize=size, dpi=dpi)
        canvas: Any = FigureCanvasAgg(figure)
        _titles(figure, playback, place)
        moving = [*_bars(figure, playback, place), *_charts(figure, playback, place)]
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
    return Panel(canvas, still, tuple(moving))


def _titles(figure: Any, playback: Playback, place: Layout) -> None:
    middle = place.width / 2
    whole = _write(figure, place, middle, 18 * place.unit, heading(playback), 11, ha="center")
    shorten(whole, place.width - 24 * place.unit)
    for scene, (left, top, width, _) in zip(playback.scenes, place.panes, strict=True):
        across = left + 8 * place.unit
        down = top - 13 * place.unit
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


def _axes(figure: Any, place: Layout, left: float, top: float, width: float, height: float) -> Any:
    """Add axes that fill a box [px]."""
    lower = place.height - top - height
    sizes = np.array([place.width, place.height])
    return figure.add_axes([left, lower, width, height] / np.tile(sizes, 2))


def _charts(figure: Any, playback: Playback, place: Layout) -> list[Moving]:
    """Draw the plots, with a cursor and dots where it crosses the curves."""
    moving: list[Moving] = []
    for whole, (left, top, width, height) in zip(playback.plots, place.plots, strict=False):
        unit = place.unit
        shown = (each for each in whole.curves if each.layer not in playback.hidden)
        plot = replace(whole, curves=tuple(shown))
        above = 24 * unit + legend_size(plot, width / unit - 60)[1] * ROW * unit
        sides = left + 46 * unit, top + above, width - 60 * unit, height - above - 38 * unit
        axes = _axes(figure, place, *sides)
        lines = draw_chart(axes, plot, playback, width / unit - 50)
        if not place.bars:
            continue
        moving.append(_cursor(axes, INK, 1.0))
        if len(plot.curves) <= MOST_NAMED:
            for line, curve in zip(lines, plot.curves, strict=True):
                look = {"color": line.get_color(), "markersize": 4.5}
                (dot,) = axes.plot([], [], "o", **look, animated=True)
                moving.append((dot, _follow(dot, curve)))
    return moving


def _cursor(axes: Any, colour: str, width: float) -> Moving:
    line = axes.axvline(np.nan, color=colour, linewidth=width, animated=True)
    return line, lambda instant: line.set_xdata([instant, instant])


def _follow(dot: Any, curve: Curve) -> Callable[[float], object]:
    def change(instant: float) -> None:
        inside = curve.time[0] <= instant <= curve.time[-1]
        value = np.interp(instant, curve.time, curve.values) if inside else np.nan
        dot.set_data([instant], [value])

    return change


def _bars(figure: Any, playback: Playback, place: Layout) -> list[Moving]:
    """Draw the bars of spans, on which the present one is marked, and the time beside them."""
    moving: list[Moving] = []
    named = list(playback.spans.items()) or [("", ())]
    names = _NAMES if any(name.strip() for name, _ in named) and len(named) > 1 else 0
    for (name, spans), (left, top, width, height) in zip(named, place.bars, strict=False):
        middle = top + height / 2
        before = min(names * place.unit, _LARGEST * width)
        after = min(_TIME * place.unit, _LARGEST * width)
        label = _write(figure, place, left, middle, name if names else "", 8, color=SOFT)
        shorten(label, before - 10 * place.unit)
        axes = _axes(figure, place, left + before, top, width - before - after, height)
        axes.set_axis_off()
        axes.set_xlim(*playback.range)
        axes.set_ylim(0.0, 1.0)
        axes.axvspan(*playback.range, color=SHADE, linewidth=0.0)
        for index, span in enumerate(spans):
            axes.axvspan(span.start, span.stop, color=_BARS[index % 2], linewidth=0.0)
            if span.cut:
                axes.axvline(span.start, **CUT_LINES[span.cut])
        mark, present = _present(axes, spans)
        moving += [mark, _cursor(axes, _CURSOR, 2.0), present]
    if place.bars:
        left, top, width, height = place.bars[0]
        look = {"ha": "right", "animated": True}
        text = _write(figure, place, left + width, top + height / 2, "", 9, **look)
        moving.append((text, lambda instant: text.set_text(clock_text(playback, instant))))
    return moving


def _present(axes: Any, spans: Sequence[Span]) -> tuple[Moving, Moving]:
    """Draw a mark on the present span, and its name as far as possible in the middle of it."""
    mark = axes.axvspan(0.0, 0.0, color=_NOW, linewidth=0.0, animated=True)
    look = {"fontsize": 7.5, "color": "white", "va": "center", "ha": "center", "animated": True}
    box = {"boxstyle": "round,pad=0.15", "fc": _NOW, "ec": "none"}
    text = axes.text(0.012, 0.46, "", transform=axes.transAxes, bbox=box, **look)

    def now(instant: float) -> Span | None:
        return next((each for each in spans[::-1] if each.start <= instant <= each.stop), None)

    def change_mark(instant: float) -> None:
        span = now(instant)
        mark.set_visible(span is not None)
        if span is not None:
            mark.set(x=span.start, width=span.stop - span.start)

    def change_text(instant: float) -> None:
        span = now(instant)
        (start, stop) = axes.get_xlim()
        text.set_text("" if span is None else plain_text(span.name))
        if span is not None:
            middle = ((span.start + span.stop) / 2.0 - start) / (stop - start)
            half = 0.5 * text.get_window_extent().width / axes.bbox.width + 0.005
            text.set_x(min(max(middle, half), max(1.0 - half, half)))

    return (mark, change_mark), (text, change_text)


def clock_text(playback: Playback, instant: float) -> str:
    """Return the time as it is shown below the panes."""
    if playback.time_label == PARAMETER:
        return f"s = {instant:.2f}"
    unit = playback.time_label.partition("[")[2].partition("]")[0]
    return f"{instant:.2f} {plain_text(unit)}"
