"""A strip of arms: bodies side by side, one for each of some instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.figures.arms.posture_shapes import TINT, outline_of_all, posture_shapes
from geodesic_ocp.figures.arms.shapes import Shape, draw_shapes, mixed
from geodesic_ocp.figures.arms.view import View
from geodesic_ocp.figures.arms.view_marks import draw_axes_of_space, draw_scale
from geodesic_ocp.figures.obstacles import obstacle_shape
from geodesic_ocp.figures.styles import ROLES
from geodesic_ocp.model.primitives import HalfSpace, Obstacle

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_GAP = 0.18  # between figures and between views, of the largest extent
_NOTE: dict[str, Any] = {"color": "0.45", "fontsize": "small"}
_PATH: dict[str, Any] = {"linewidth": 0.9, "zorder": 4.0}
_OUTLINE: dict[str, Any] = {"linewidth": 1.0, "linestyle": (0, (3.0, 1.2)), "zorder": 3.0}
_TARGET: dict[str, Any] = {"markersize": 6.0, "markeredgewidth": 1.2, "zorder": 4.1}


@dataclass(frozen=True, eq=False, repr=False)
class StripArm:
    """What is drawn of a model in each figure of a strip.

    Attributes:
        postures: at the instants.
        role: whose colour it has.
        label: for the legend.
        filled: whether its bodies are filled; otherwise they are dashed outlines on top.
    """

    postures: Postures
    role: str = "observed"
    label: str = "arm"
    filled: bool = True

    def __repr__(self) -> str:
        return f"StripArm({self.label!r}, {self.role})"


def strip_instants(segments: Sequence[tuple[int, int]], count: int) -> list[int]:
    """Samples halfway between cuts, of the segments at `count` evenly spaced times.

    At the cuts a prediction agrees with the observation by construction.
    """
    edges = np.linspace(segments[0][0], segments[-1][1], count + 1)
    wanted = (edges[1:] + edges[:-1]) / 2
    chosen = {
        (start + stop) // 2
        for start, stop in segments
        if np.any((wanted >= start) & (wanted < stop))
    }
    return sorted(chosen)


def draw_arm_strip(
    axes: Axes,
    views: Sequence[View],
    labels: Sequence[str],
    arms: Sequence[StripArm],
    *,
    obstacles: Sequence[Obstacle] = (),
    paths: Sequence[Array] = (),
    targets: Array | None = None,
    title: str = "",
) -> list[Artist]:
    """Draw arms at some instants side by side, in one row for each view.

    Args:
        axes: to draw in; its own axes are hidden, and a bar gives the scale.
        views: from where they are seen.
        labels: below each of the k instants.
        arms: at the instants; bodies that do not move are those of the first.
        obstacles: in every figure; planes where they are seen edge-on.
        paths: lines (m, 3) [m] in every figure, such as the path of the hand.
        targets: points (k, 3) [m], one in each figure, where the hand was to be.
        title: above the strip.

    Returns:
        Handles for a legend.
    """
    rows = [_row(view, len(labels), arms, obstacles, paths) for view in views]
    width = max(high[0] - low[0] for _, low, high in rows)
    tallest = max(high[1] - low[1] for _, low, high in rows)
    gap = _GAP * max(width, tallest)
    pitch, top = width + gap, 0.0
    for view, (columns, low, high) in zip(views, rows, strict=True):
        height = float(high[1] - low[1])
        origin = np.array([(low[0] + high[0]) / 2.0, high[1] - top])
        shifts = [np.array([column * pitch, 0.0]) - origin for column in range(len(labels))]
        cell = np.array([-pitch / 2.0, -height - gap / 4.0]), np.array([pitch / 2.0, gap / 3.0])
        for column, (shapes, shift) in enumerate(zip(columns, shifts, strict=True)):
            here = cell[0] - shift + [column * pitch, top], cell[1] - shift + [column * pitch, top]
            planes = [each for each in obstacles if isinstance(each, HalfSpace)]
            ground = [obstacle_shape(each, view, here) for each in planes]
            every = [*(each for each in ground if each is not None), *shapes]
            draw_shapes(axes, [shape.moved(shift) for shape in every])
            for arm in arms:
                if not arm.filled:
                    bodies = posture_shapes(arm.postures, column, view, still=False)
                    line = outline_of_all(bodies) + shift
                    axes.plot(*line.T, color=ROLES[arm.role]["color"], **_OUTLINE)
            for path in paths:
                axes.plot(
                    *(view.plane(path) + shift).T, color=ROLES[arms[0].role]["color"], **_PATH
                )
            if targets is not None:
                mark = view.plane(targets[column]) + shift
                colour = ROLES["observed"]["color"]
                axes.plot(*mark, "+", color=colour, **_TARGET)
        middle = (-0.5 * pitch, top - 0.5 * height)
        if len(views) > 1:
            axes.text(*middle, view.name, **_NOTE, rotation=90, ha="right", va="center")
        if view.axis is None:
            corner = np.array([-0.5 * pitch, top - height])
            draw_axes_of_space(axes, view, corner, 0.14 * max(height, width))
        top -= height + gap
    bottom = top + gap
    for column, label in enumerate(labels):
        axes.text(column * pitch, bottom - 0.35 * gap, label, ha="center", va="top")
    draw_scale(axes, (len(labels) - 0.5) * pitch, bottom, tallest)
    axes.set_xlim(-0.55 * pitch, (len(labels) - 0.4) * pitch)
    axes.set_ylim(bottom - gap, 0.5 * gap)
    axes.set_aspect("equal", anchor="W")
    axes.set_axis_off()
    if title:
        axes.set_title(title, loc="left", fontsize="medium", parse_math=False)
    return [_handle(arm) for arm in arms]


def _row(
    view: View,
    count: int,
    arms: Sequence[StripArm],
    obstacles: Sequence[Obstacle],
    paths: Sequence[Array],
) -> tuple[list[list[Shape]], Array, Array]:
    """Shapes of each figure, and the corners (2,) of a box around all of them."""
    bodies = [each for each in obstacles if not isinstance(each, HalfSpace)]
    fixed = [shape for body in bodies if (shape := obstacle_shape(body, view)) is not None]
    columns = []
    for column in range(count):
        shapes = list(fixed)
        for number, arm in enumerate(arms):
            if arm.filled:
                shapes += posture_shapes(arm.postures, column, view, arm.role, still=number == 0)
        columns.append(shapes)
    points = [outline for shapes in columns for shape in shapes for outline in shape.outlines]
    points += [view.plane(arm.postures.joints).reshape(-1, 2) for arm in arms]
    every = np.concatenate([*points, *(view.plane(path) for path in paths)])
    return columns, every.min(axis=0), every.max(axis=0)


def _handle(arm: StripArm) -> Artist:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour = ROLES[arm.role]["color"]
    if arm.filled:
        return Patch(facecolor=mixed(colour, TINT), edgecolor=colour, label=arm.label)
    return Line2D([], [], color=colour, label=arm.label, **_OUTLINE)
