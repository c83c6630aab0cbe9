"""The figure of an analysis: the arm at some instants, errors over time, paths of the hands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.arm_shapes import Postures
from geodesic_ocp.drawing.arm_strip import StripArm, draw_arm_strip, strip_instants
from geodesic_ocp.drawing.best_view import across, best_view
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.comparison_figure import draw_curves
from geodesic_ocp.drawing.styles import (
    COMPARED,
    CUT_LINES,
    OBSERVED,
    PALE,
    PREDICTED,
    new_figure,
)
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.studies.compare_metrics import MetricComparison
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.uncertainty import Uncertainty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.gridspec import GridSpec, SubplotSpec


Names = tuple[str, str]
NAMES: Names = ("observed", "predicted")
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


def analysis_figure(
    analysis: Analysis,
    curve: MetricComparison | Callable[[Axes], object] | None = None,
    uncertainty: Uncertainty | None = None,
) -> Figure:
    """Draw the arm at some instants, errors over time on the same segments, and the hands' paths.

    Args:
        analysis: the analysis.
        curve: error against the number of synergies, or a function that draws into axes, in a
            panel of its own; None leaves it out.
        uncertainty: tells stable cuts from doubtful ones.
    """
    if isinstance(curve, MetricComparison):
        curve = partial(draw_curves, comparison=curve)
    model = analysis.model
    motion = analysis.motion
    labels = hand_labels(model.hands)
    methods = analysis.on_same_segments()
    compared = {name: analysis.predictions[method].q for method, name in methods.items()}
    joints, distances = errors_over_time(model, motion.q, compared)
    predicted = analysis.predicted.q
    hands = {
        label: (model.frame_pose(hand, motion.q)[1], model.frame_pose(hand, predicted)[1])
        for label, hand in zip(labels, model.hands, strict=True)
    }
    several = len(labels) > 1
    # Both arms stretched out are twice as wide as one.
    instants = strip_instants(analysis.segments, INSTANTS // 2 + 1 if several else INSTANTS)
    observed = StripArm(Postures.of(model, motion.q[instants]), "observed", "observed")
    name = f"predicted, {next(iter(joints))}"
    planned = StripArm(Postures.of(model, predicted[instants]), "predicted", name, filled=False)
    view = best_view(observed.postures, np.concatenate([seen for seen, _ in hands.values()]))
    figure = new_figure(10.0, 12.0 if several else 9.6)
    draw_analysis(
        figure,
        time=motion.time - motion.time[0],
        segments=analysis.segments,
        instants=instants,
        views=(view, across(view, observed.postures)),
        arms=(observed, planned),
        hands=hands,
        joints=joints,
        distances=distances,
        curve=curve,
        stable=None if uncertainty is None else uncertainty.stable,
    )
    count = str(len(analysis.segments))
    if uncertainty is not None:
        count += " ({} to {})".format(*uncertainty.count_range)
    figure.suptitle(
        f"{model.name}: {count} geodesic synergies ({analysis.cuts}),"
        + ("\n" if several or uncertainty is not None else " ")
        + analysis.metric_name.replace("^2", "²")
    )
    return figure
