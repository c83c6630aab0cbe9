"""Layout: where in the frame the panes, the bars and the plots are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from geodesic_ocp.scenes.playback import Playback

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
        width, height: of the frame, even.
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
    """The title above all panes: none if that of a single pane says the same."""
    only = playback.scenes[0].title if len(playback.scenes) == 1 else ""
    return "" if playback.title == only else playback.title
