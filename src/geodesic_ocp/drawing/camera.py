"""The camera of figures, and that of pages at first: from where things are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

ELEVATION = 16.0  # [deg] above the horizontal, from which scenes are seen at first
_STEEPEST = 89.9  # [deg], at which the vertical is still up in the picture
_ALONG = 1e-9
_RAISED = 0.17  # about 10 degrees
# Every 45 degrees, counterclockwise as seen from above.
_SIDES = (
    *("front", "front left", "left", "back left"),
    *("back", "back right", "right", "front right"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Camera:
    """A camera at infinity, by a parallel projection."""

    axes: Array  # rows: to the right and up in the picture, and towards the observer, (3, 3)

    def __repr__(self) -> str:
        return f"Camera(towards={self.towards.tolist()})"

    @classmethod
    def of_axes(cls, columns: tuple[int, int]) -> Camera:
        """Return the view with these two of the axes x, y and z to the right and up."""
        right, up = np.eye(3)[list(columns)]
        return cls(np.array([right, up, np.cross(right, up)]))

    @classmethod
    def around_z(cls, azimuth: float, elevation: float) -> Camera:
        """Return the view of an observer at this azimuth from x to y and elevation [deg], z up."""
        around, above = np.deg2rad([azimuth, elevation])
        right = np.array([-np.sin(around), np.cos(around), 0.0])
        towards = [np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)]
        return cls(np.array([right, np.cross(towards, right), towards]).round(12))

    @property
    def towards(self) -> Array:
        """Direction towards the observer, a unit vector (3,)."""
        direction: Array = self.axes[2]
        return direction

    @property
    def axis(self) -> int | None:
        """Index of the axis x, y or z that is seen end-on; None if it is none of them."""
        along = np.abs(self.towards) > 1.0 - _ALONG
        return int(np.argmax(along)) if np.any(along) else None

    def side(self, forward: int) -> str:
        """Say from which side something that faces along an axis x (0) or y (1) is seen."""
        x, y, z = self.towards
        if self.axis == 2:
            return "seen from above" if z > 0.0 else "seen from below"
        turn = np.rad2deg(np.arctan2(y, x)) - 90.0 * forward
        side = _SIDES[round(turn / 45.0) % len(_SIDES)]
        return f"seen from the {side}{' and above' if z > _RAISED else ''}"

    def plane(self, points: ArrayLike) -> Array:
        """Return points (..., 3) [m] in the plane of the picture, (..., 2): to the right and up."""
        return np.asarray(np.asarray(points) @ self.axes[:2].T)

    def depth(self, points: ArrayLike) -> Array:
        """Return how far points (..., 3) are towards the observer from the origin, (...) [m]."""
        return np.asarray(np.asarray(points) @ self.towards)

    def turned(self, rotation: ArrayLike) -> Camera:
        """Return the camera that sees the same of things turned by a rotation (3, 3)."""
        return Camera(self.axes @ np.asarray(rotation).T)


def first_view(azimuth: float, elevation: float | None = None) -> Camera:
    """Return the direction from which a `Playback` is seen at first.

    Args:
        azimuth: see `Playback` [deg]; at 0 the camera looks from +y, at 90 from +x.
        elevation: above the horizon [deg]; 16 by default.
    """
    above = ELEVATION if elevation is None else float(np.clip(elevation, -_STEEPEST, _STEEPEST))
    return Camera.around_z(90.0 - azimuth, above)
