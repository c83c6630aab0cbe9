"""The camera of figures, pages and videos: from where things are seen, and how they project."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

ELEVATION = 16.0  # [deg] above the horizontal, from which scenes are seen at first
_STEEPEST = 89.9  # [deg], at which the vertical is still up in the picture
_DISTANCE = 4.5  # from the middle of a scene, relative to its radius
_MARGIN = 0.06  # free at each edge, relative to the smaller side of the picture
NEAR = 1e-2  # [m], least distance that is drawn
_ALONG = 1e-9
_RAISED = 0.17  # about 10 degrees
# Every 45 degrees, counterclockwise as seen from above.
_SIDES = (
    *("front", "front left", "left", "back left"),
    *("back", "back right", "right", "front right"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Camera:
    """A camera of a perspective projection or, where it is at infinity, of a parallel one."""

    axes: Array  # rows: to the right and up in the picture, and towards the observer, (3, 3)
    eye: Array | None = None  # where it is, (3,) [m]; None: at infinity
    focal: float = 1.0  # focal length [pixel]
    # the pixel (2,) that it looks at, from the upper left corner
    middle: Array = field(default_factory=lambda: np.zeros(2))
    shape: tuple[int, int] = (0, 0)  # height and width of the picture [pixel]

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
        """Return points (..., 3) [m] in the plane of the picture, (..., 2): to the right and up.

        In m by a parallel projection, as slopes of the lines of sight by a perspective one.
        """
        flat = np.asarray(points) @ self.axes[:2].T
        if self.eye is None:
            return np.asarray(flat)
        return np.asarray(
            (flat - self.axes[:2] @ self.eye) / np.maximum(-self.depth(points)[..., None], NEAR)
        )

    def depth(self, points: ArrayLike) -> Array:
        """Return how far points (..., 3) are towards the observer from the eye, (...) [m].

        It is negative in front of the eye; if the camera is at infinity, it is from the origin.
        """
        depths = np.asarray(points) @ self.towards
        return np.asarray(depths if self.eye is None else depths - self.eye @ self.towards)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return pixels (..., 2) and distances from the eye (...,) [m] of points (..., 3) [m]."""
        pixels = self.plane(points) * [self.focal, -self.focal] + self.middle
        return pixels, -self.depth(points)

    def turned(self, rotation: ArrayLike, about: ArrayLike = (0.0, 0.0, 0.0)) -> Camera:
        """Return the camera that sees the same of things turned by a rotation (3, 3) about a
        point (3,) [m].
        """
        turn = np.asarray(rotation)
        centre = np.asarray(about)
        eye = None if self.eye is None else centre + turn @ (self.eye - centre)
        return replace(self, axes=self.axes @ turn.T, eye=eye)

    def coarser(self, factor: int) -> Camera:
        """Return the same view with one pixel in place of factor^2."""
        height, width = self.shape
        shape = height // factor, width // factor
        return replace(self, focal=self.focal / factor, middle=self.middle / factor, shape=shape)


def first_view(azimuth: float, elevation: float | None = None) -> Camera:
    """Return the direction from which a `Playback` is seen at first, by a parallel projection.

    Args:
        azimuth: see `Playback` [deg]; at 0 the camera looks from +y, at 90 from +x.
        elevation: above the horizon [deg]; 16 by default.
    """
    above = ELEVATION if elevation is None else float(np.clip(elevation, -_STEEPEST, _STEEPEST))
    return Camera.around_z(90.0 - azimuth, above)


def cameras(
    contents: list[Array], direction: Camera, shape: tuple[int, int], *, around: bool = False
) -> list[Camera]:
    """Return cameras that see all points (m, 3) [m] of each scene, all at the same scale.

    They look from one direction; the lowest points are equally high in all. With `around`,
    everything is seen from any azimuth.
    """
    corners = [(points.min(axis=0), points.max(axis=0)) for points in contents]
    tallest = max(float((high - low)[2]) for low, high in corners)
    targets = [np.array([*(low + high)[:2] / 2.0, low[2] + tallest / 2.0]) for low, high in corners]
    pairs = list(zip(contents, targets, strict=True))
    radius = max(float(np.linalg.norm(points - at, axis=1).max()) for points, at in pairs)
    away = _DISTANCE * max(radius, NEAR) * direction.towards
    placed = [replace(direction, eye=target + away, shape=shape) for target in targets]
    seen = [_around(*pair) if around else pair[0] for pair in pairs]
    pixels = [camera.project(points)[0] for camera, points in zip(placed, seen, strict=True)]
    low = np.array([each.min(axis=0) for each in pixels])
    high = np.array([each.max(axis=0) for each in pixels])
    # Panes share the vertical range, so that their floors are on one level.
    low[:, 1] = low[:, 1].min()
    high[:, 1] = high[:, 1].max()
    free = np.array(shape[::-1]) - 2.0 * _MARGIN * min(shape)
    focal = float((free / np.maximum((high - low).max(axis=0), 1e-9)).min())
    middles = np.array(shape[::-1]) / 2.0 - focal * (low + high) / 2.0
    return [
        replace(camera, focal=focal, middle=middle)
        for camera, middle in zip(placed, middles, strict=True)
    ]


def _around(points: Array, target: Array) -> Array:
    """Return points on circles that the given ones describe about a vertical axis."""
    radius = np.linalg.norm((points - target)[:, :2], axis=1)
    angles = np.arange(0.0, 2.0 * np.pi, np.pi / 8.0)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    flat = target[:2] + radius[:, None, None] * ring
    heights = np.broadcast_to(points[:, 2, None, None], (*flat.shape[:2], 1))
    return np.concatenate([flat, heights], axis=2).reshape(-1, 3)
