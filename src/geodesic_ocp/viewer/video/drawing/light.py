"""Light: how bright surfaces and the floor below them are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.viewer.video.drawing.camera import Camera
from geodesic_ocp.viewer.video.drawing.fragments import nearest_fragments

Single = NDArray[np.float32]
Pixels = NDArray[np.uint8]

PAPER = np.array([1.0, 1.0, 1.0])
_FLOOR, _LINES = np.array([0.945, 0.952, 0.962]), np.array([0.83, 0.85, 0.88])
_CELL = 0.25  # [m], of the grid on the floor
# Directions to the lights, to the right, up, and towards the camera.
_KEY = np.array([-0.45, 0.70, 0.55]) / np.linalg.norm([-0.45, 0.70, 0.55])
_FILL = np.array([0.85, 0.10, 0.50]) / np.linalg.norm([0.85, 0.10, 0.50])
_HALF = (_KEY + np.array([0.0, 0.0, 1.0])) / np.sqrt(2.0 + 2.0 * _KEY[2])
_SHADOW, _COARSE, _BLUR = 0.15, 4, 3.0  # darkness; scale and radius [coarse pixel] of its edge


def lit(colours: Single, normals: Single, camera: Camera) -> Single:
    """Colours (p, 3) of surfaces with these colours and normals (p, 3), not of unit length.

    Lambert, Photometria, 1760, for two lights and a sky; Blinn, 1977, for the highlight.
    """
    turn = camera.axes * np.array([[1.0], [1.0], [-1.0]])
    # How far normals point up, towards both lights, and half-way between the first and the eye.
    towards = np.array([[0.0, 1.0, 0.0], _KEY, _FILL, _HALF]) @ turn
    seen = towards.astype(np.float32) @ normals.T
    seen /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normals, normals)), np.float32(1e-12))
    up, key, fill, half = seen
    bright = 0.42 + 0.12 * up + 0.40 * np.maximum(key, 0.0) + 0.16 * np.maximum(fill, 0.0)
    square = np.maximum(half, 0.0) ** 2
    highlight = 0.14 * (square * square * square) ** 4
    shades: Single = colours * bright[:, None]
    shades += highlight[:, None]
    return np.clip(shades, 0.0, 1.0, out=shades)


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


def covered(
    points: Array, triangles: NDArray[np.int64], floor: float, camera: Camera
) -> NDArray[np.uint8]:
    """Where triangles of points (v, 3), lit from above, shade the floor: 255, else 0; coarse."""
    flat = points.copy()
    flat[:, 2] = floor
    pixels, depths = camera.project(flat)
    height, width = camera.shape
    small = (height // _COARSE, width // _COARSE)
    mask: Pixels = np.zeros(small, dtype=np.uint8)
    seen = nearest_fragments(pixels[triangles] / _COARSE, depths[triangles], small)
    mask.reshape(-1)[seen.pixels] = 255
    return mask


def darken(picture: Pixels, mask: NDArray[np.uint8]) -> None:
    """Lay the shade of `covered`, with a soft edge, on a picture of the floor (h, w, 3)."""
    from PIL import Image, ImageFilter

    rows = np.flatnonzero(mask.any(axis=1))
    if not len(rows):
        return
    reach = round(3.0 * _BLUR)
    first, last = max(int(rows[0]) - reach, 0), min(int(rows[-1]) + 1 + reach, len(mask))
    image = Image.fromarray(mask[first:last]).filter(ImageFilter.GaussianBlur(_BLUR))
    part = picture[_COARSE * first : _COARSE * last]
    wide = image.resize((part.shape[1], part.shape[0]), Image.Resampling.BILINEAR)
    bright = 1.0 - np.float32(_SHADOW / 255.0) * np.asarray(wide, dtype=np.float32)
    part[:] = part * bright[..., None] + np.float32(0.5)
