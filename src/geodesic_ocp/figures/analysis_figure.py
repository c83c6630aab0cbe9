"""The figure of an analysis: the arm, errors over time, the path of the hand, and a curve."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.arm_strip import StripArm, draw_arm_strip
from geodesic_ocp.figures.arms.view import View
from geodesic_ocp.figures.error_over_time import draw_error_over_time
from geodesic_ocp.figures.overview import draw_hand_path, widest_columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase
    from matplotlib.gridspec import GridSpec, SubplotSpec

INSTANTS = 7  # arms in the strip
_TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}
_MARKS: dict[str, Any] = {"color": "0.3", "markersize": 5, "clip_on": False}
_ABOVE_LEGEND = 22.0  # [pt] of the title, as few arms leave no room for both in a row
_LEGEND: dict[str, Any] = {"frameon": False, "fontsize": "medium"}


def draw_analysis(
    figure: FigureBase,
    time: Array,
    segments: Sequence[tuple[int, int]],
    instants: Sequence[int],
    views: Sequence[View],
    arms: Sequence[StripArm],
    hands: Mapping[str, tuple[Array, Array]],
    joints: Mapping[str, Array],
    distances: Mapping[str, Mapping[str, Array]],
    curve: Callable[[Axes], object] | None = None,
) -> None:
    """Draw the arm at some instants, the errors over time, the path of each hand, and the curve.

    Args:
        figure: to draw in.
        time: of the samples (k,) [s].
        segments: (start, stop) samples of the segments.
        instants: samples at which the arms are drawn, see `strip_instants`.
        views: from where the arms are seen.
        arms: the observed and the predicted one at the instants.
        hands: by name, positions (k, 3) [m] of the observed and the predicted hand.
        joints: by prediction, error of the joints (k,) [rad] over time.
        distances: of each hand by prediction, error of its position (k,) [m] over time.
        curve: draws the error against the number of synergies; None leaves that panel out.
    """
    several = len(hands) > 1
    heights = (2.8 if several else 2.1, *[1.0] * (1 + len(hands)))
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.6, 1.0), height_ratios=heights)
    strip = figure.add_subplot(grid[0, :])
    texts = [f"{each:.1f} s" for each in time[list(instants)]]
    handles = draw_arm_strip(strip, views, texts, arms)
    title = f"{'arms' if several else 'arm'}, halfway between cuts"
    strip.set_title(title, **_TITLE, pad=_ABOVE_LEGEND)
    strip.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, **_LEGEND)

    panels: list[Axes] = []
    rows = [("joints [rad]", dict(joints))]
    for hand, each in distances.items():
        rows.append((f"{hand} [mm]", {name: 1000.0 * error for name, error in each.items()}))
    for row, (label, shown) in enumerate(rows):
        axes = figure.add_subplot(grid[1 + row, 0], sharex=panels[0] if panels else None)
        draw_error_over_time(axes, time, segments, shown, label)
        panels.append(axes)
    for axes in panels[:-1]:
        axes.label_outer()
    panels[0].set_title("mean error over time, same segments", **_TITLE)
    marks = np.ones(len(instants))
    top = panels[0].get_xaxis_transform()
    panels[0].plot(time[list(instants)], marks, "v", transform=top, **_MARKS)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)
    lines = panels[-1].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower left", ncols=len(joints), **_LEGEND)

    places = _panels(grid, len(hands) + (curve is not None))
    for place, (hand, (observed, predicted)) in zip(places, hands.items(), strict=False):
        columns = widest_columns(observed, 2)
        axis_names = ("xyz"[columns[0]], "xyz"[columns[1]])
        path = figure.add_subplot(place)
        ways = observed[:, columns], predicted[:, columns]
        draw_hand_path(path, *ways, segments, axis_names, hand=hand)
        path.set_title(f"path of the {hand}; circles are cuts", **_TITLE)
    if curve is not None:
        axes = figure.add_subplot(places[-1])
        curve(axes)
        if legend := axes.get_legend():
            legend.remove()  # the lines are those of the errors
        axes.set_title("best cuts (filled: least BIC, hollow: online rule)", **_TITLE)


def _panels(grid: GridSpec, count: int) -> list[SubplotSpec]:
    """Places for panels of equal height on the right, below the strip."""
    if count == grid.nrows - 1:
        return [grid[row, 1] for row in range(1, grid.nrows)]
    below = grid[1:, 1].subgridspec(count, 1)
    return [below[row, 0] for row in range(count)] if count > 1 else [grid[1:, 1]]
