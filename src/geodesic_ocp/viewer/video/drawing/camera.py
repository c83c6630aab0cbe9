"""Camera: a perspective view of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array

_ELEVATION = 16.0  # [deg] above the horizontal
_STEEPEST = 89.9  # [deg], at which the vertical is still up in the picture
_DISTANCE = 4.5  # from the middle of a scene, relative to its radius
_MARGIN = 0.06  # free at each edge, relative to the smaller side of the picture
NEAR = 1e-2  # [m], least depth that is drawn


@dataclass(frozen=True, eq=False, repr=False)
class Camera:
    """A perspective camera; pixels are counted from the upper left corner.

    Attributes:
        eye: where it is, (3,) [m].
        axes: rows: to the right, up in the picture, and forward, (3, 3).
        focal: focal length [pixel].
        middle: the pixel (2,) that it looks at.
        shape: height and width of the picture [pixel].
    """

    eye: Array
    axes: Array
    focal: float
    middle: Array
    shape: tuple[int, int]

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) and depths (...,) [m] of points (..., 3) [m]."""
        seen = (points - self.eye) @ self.axes.T
        depth = seen[..., 2]
        scale = self.focal / np.maximum(depth, NEAR)
        pixels = np.stack([seen[..., 0] * scale, -seen[..., 1] * scale], axis=-1)
        return pixels + self.middle, depth

    def coarser(self, factor: int) -> Camera:
        """The same view with one pixel in place of factor^2."""
        height, width = self.shape
        shape = height // factor, width // factor
        return Camera(self.eye, self.axes, self.focal / factor, self.middle / factor, shape)


def cameras(
    contents: list[Array],
    azimuth: float,
    shape: tuple[int, int],
    *,
    around: bool = False,
    elevation: float | None = None,
) -> list[Camera]:
    """Cameras that see all points (m, 3) [m] of each scene, all at the same scale.

    They look from azimuth and elevation [deg], see `Playback`; the lowest points are equally high
    in all. With `around`, everything is seen from any azimuth.
    """
    corners = [(points.min(axis=0), points.max(axis=0)) for points in contents]
    tallest = max(float((high - low)[2]) for low, high in corners)
    targets = [np.array([*(low + high)[:2] / 2.0, low[2] + tallest / 2.0]) for low, high in corners]
    radius = max(
        float(np.linalg.norm(points - target, axis=1).max())
        for points, target in zip(contents, targets, strict=True)
    )
    distance = _DISTANCE * max(radius, NEAR)
    axes = _axes(azimuth, _ELEVATION if elevation is None else elevation)
    placed = [
        Camera(target - distance * axes[2], axes, 1.0, np.zeros(2), shape) for target in targets
    ]
    seen = [
        _around(points, target) if around else points
        for points, target in zip(contents, targets, strict=True)
    ]
    pixels = [camera.project(points)[0] for camera, points in zip(placed, seen, strict=True)]
    low = np.array([each.min(axis=0) for each in pixels])
    high = np.array([each.max(axis=0) for each in pixels])
    # Panes share the vertical range, so that their floors are on one level.
    low[:, 1], high[:, 1] = low[:, 1].min(), high[:, 1].max()
    free = np.array(shape[::-1]) - 2.0 * _MARGIN * min(shape)
    focal = float((free / np.maximum((high - low).max(axis=0), 1e-9)).min())
    middles = np.array(shape[::-1]) / 2.0 - focal * (low + high) / 2.0
    return [
        Camera(camera.eye, axes, focal, middle, shape)
        for camera, middle in zip(placed, middles, strict=True)
    ]


def turned(camera: Camera, target: Array, angle: float) -> Camera:
    """The camera moved around a vertical axis through the target (3,) by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    eye = target + turn @ (camera.eye - target)
    return Camera(eye, camera.axes @ turn.T, camera.focal, camera.middle, camera.shape)


def _axes(azimuth: float, elevation: float) -> Array:
    angle, tilt = np.deg2rad([azimuth, np.clip(elevation, -_STEEPEST, _STEEPEST)])
    across = np.cos(tilt)
    forward = -np.array([np.sin(angle) * across, np.cos(angle) * across, np.sin(tilt)])
    right = np.array([-np.cos(angle), np.sin(angle), 0.0])
    return np.array([right, np.cross(right, forward), forward])


def _around(points: Array, target: Array) -> Array:
    """Points on circles that the given ones describe about a vertical axis."""
    radius = np.linalg.norm((points - target)[:, :2], axis=1)
    angles = np.arange(0.0, 2.0 * np.pi, np.pi / 8.0)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    flat = target[:2] + radius[:, None, None] * ring
    heights = np.broadcast_to(points[:, 2, None, None], (*flat.shape[:2], 1))
    return np.concatenate([flat, heights], axis=2).reshape(-1, 3)
