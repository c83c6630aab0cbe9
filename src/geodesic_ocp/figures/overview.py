"""A motion over time: the hand and some joints in panels, and the path of the hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import BASELINE, OBSERVED, PREDICTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

Names = tuple[str, str]
NAMES: Names = ("observed", "predicted")
_TICKS: dict[str, Any] = {"color": "#1b3a5c", "markersize": 9, "clip_on": False}
_LONG = 12  # letters of an axis label beside a panel
_STRIP = 1.7  # height of a strip of arms, relative to a panel's
_SHADE = "#dfe6ee"


def shade_segments(axes: Axes, time: Array, segments: Sequence[tuple[int, int]]) -> None:
    """Shade the time spans [s] of every other segment."""
    edges = time[[*(start for start, _ in segments), segments[-1][1]]]
    # One area is drawn faster than a span for each segment.
    height = np.arange(edges.size) % 2 == 0
    where = axes.get_xaxis_transform()
    style: dict[str, Any] = {"color": _SHADE, "linewidth": 0, "zorder": 0}
    axes.fill_between(edges, 0.0, height, step="post", transform=where, **style)
    axes.set_xlim(time[0], time[-1])


def draw_over_time(
    axes: Axes,
    time: Array,
    observed: Array,
    predicted: Array,
    label: str,
    names: Names = NAMES,
    style: Mapping[str, Any] = OBSERVED,
) -> None:
    """Draw one coordinate over time [s], observed and predicted, (k,) each."""
    axes.plot(time, observed, **style, label=names[0])
    axes.plot(time, predicted, **PREDICTED, label=names[1])
    long = max(map(len, label.splitlines())) > _LONG
    axes.set_ylabel(label, fontsize="small" if long else None)


def draw_overview(
    figure: FigureBase,
    time: Array,
    segments: Sequence[tuple[int, int]],
    hands: tuple[Array, Array],
    joints: Sequence[tuple[str, Array, Array]],
    names: Names = NAMES,
    other: str | None = None,
    ticks: Array | None = None,
    strips: Sequence[Callable[[Axes], object]] = (),
) -> None:
    """Draw hand and joints over time in panels, and the path of the hand beside them.

    Args:
        figure: to draw in.
        time: of the samples (k,) [s].
        segments: (start, stop) samples of the segments, whose time spans are shaded.
        hands: positions (k, 3) [m] of the observed and the predicted hand.
        joints: label, observed (k,) and predicted (k,) values of each joint.
        names: labels of the observed and the predicted hand.
        other: label of the joints drawn beside the predicted ones, if they are not observed ones.
        ticks: times [s] marked on the upper edge.
        strips: each draws arms into axes of its own, above the panels.
    """
    columns = widest_columns(hands[0], 2)
    rows = [(f"hand {'xyz'[axis]}\n[m]", hands[0][:, axis], hands[1][:, axis]) for axis in columns]
    rows += joints
    above = len(strips)
    heights = [_STRIP] * above + [1.0] * len(rows)
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.5, 1.0), height_ratios=heights)
    panels: list[Axes] = []
    for row, (label, observed, predicted) in enumerate(rows):
        axes = figure.add_subplot(grid[above + row, 0], sharex=panels[0] if panels else None)
        shade_segments(axes, time, segments)
        if other is None or row < len(columns):
            draw_over_time(axes, time, observed, predicted, label, names)
        else:
            draw_over_time(axes, time, observed, predicted, label, (other, names[1]), BASELINE)
        axes.label_outer()
        panels.append(axes)
    if ticks is not None:
        top = panels[0].get_xaxis_transform()
        panels[0].plot(ticks, np.ones(ticks.size), "|", transform=top, **_TICKS)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)

    path = figure.add_subplot(grid[above:, 1])
    axis_names = ("xyz"[columns[0]], "xyz"[columns[1]])
    observed, predicted = (hand[:, columns] for hand in hands)
    draw_hand_path(path, observed, predicted, segments, axis_names, names)
    shown = dict(zip(*path.get_legend_handles_labels()[::-1], strict=True))
    shown |= dict(zip(*panels[-1].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=len(shown))
    for row, draw in enumerate(strips):
        draw(figure.add_subplot(grid[row, :]))


def draw_hand_path(
    axes: Axes,
    observed: Array,
    predicted: Array,
    segments: Sequence[tuple[int, int]],
    axis_names: tuple[str, str],
    names: Names = NAMES,
    hand: str = "hand",
) -> None:
    """Draw the path of the hand (k, 2) [m] in two axes, with a mark where each segment begins."""
    axes.plot(*observed.T, **OBSERVED, label=names[0])
    axes.plot(*predicted.T, **PREDICTED, label=names[1])
    starts = [start for start, _ in segments]
    marks = observed[[*starts, segments[-1][1]]]
    style = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 5}
    axes.plot(*marks.T, "o", label="segment ends", **style)
    axes.set_xlabel(f"{hand} {axis_names[0]} [m]")
    axes.set_ylabel(f"{hand} {axis_names[1]} [m]")
    axes.set_aspect("equal", adjustable="datalim")


def widest_columns(values: Array, count: int) -> list[int]:
    """Indices of the columns (k, m) with the largest range, in their own order."""
    order = np.argsort(-np.ptp(values, axis=0), kind="stable")
    return sorted(int(column) for column in order[:count])


def widest_of_thirds(values: Array) -> list[int]:
    """The column of largest range in each third of (k, m): shoulder, elbow and wrist of an arm."""
    thirds = [third for third in np.array_split(np.arange(values.shape[1]), 3) if len(third)]
    return [int(third[widest_columns(values[:, third], 1)[0]]) for third in thirds]
