"""A close-up of where an arm is nearest to an obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.figures.arms.posture_shapes import posture_shapes
from geodesic_ocp.figures.arms.shapes import draw_shapes
from geodesic_ocp.figures.arms.view import View
from geodesic_ocp.figures.arms.view_marks import draw_scale
from geodesic_ocp.figures.obstacles import obstacle_shape
from geodesic_ocp.figures.styles import OBSERVED, PREDICTED
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, Obstacle, as_capsule

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HALF = 0.42  # of the width, relative to the extent of the arm
_BODY: dict[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (2.5, 1.5))}
_GAP: dict[str, Any] = {"color": PREDICTED["color"], "linewidth": 2.5, "solid_capstyle": "butt"}
_PATH: dict[str, Any] = {"color": OBSERVED["color"], "linewidth": 0.9, "zorder": 4.0}


def draw_close_up(
    axes: Axes,
    view: View,
    model: Model,
    q: Array,
    points: Array,
    obstacles: Sequence[Obstacle],
    *,
    links: Sequence[str] | None = None,
    paths: Sequence[Array] = (),
) -> None:
    """Draw an arm around the two points at which it is nearest to an obstacle.

    Args:
        axes: to draw in; its own axes have no numbers, and a bar gives the scale.
        view: in which it is seen.
        model: the arm.
        q: its configuration (n,).
        points: the two points that are nearest, (2, 3) [m].
        obstacles: that do not move.
        links: whose collision bodies are drawn, dashed; None: of all that move.
        paths: lines (m, 3) [m], such as the path of the hand.
    """
    posture = Postures.of(model, q)
    centre = view.plane(points.mean(axis=0))
    half = _HALF * float(np.ptp(posture.joints[0], axis=0).max())
    box = centre - half, centre + half
    seen = [obstacle_shape(each, view, box) for each in obstacles]
    shapes = [shape for shape in seen if shape is not None]
    draw_shapes(axes, [*posture_shapes(posture, 0, view), *shapes])
    for body in model.bodies:
        if body.link is not None and model.moves(body.link) and body.link in (links or [body.link]):
            outline = _outline(model, body, q, view)
            axes.plot(*np.concatenate([outline, outline[:1]]).T, zorder=3.0, **_BODY)
    for path in paths:
        axes.plot(*view.plane(path).T, **_PATH)
    axes.plot(*view.plane(points).T, zorder=5.0, **_GAP)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(box[0][0], box[1][0])
    axes.set_ylim(box[0][1], box[1][1])
    axes.set_xticks([])
    axes.set_yticks([])
    draw_scale(axes, float(box[0][0] + 0.08 * half), float(box[0][1] + 0.08 * half), half)


def _outline(model: Model, body: Body, q: Array, view: View) -> Array:
    """Outline (m, 2) of a body that is fixed to a link."""
    assert body.link is not None
    rotation, position = model.frame_pose(body.link, q)
    capsule = as_capsule(body)
    start, end = (rotation @ np.array(each) + position for each in (capsule.start, capsule.end))
    shape = obstacle_shape(replace(capsule, start=start, end=end, link=None), view)
    assert shape is not None
    return shape.outlines[0]
