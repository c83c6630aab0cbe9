"""Curves of error against number of segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import COMPARED, line_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABELS = {
    "joint": "mean joint error [rad]",
    "position": "mean error of the hand's position [m]",
    "orientation": "mean error of the hand's orientation [rad]",
}
_MARKS = "DvPXph*<>"
_LEAST_SHOWN, _BEYOND = 24, 1.25  # numbers of segments, and a factor beyond the largest mark


def draw_error_curves(
    axes: Axes,
    curves: Mapping[str, tuple[np.ndarray, Array, int]],
    points: Mapping[str, Sequence[tuple[int, float]]],
    measure: str,
    max_count: int | None,
) -> None:
    """Draw one curve for each name, marked at its best number, and hollow marks for its points.

    Args:
        axes: to draw into.
        curves: numbers of segments (k,), errors (k,), and the best number.
        points: (number of segments, error) by name.
        measure: for the label of the axis.
        max_count: largest number shown.
    """
    marked = [best for *_, best in curves.values()]
    marked += [count for found in points.values() for count, _ in found]
    largest = max(int(counts[-1]) for counts, *_ in curves.values())
    if max_count is None:
        max_count = min(largest, max(_LEAST_SHOWN, int(_BEYOND * max(marked, default=0))))
    visible: list[float] = []
    for (name, (counts, errors, best)), style in zip(
        curves.items(), _styles(len(curves)), strict=True
    ):
        mark, line = style["marker"], {**style, "marker": "none"}
        few = {"marker": mark, "markersize": 4.0} if len(counts) <= 12 else {}
        shown = counts <= max_count
        axes.plot(counts[shown], errors[shown], **{**line, **few}, label=name)
        at = {"color": style["color"], "linestyle": "none", "marker": mark, "zorder": 4}
        axes.plot([best], errors[counts == best], markersize=8.0, **at)
        hollow = [point for point in points.get(name, ()) if point[0] <= max_count]
        if hollow:
            axes.plot(*np.transpose(hollow), markersize=6.5, fillstyle="none", **at)
        visible += [*errors[shown], *(error for _, error in hollow)]
    axes.set_yscale("log")
    positive = [error for error in visible if error > 0.0]
    if positive:
        axes.set_ylim(0.85 * min(positive), 1.15 * max(positive))
    axes.set_xlim(0.0, max_count + 1.0)
    axes.set_xlabel("number of segments")
    axes.set_ylabel(_LABELS[measure])
    axes.grid(which="both", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    _plain_ticks(axes)
    _add_legend(axes, any(points.values()))


def _styles(count: int) -> list[dict[str, Any]]:
    if count <= len(COMPARED):
        return list(COMPARED[:count])
    marks = ["o", "s", "^", *_MARKS]
    return [
        {**style, "marker": marks[index % len(marks)]}
        for index, style in enumerate(line_styles(count))
    ]


def _plain_ticks(axes: Axes) -> None:
    """Numbers such as 0.02 instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.yaxis.set_major_locator(LogLocator(base=10.0, subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _add_legend(axes: Axes, has_points: bool) -> None:
    """A legend of the curves and of the two kinds of marks."""
    from matplotlib.lines import Line2D

    grey: dict[str, Any] = {"color": "0.35", "linestyle": "none", "marker": "o"}
    handles: list[Any] = list(axes.get_legend_handles_labels()[0])
    handles.append(Line2D([], [], markersize=8.0, label="least BIC", **grey))
    if has_points:
        mark = Line2D([], [], markersize=6.5, fillstyle="none", label="online rule", **grey)
        handles.append(mark)
    axes.legend(handles=handles, fontsize="small", frameon=True, framealpha=0.9)
