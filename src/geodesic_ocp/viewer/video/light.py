"""Light: how bright surfaces and the floor below them are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.viewer.video.camera import Camera
from geodesic_ocp.viewer.video.fragments import nearest_fragments

PAPER = np.array([1.0, 1.0, 1.0])
_FLOOR, _LINES = np.array([0.945, 0.952, 0.962]), np.array([0.83, 0.85, 0.88])
_CELL = 0.25  # [m], of the grid on the floor
# Directions to the lights, to the right, up, and towards the camera.
_KEY = np.array([-0.45, 0.70, 0.55]) / np.linalg.norm([-0.45, 0.70, 0.55])
_FILL = np.array([0.85, 0.10, 0.50]) / np.linalg.norm([0.85, 0.10, 0.50])
_HALF = (_KEY + np.array([0.0, 0.0, 1.0])) / np.sqrt(2.0 + 2.0 * _KEY[2])
_SHADOW, _COARSE, _BLUR = 0.15, 4, 3.0  # darkness; scale and radius [coarse pixel] of its edge


def lit(colours: Array, normals: Array, camera: Camera) -> Array:
    """Colours (p, 3) of surfaces with these colours and normals (p, 3), not of unit length.

    Lambert, Photometria, 1760, for two lights and a sky; Blinn, 1977, for the highlight.
    """
    seen = normals @ (camera.axes * np.array([[1.0], [1.0], [-1.0]])).T
    seen /= np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-12)
    bright = 0.42 + 0.12 * seen[:, 1]
    bright += 0.40 * np.maximum(seen @ _KEY, 0.0) + 0.16 * np.maximum(seen @ _FILL, 0.0)
    highlight = 0.14 * np.maximum(seen @ _HALF, 0.0) ** 24
    result: Array = np.clip(colours * bright[:, None] + highlight[:, None], 0.0, 1.0)
    return result


def floor_picture(camera: Camera, centre: Array, radius: float) -> Array:
    """A grid on the floor (height, width, 3) around its centre (3,) [m], fading to paper."""
    height, width = camera.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack(
        [(x - camera.middle[0]) / camera.focal, (camera.middle[1] - y) / camera.focal, x * 0 + 1],
        axis=-1,
    )
    rays = rays @ camera.axes
    falls = rays[..., 2] < -1e-3
    reach = np.where(falls, (centre[2] - camera.eye[2]) / np.where(falls, rays[..., 2], -1.0), 0.0)
    at = (camera.eye + reach[..., None] * rays)[..., :2]
    fade = np.exp(-((np.linalg.norm(at - centre[:2], axis=-1) / radius) ** 4)) * falls
    line = np.zeros(camera.shape)
    for axis in (0, 1):
        off = np.abs(at[..., axis] / _CELL - np.round(at[..., axis] / _CELL)) * _CELL
        slope = np.hypot(*np.gradient(at[..., axis]))  # [m] per pixel
        line = np.maximum(line, np.clip(1.3 - off / np.maximum(slope, 1e-9), 0.0, 1.0))
    floor = _FLOOR + line[..., None] * (_LINES - _FLOOR)
    picture: Array = PAPER + fade[..., None] * (floor - PAPER)
    return picture


def shadow(
    points: Array, triangles: NDArray[np.int64], floor: float, camera: Camera
) -> NDArray[np.float32]:
    """How bright (height, width) the floor is below triangles of points (v, 3), lit from above."""
    from PIL import Image, ImageFilter

    height, width = camera.shape
    flat = points.copy()
    flat[:, 2] = floor
    pixels, depths = camera.project(flat)
    small = (height // _COARSE, width // _COARSE)
    seen = nearest_fragments(pixels[triangles] / _COARSE, depths[triangles], small)
    mask = np.zeros(small[0] * small[1], dtype=np.uint8)
    mask[seen.pixels] = 255
    image = Image.fromarray(mask.reshape(small)).filter(ImageFilter.GaussianBlur(_BLUR))
    wide = np.asarray(image.resize((width, height), Image.Resampling.BILINEAR), dtype=np.float32)
    bright: NDArray[np.float32] = 1.0 - np.float32(_SHADOW / 255.0) * wide
    return bright
