"""Outlines of obstacles in a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.arm_shapes import Colour, Shape
from geodesic_ocp.drawing.camera import DIRECTIONS, View
from geodesic_ocp.model.primitives import Capsule, HalfSpace, Obstacle, as_capsule

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROUNDING = 1e-9
_FACE: Colour = (0.85, 0.82, 0.77)
_EDGE: Colour = (0.42, 0.38, 0.34)
_HATCH = "////"
_FAR = -1e9  # [m]: behind everything else


def draw_obstacle(
    axes: Axes, obstacle: Obstacle, columns: tuple[int, int], label: str | None = None
) -> None:
    """Draw the outline of a stationary obstacle, projected along the third axis.

    A half-space whose boundary is not seen edge-on is omitted: it would fill the figure.
    """
    from matplotlib.patches import Polygon

    view = View.of_axes(columns)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    far = 10.0 * max(float(np.abs([low, high]).max()), 1.0)
    shape = obstacle_shape(obstacle, view, (np.full(2, -far), np.full(2, far)))
    if shape is None:
        return
    style: dict[str, Any] = {
        "facecolor": _FACE,
        "edgecolor": _EDGE,
        "linewidth": 0.9,
        "hatch": _HATCH,
        "label": label,
        "zorder": 0,
    }
    if isinstance(obstacle, HalfSpace):
        # Added as an artist, it leaves the axes' limits alone.
        axes.add_artist(Polygon(shape.outlines[0], **style))
    else:
        axes.fill(*shape.outlines[0].T, **style)


def obstacle_shape(
    obstacle: Obstacle, view: View, box: tuple[Array, Array] | None = None
) -> Shape | None:
    """Return the outline of a stationary obstacle in a view; None if it is not drawn.

    Args:
        obstacle: those that move with a link are not drawn.
        view: in which it is seen.
        box: corners (2,) [m] of the part of the plane that is filled by a half-space seen edge-on.
    """
    if isinstance(obstacle, HalfSpace):
        normal = view.plane(obstacle.normal)
        if box is None or np.linalg.norm(normal) < 1.0 - _ROUNDING:
            return None
        outline = _behind(*box, view.plane(obstacle.point), normal)
        return None if len(outline) < 3 else Shape((outline,), _FAR, _FACE, _EDGE, 0.0, _HATCH)
    if obstacle.link is not None:
        return None
    body: Capsule = as_capsule(obstacle)
    ends = np.array([body.start, body.end])
    outline = view.outlines(ends) + body.radius * DIRECTIONS
    return Shape((outline,), float(view.depth(ends).mean()), _FACE, _EDGE, 0.9, _HATCH)


def _behind(low: Array, high: Array, point: Array, normal: Array) -> Array:
    """Return the corners (m, 2) of the part of a box that is behind a line."""
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    heights = (corners - point) @ normal
    found = []
    for k in range(4):
        here, after = heights[k], heights[(k + 1) % 4]
        if here <= 0.0:
            found.append(corners[k])
        if here * after < 0.0:
            share = here / (here - after)
            found.append(corners[k] + share * (corners[(k + 1) % 4] - corners[k]))
    return np.array(found)
