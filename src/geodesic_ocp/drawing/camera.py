"""Views: parallel projections of space into the plane of a figure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_TURNS = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
# Directions in the plane (64, 2) in which the extreme points make an outline.
DIRECTIONS = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_ALONG = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class View:
    """A parallel projection.

    Attributes:
        right, up: the directions of the figure's axes, unit vectors (3,).
    """

    right: Array
    up: Array

    def __repr__(self) -> str:
        return f"View({self.name})"

    @classmethod
    def of_axes(cls, columns: tuple[int, int]) -> View:
        """Return the view with these two of the axes x, y and z to the right and up."""
        return cls(np.eye(3)[columns[0]], np.eye(3)[columns[1]])

    @classmethod
    def around_z(cls, azimuth: float, elevation: float) -> View:
        """Return the view of an observer at this azimuth from x to y and elevation [deg], z up."""
        around, above = np.deg2rad([azimuth, elevation])
        right = np.array([-np.sin(around), np.cos(around), 0.0])
        towards = [np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)]
        return cls(right.round(12), np.cross(towards, right).round(12))

    @cached_property
    def towards(self) -> Array:
        """Direction towards the observer, a unit vector (3,)."""
        return np.cross(self.right, self.up)

    @property
    def axis(self) -> int | None:
        """Index of the axis x, y or z that is seen end-on; None if it is none of them."""
        along = np.abs(self.towards) > 1.0 - _ALONG
        return int(np.argmax(along)) if np.any(along) else None

    @property
    def name(self) -> str:
        """The direction of view, in words."""
        if self.axis is not None:
            if self.axis == 2 and self.towards[2] > 0.0:
                return "seen from above"
            sign = "\u2212" if self.towards[self.axis] > 0.0 else ""
            return f"seen along {sign}{'xyz'[self.axis]}"
        x, y, z = self.towards
        azimuth = f"{np.rad2deg(np.arctan2(y, x)):.0f}°".replace("-", "\u2212")
        above = f", {np.rad2deg(np.arcsin(z)):.0f}° above" if abs(z) > _ALONG else ""
        return f"seen from azimuth {azimuth}{above}"

    def plane(self, points: ArrayLike) -> Array:
        """Return points (..., 3) [m] in the plane, (..., 2) [m]."""
        return np.asarray(points) @ np.column_stack([self.right, self.up])

    def depth(self, points: ArrayLike) -> Array:
        """Return how much nearer to the observer points (..., 3) are than the origin, (...) [m]."""
        return np.asarray(np.asarray(points) @ self.towards)

    def turned(self, rotation: ArrayLike) -> View:
        """Return the view of the same things after a rotation (3, 3)."""
        turn = np.asarray(rotation)
        return View(turn @ self.right, turn @ self.up)

    def outlines(self, points: Array) -> Array:
        """Return outlines of convex hulls of points (..., k, 3), (..., 64, 2) [m],
        counter-clockwise.
        """
        flat = self.plane(points)
        extreme = np.argmax(flat @ DIRECTIONS.T, axis=-2)
        return np.take_along_axis(flat, extreme[..., None], axis=-2)


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
