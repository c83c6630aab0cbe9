"""What tells how a view lies in space: a scale, and the directions of the axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SCALES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # [m]
_NOTE: dict[str, Any] = {"color": "0.45", "fontsize": "small"}  # read on black, too
_SHORT = 0.15  # of an axis that is not named, as it is seen nearly end-on


def draw_scale(axes: Axes, x: float, y: float, height: float) -> None:
    """Draw a vertical bar of a round length [m] from a point in the figure."""
    length = max((each for each in _SCALES if each <= 0.6 * height), default=_SCALES[0])
    axes.plot([x, x], [y, y + length], color="0.45", linewidth=1.5)
    place: dict[str, Any] = {"textcoords": "offset points", "ha": "left", "va": "center"}
    axes.annotate(f"{length:g} m", (x, y + length / 2), (4.0, 0.0), rotation=90, **place, **_NOTE)


def draw_axes_of_space(axes: Axes, view: View, origin: Array, length: float) -> None:
    """Draw the axes x, y and z [m] from a point (2,) of the figure."""
    tips = length * view.plane(np.eye(3))
    for name, tip in zip("xyz", tips, strict=True):
        axes.plot(*np.array([origin, origin + tip]).T, color="0.45", linewidth=1.0)
        if np.linalg.norm(tip) > _SHORT * length:
            x, y = origin + 1.35 * tip
            axes.text(x, y, name, ha="center", va="center", **_NOTE)
