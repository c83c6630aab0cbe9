"""A motion over time: the hand and some joints in panels, and the path of the hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.arm_strip import StripArm, draw_arm_strip
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.styles import (
    BASELINE,
    COMPARED,
    CUT_LINES,
    OBSERVED,
    PALE,
    PREDICTED,
    line_styles,
    new_figure,
)
from geodesic_ocp.model.model import Model, hand_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.gridspec import GridSpec, SubplotSpec


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


def draw_overview(
    figure: FigureBase,
    time: Array,
    segments: Sequence[tuple[int, int]],
    hands: tuple[Array, Array],
    joints: Sequence[tuple[str, Array, Array]],
    names: Names,
    other: str,
    ticks: Array,
    strips: Sequence[Callable[[Axes], object]],
) -> None:
    """Draw hand and joints over time in panels, and the path of the hand beside them.

    Args:
        time: time of the samples (k,) [s].
        segments: (start, stop) samples of the segments, whose time spans are shaded.
        hands: positions (k, 3) [m] of the observed and the predicted hand.
        joints: label, observed (k,) and predicted (k,) values of each joint.
        names: labels of the observed and the predicted hand.
        other: label of the joints drawn beside the predicted ones.
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
        first, look = (names[0], OBSERVED) if row < len(columns) else (other, BASELINE)
        axes.plot(time, observed, **look, label=first)
        axes.plot(time, predicted, **PREDICTED, label=names[1])
        long = max(map(len, label.splitlines())) > _LONG
        axes.set_ylabel(label, fontsize="small" if long else None)
        axes.label_outer()
        panels.append(axes)
    top = panels[0].get_xaxis_transform()
    panels[0].plot(ticks, np.ones(ticks.size), "|", transform=top, **_TICKS)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)

    path = figure.add_subplot(grid[above:, 1])
    draw_hand_path(path, *hands, segments, names)
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
    names: Names = NAMES,
    hand: str = "hand",
    stable: NDArray[np.bool_] | None = None,
) -> None:
    """Draw the path of the hand (k, 3) [m] in the two axes of largest range, with a mark where each
    segment begins; it is pale where a cut (c,) is not stable, if that is known.
    """
    first, second = widest_columns(observed, 2)
    axes.plot(*observed[:, [first, second]].T, **OBSERVED, label=names[0])
    axes.plot(*predicted[:, [first, second]].T, **PREDICTED, label=names[1])
    starts = [start for start, _ in segments]
    marks = observed[[*starts, segments[-1][1]]][:, [first, second]]
    style = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 5}
    sure = np.ones(len(marks), dtype=bool)
    if stable is not None:
        sure[1:-1] = stable
    axes.plot(*marks[~sure].T, "o", **{**style, "markeredgecolor": PALE})
    axes.plot(*marks[sure].T, "o", label="segment ends", **style)
    axes.set(xlabel=f"{hand} {'xyz'[first]} [m]", ylabel=f"{hand} {'xyz'[second]} [m]")
    axes.set_aspect("equal", adjustable="datalim")


def widest_columns(values: Array, count: int) -> list[int]:
    """Return indices of the columns (k, m) with the largest range, in their own order."""
    order = np.argsort(-np.ptp(values, axis=0), kind="stable")
    return sorted(int(column) for column in order[:count])


def widest_of_thirds(values: Array) -> list[int]:
    """Return the column of largest range in each third of (k, m): shoulder, elbow and wrist of an
    arm.
    """
    thirds = [third for third in np.array_split(np.arange(values.shape[1]), 3) if len(third)]
    return [int(third[widest_columns(values[:, third], 1)[0]]) for third in thirds]


_HEADROOM = 1.6  # above the two predictions with the smallest peaks


def errors_over_time(
    model: Model, observed: Array, predicted: Mapping[str, Array]
) -> tuple[dict[str, Array], dict[str, dict[str, Array]]]:
    """Return mean errors of the joints (k,) [rad or m] by prediction, and distances of each hand
    (k,) [m] by its label and prediction.

    Args:
        observed: configurations (k, n).
        predicted: configurations (k, n) by the name of the prediction.
    """
    joints = {name: np.mean(np.abs(q - observed), axis=1) for name, q in predicted.items()}
    distances: dict[str, dict[str, Array]] = {}
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        seen = model.frame_pose(hand, observed)[1]
        ways = {name: model.frame_pose(hand, q)[1] for name, q in predicted.items()}
        distances[label] = {n: np.linalg.norm(way - seen, axis=1) for n, way in ways.items()}
    return joints, distances


def draw_error_over_time(
    axes: Axes,
    time: Array,
    segments: Sequence[tuple[int, int]],
    errors: Mapping[str, Array],
    label: str,
) -> None:
    """Draw errors (k,) over time [s] by prediction; spans between cuts are shaded in turn.

    The two with the smallest peaks set the scale; the largest that exceeds it is written above.
    """
    shade_segments(axes, time, segments)
    styles = zip(errors.items(), cycle(COMPARED), strict=False)
    for number, ((name, error), style) in enumerate(styles):
        front = {"marker": "", "zorder": 3.0 - 0.1 * number}
        axes.plot(time, error, **{**style, **front}, label=name)
    peaks = [float(np.max(error)) for error in errors.values()]
    top = min(_HEADROOM * sorted(peaks)[:2][-1], 1.05 * max(peaks))
    if max(peaks) > top:
        corner: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
        style = {"ha": "right", "fontsize": "small", "color": "0.3"}
        axes.annotate(f"up to {max(peaks):.3g}", (1.0, 1.0), (0.0, 4.0), **corner, **style)
    axes.set_ylim(0.0, top or 1.0)
    axes.set_ylabel(label)


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
    views: Sequence[Camera],
    arms: Sequence[StripArm],
    hands: Mapping[str, tuple[Array, Array]],
    joints: Mapping[str, Array],
    distances: Mapping[str, Mapping[str, Array]],
    curve: Callable[[Axes], object] | None = None,
    stable: NDArray[np.bool_] | None = None,
) -> None:
    """Draw the arm at some instants, the errors over time, the path of each hand, and the curve.

    Args:
        time: time of the samples (k,) [s].
        segments: (start, stop) samples of the segments.
        instants: samples at which the arms are drawn, see `strip_instants`.
        views: from where the arms are seen.
        arms: the observed and the predicted one at the instants.
        hands: positions (k, 3) [m] of the observed and the predicted hand, by name.
        joints: errors of the joints (k,) [rad] over time, by prediction.
        distances: distances of each hand by prediction, error of its position (k,) [m] over time.
        curve: draws the error against the number of synergies; None leaves that panel out.
        stable: which of the cuts between segments are stable (c,); None: this is not known.
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
        if stable is not None:
            for start, sure in zip([start for start, _ in segments[1:]], stable, strict=True):
                axes.axvline(time[start], **CUT_LINES["stable" if sure else "doubtful"], zorder=1)
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
    if stable is not None:
        for name, style in CUT_LINES.items():
            lines[0].append(panels[-1].plot([], [], **style)[0])
            lines[1].append(f"{name} cut")
    figure.legend(*lines, loc="outside lower left", ncols=len(lines[0]), **_LEGEND)

    places = _panels(grid, len(hands) + (curve is not None))
    for place, (hand, (observed, predicted)) in zip(places, hands.items(), strict=False):
        path = figure.add_subplot(place)
        draw_hand_path(path, observed, predicted, segments, hand=hand, stable=stable)
        marked = "circles are cuts" if stable is None else "pale: doubtful cuts"
        path.set_title(f"path of the {hand}; {marked}", **_TITLE)
    if curve is not None:
        axes = figure.add_subplot(places[-1])
        curve(axes)
        if legend := axes.get_legend():
            legend.remove()  # the lines are those of the errors
        axes.set_title("best cuts (filled: least BIC, hollow: analysed)", **_TITLE)


def _panels(grid: GridSpec, count: int) -> list[SubplotSpec]:
    """Return places for panels of equal height on the right, below the strip."""
    if count == grid.nrows - 1:
        return [grid[row, 1] for row in range(1, grid.nrows)]
    below = grid[1:, 1].subgridspec(count, 1)
    return [below[row, 0] for row in range(count)] if count > 1 else [grid[1:, 1]]


def draw_replay(
    time: Array,
    joint_names: Sequence[str],
    units: Sequence[str],
    error: Array,
    hand_errors: tuple[Array, Array],
    torque_shares: Array,
) -> Figure:
    """Return three panels over time (k,) [s].

    Args:
        time: time of the samples.
        joint_names, units: names and units of the n joints.
        error: error of positions (k, n) [rad or m].
        hand_errors: hand errors of position [m] and orientation [rad], (k,) each.
        torque_shares: torques over their limits (k, n).
    """
    figure = new_figure(9.0, 8.0)
    joints, hand, torques = figure.subplots(3, 1, sharex=True)
    styles = line_styles(len(joint_names))
    for name, column, share, style in zip(
        joint_names, error.T, torque_shares.T, styles, strict=True
    ):
        joints.plot(time, 1e3 * column, **style, label=name)
        torques.plot(time, 100.0 * share, **style)
    shown = "mrad" if set(units) == {"rad"} else "mm" if set(units) == {"m"} else "mrad or mm"
    joints.set_ylabel(f"joint error [{shown}]")
    hand.plot(time, 1e3 * hand_errors[0], **OBSERVED, label="position [mm]")
    hand.plot(time, 1e3 * hand_errors[1], **PREDICTED, label="orientation [mrad]")
    hand.set_ylabel("hand error")
    hand.legend(loc="best", fontsize="small")
    hand.set_ylim(bottom=0.0)
    torques.set_ylabel("torque, share of its limit [%]")
    torques.set_xlabel("time [s]")
    if np.abs(torque_shares).max() > 0.5:
        for side in (-100.0, 100.0):
            torques.axhline(side, **BASELINE)
    figure.legend(*joints.get_legend_handles_labels(), loc="outside right upper", fontsize="small")
    return figure
