"""Figures: functions that draw on a matplotlib Axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.patches import Polygon

from geodesic_ocp.arrays import Array

# Dark blue and orange differ in hue and in lightness, and stay apart in grey print.
OBSERVED: dict[str, Any] = {"color": "#1b3a5c", "linewidth": 2.0}
PREDICTED: dict[str, Any] = {"color": "#e07b00", "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
OTHER: dict[str, Any] = {"color": "#6a9a3a", "linewidth": 1.3, "linestyle": (0, (1, 1))}
Names = tuple[str, str]
NAMES: Names = ("observed", "predicted")
_TICKS: dict[str, Any] = {"color": "#1b3a5c", "markersize": 9, "clip_on": False}
_LONG = 12  # letters of a label beside a panel
_SHADES = ("#dfe6ee", "#ffffff")
_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
_SOLID: dict[str, Any] = {
    "facecolor": "#d9d2c5",
    "edgecolor": "#6b6257",
    "linewidth": 1.0,
    "zorder": 0,
}


def shade_segments(axes: Axes, time: Array, segments: Sequence[tuple[int, int]]) -> None:
    """Fill the segments' spans of time [s] in alternating shades."""
    for index, (start, stop) in enumerate(segments):
        axes.axvspan(time[start], time[stop], color=_SHADES[index % 2], linewidth=0, zorder=0)
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
    """One coordinate over time [s], observed (k,), in a style of its own, and predicted (k,)."""
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
) -> None:
    """Hand and joints over time in panels, and the hand's path beside them.

    Args:
        figure: to draw in.
        time: of the samples (k,) [s].
        segments: whose spans of time are shaded.
        hands: positions (k, 3) [m] of the observed and the predicted hand.
        joints: label, observed (k,) and predicted (k,) of each joint that is shown.
        names: of what is observed and what is predicted.
        other: what is beside the predicted joints, where that is not what is observed.
        ticks: instants [s] that are marked on the upper edge.
    """
    columns = widest_columns(hands[0], 2)
    rows = [(f"hand {'xyz'[axis]}\n[m]", hands[0][:, axis], hands[1][:, axis]) for axis in columns]
    rows += joints
    grid = figure.add_gridspec(len(rows), 2, width_ratios=(1.5, 1.0))
    panels: list[Axes] = []
    for row, (label, observed, predicted) in enumerate(rows):
        axes = figure.add_subplot(grid[row, 0], sharex=panels[0] if panels else None)
        shade_segments(axes, time, segments)
        if other is None or row < len(columns):
            draw_over_time(axes, time, observed, predicted, label, names)
        else:
            draw_over_time(axes, time, observed, predicted, label, (other, names[1]), OTHER)
        axes.label_outer()
        panels.append(axes)
    if ticks is not None:
        top = panels[0].get_xaxis_transform()
        panels[0].plot(ticks, np.ones(ticks.size), "|", transform=top, **_TICKS)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)

    path = figure.add_subplot(grid[:, 1])
    axis_names = ("xyz"[columns[0]], "xyz"[columns[1]])
    observed, predicted = (hand[:, columns] for hand in hands)
    draw_hand_path(path, observed, predicted, segments, axis_names, names)
    shown = dict(zip(*path.get_legend_handles_labels()[::-1], strict=True))
    shown |= dict(zip(*panels[-1].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=len(shown))


def draw_hand_path(
    axes: Axes,
    observed: Array,
    predicted: Array,
    segments: Sequence[tuple[int, int]],
    axis_names: tuple[str, str],
    names: Names = NAMES,
) -> None:
    """The hand's path (k, 2) [m] in two axes, with a mark where each segment begins."""
    axes.plot(*observed.T, **OBSERVED, label=names[0])
    axes.plot(*predicted.T, **PREDICTED, label=names[1])
    starts = [start for start, _ in segments]
    marks = observed[[*starts, segments[-1][1]]]
    style = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 5}
    axes.plot(*marks.T, "o", label="segment ends", **style)
    axes.set_xlabel(f"hand {axis_names[0]} [m]")
    axes.set_ylabel(f"hand {axis_names[1]} [m]")
    axes.set_aspect("equal", adjustable="datalim")


def widest_columns(values: Array, count: int) -> list[int]:
    """Indices of the columns (k, m) with the largest range, in their own order."""
    order = np.argsort(-np.ptp(values, axis=0), kind="stable")
    return sorted(int(column) for column in order[:count])


def widest_of_thirds(values: Array) -> list[int]:
    """The widest column of each third of (k, m): of an arm's joints, shoulder, elbow and wrist."""
    thirds = [third for third in np.array_split(np.arange(values.shape[1]), 3) if len(third)]
    return [int(third[widest_columns(values[:, third], 1)[0]]) for third in thirds]


def line_styles(count: int) -> list[dict[str, Any]]:
    """Styles of so many lines: colours from dark to light, and dashes that differ in grey print."""
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, max(count, 2)))
    return [
        {"color": shades[index], "linestyle": _DASHES[index % len(_DASHES)], "linewidth": 1.6}
        for index in range(count)
    ]


def draw_coordinates(axes: Axes, s: Array, values: Array, names: Sequence[str]) -> None:
    """Coordinates (k, n) over s (k,), each with its name."""
    for name, column, style in zip(names, values.T, line_styles(len(names)), strict=True):
        axes.plot(s, column, label=name, **style)
    axes.set_xlim(s[0], s[-1])


def draw_way(axes: Axes, way: Array, stops: Array, names: tuple[str, str]) -> None:
    """A path (k, 2) with marks at its ends and at via points (m, 2)."""
    axes.plot(*way.T, **OBSERVED, label="path")
    hollow = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 6}
    axes.plot(*way[:1].T, "o", label="start", **hollow)
    if len(stops):
        axes.plot(*stops.T, "D", label="via point", color="#7a7a7a", markersize=6)
    axes.plot(*way[-1:].T, "s", label="end", color=PREDICTED["color"], markersize=6)
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])
    axes.set_aspect("equal", adjustable="datalim")


def draw_ellipses(axes: Axes, centres: Array, matrices: Array, size: float) -> None:
    """Circles of the metrics (k, 2, 2) around points (k, 2), drawn so that the largest has a size.

    Each is the set of velocities of one length: where it is narrow, to go is expensive.
    """
    if not len(centres):
        return
    turns = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.array([np.cos(turns), np.sin(turns)])
    outlines = np.linalg.solve(np.linalg.cholesky(matrices).transpose(0, 2, 1), circle)
    scale = size / np.abs(outlines).max()
    for index, (centre, outline) in enumerate(zip(centres, outlines, strict=True)):
        label = "circles of the metric" if index == 0 else None
        axes.plot(*(centre[:, None] + scale * outline), color="#8fa3b8", linewidth=1.0, label=label)


def draw_capsule(axes: Axes, start: Array, end: Array, radius: float, label: str | None) -> None:
    """The outline of a capsule in the plane, of its segment's ends (2,)."""
    along = end - start
    angle = float(np.arctan2(along[1], along[0]))
    turns = np.linspace(angle - np.pi / 2.0, angle + np.pi / 2.0, 37)
    arc = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    axes.fill(*np.concatenate([end + arc, start - arc]).T, label=label, **_SOLID)


def draw_half_plane(axes: Axes, point: Array, normal: Array, label: str | None) -> None:
    """What lies behind a line through a point (2,) with a normal (2,), as far as the axes show."""
    far = 10.0 * max(float(np.abs([axes.get_xlim(), axes.get_ylim()]).max()), 1.0)
    across = np.array([-normal[1], normal[0]])
    near = [point - far * across, point + far * across]
    corners = [*near, near[1] - far * normal, near[0] - far * normal]
    # Added as an artist, it leaves the axes' limits alone.
    axes.add_artist(Polygon(corners, label=label, **_SOLID))
