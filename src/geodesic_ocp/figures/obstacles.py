"""Outlines of obstacles in a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.primitives import Capsule, HalfSpace, Obstacle, as_capsule

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROUNDING = 1e-9
_FILL: dict[str, Any] = {
    "facecolor": "#d9d2c5",
    "edgecolor": "#6b6257",
    "linewidth": 1.0,
    "zorder": 0,
}


def draw_obstacle(
    axes: Axes, obstacle: Obstacle, columns: tuple[int, int], label: str | None = None
) -> None:
    """Draw the outline of a stationary obstacle, projected along the third axis.

    A half-space whose boundary is not seen edge-on is omitted: it would fill the figure.
    """
    shown = list(columns)
    if isinstance(obstacle, HalfSpace):
        normal = np.array(obstacle.normal)[shown]
        if np.linalg.norm(normal) > 1.0 - _ROUNDING:
            _draw_half_plane(axes, np.array(obstacle.point)[shown], normal, label)
    elif obstacle.link is None:
        body: Capsule = as_capsule(obstacle)
        start, end = (np.array(each)[shown] for each in (body.start, body.end))
        _draw_capsule(axes, start, end, body.radius, label)


def _draw_capsule(axes: Axes, start: Array, end: Array, radius: float, label: str | None) -> None:
    """Draw the outline of a capsule in the plane from the ends (2,) of its segment."""
    along = end - start
    angle = float(np.arctan2(along[1], along[0]))
    turns = np.linspace(angle - np.pi / 2.0, angle + np.pi / 2.0, 37)
    arc = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    axes.fill(*np.concatenate([end + arc, start - arc]).T, label=label, **_FILL)


def _draw_half_plane(axes: Axes, point: Array, normal: Array, label: str | None) -> None:
    """Fill the half-plane behind a line with a point (2,) and normal (2,) within the axes."""
    from matplotlib.patches import Polygon

    far = 10.0 * max(float(np.abs([axes.get_xlim(), axes.get_ylim()]).max()), 1.0)
    across = np.array([-normal[1], normal[0]])
    near = [point - far * across, point + far * across]
    corners = [*near, near[1] - far * normal, near[0] - far * normal]
    # Added as an artist, it leaves the axes' limits alone.
    axes.add_artist(Polygon(corners, label=label, **_FILL))
