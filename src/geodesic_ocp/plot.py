"""Figures: functions that draw on a matplotlib Axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from geodesic_ocp.arrays import Array

# Dark blue and orange differ in hue and in lightness, and stay apart in grey print.
OBSERVED: dict[str, Any] = {"color": "#1b3a5c", "linewidth": 2.0}
PREDICTED: dict[str, Any] = {"color": "#e07b00", "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
_SHADES = ("#dfe6ee", "#ffffff")


def shade_segments(axes: Axes, time: Array, segments: Sequence[tuple[int, int]]) -> None:
    """Fill the segments' spans of time [s] in alternating shades."""
    for index, (start, stop) in enumerate(segments):
        axes.axvspan(time[start], time[stop], color=_SHADES[index % 2], linewidth=0, zorder=0)
    axes.set_xlim(time[0], time[-1])


def draw_over_time(axes: Axes, time: Array, observed: Array, predicted: Array, label: str) -> None:
    """One coordinate over time [s], observed (k,) and predicted (k,)."""
    axes.plot(time, observed, **OBSERVED, label="observed")
    axes.plot(time, predicted, **PREDICTED, label="predicted")
    axes.set_ylabel(label)


def draw_hand_path(
    axes: Axes,
    observed: Array,
    predicted: Array,
    segments: Sequence[tuple[int, int]],
    axis_names: tuple[str, str],
) -> None:
    """The hand's path (k, 2) [m] in two axes, with a mark where each segment begins."""
    axes.plot(*observed.T, **OBSERVED, label="observed")
    axes.plot(*predicted.T, **PREDICTED, label="predicted")
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
