"""Rendering: surfaces and lines before a camera, light, floor and shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.look import Colour
from geodesic_ocp.drawing.raster import Fragments, nearest_fragments

Single = NDArray[np.float32]
Pixels = NDArray[np.uint8]

_CREASE = np.deg2rad(35.0)  # [rad]: edges between faces that differ by more stay sharp


@dataclass(frozen=True, eq=False, repr=False)
class Part:
    """A rigid or stretched surface that moves."""

    vertices: Array  # (v, 3) [m]
    normals: Array  # at the vertices (v, 3), outward
    triangles: NDArray[np.int64]  # (m, 3), indices of vertices, counter-clockwise seen from outside
    colour: Colour  # red, green and blue, from 0 to 1
    alpha: float  # how opaque it is, from 0 to 1
    matrices: Array  # matrices of its motion x -> M x + p, (k, 3, 3) or (1, 3, 3)
    positions: Array  # p, (k, 3) or (1, 3) [m]
    overlay: bool = False  # whether it is outlined, and others are seen through it
    coloured: bool = False  # whether it has the colour of a role

    @property
    def still(self) -> bool:
        """True if it stays where it is."""
        return len(self.matrices) == 1 and len(self.positions) == 1


def creased(
    vertices: Array, triangles: NDArray[np.int64]
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return vertices, normals and triangles of a surface that is smooth between its edges."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    smooth = trimesh.graph.smooth_shade(mesh, angle=_CREASE, facet_minarea=None)
    return (
        np.array(smooth.vertices, dtype=float),
        np.array(smooth.vertex_normals, dtype=float),
        np.array(smooth.faces, dtype=np.int64),
    )


def moment(time: Array, instant: float) -> float:
    """Return where an instant is among samples at times (k,): from 0 to k - 1, between two."""
    return float(np.interp(instant, time, np.arange(len(time))))


def at(samples: Array, when: float) -> Array:
    """Return the value of samples (k, ...) at a `moment`; a single one is constant."""
    before = min(int(when), len(samples) - 1)
    after = min(before + 1, len(samples) - 1)
    value: Array = samples[before] + (when - int(when)) * (samples[after] - samples[before])
    return value


@dataclass(frozen=True, eq=False, repr=False)
class Surfaces:
    """Parts in the scene at a moment, as one surface."""

    points: Array  # vertices (v, 3) [m]
    normals: Array  # at the vertices (v, 3), not of unit length
    triangles: NDArray[np.int64]  # indices of vertices (m, 3)
    colours: Single  # of the triangles (m, 3)
    coloured: NDArray[np.bool_]  # whether triangles have the colour of a role, (m,)


def placed(parts: Sequence[Part], when: float) -> Surfaces:
    """Return parts where they are at a moment."""
    points = [np.zeros((0, 3))]
    normals = [np.zeros((0, 3))]
    triangles = [np.zeros((0, 3), dtype=np.int64)]
    for part in parts:
        matrix = at(part.matrices, when)
        points.append(part.vertices @ matrix.T + at(part.positions, when))
        # The matrix of cofactors turns normals, also where the surface is flattened.
        cofactors = np.cross(matrix[:, [1, 2, 0]].T, matrix[:, [2, 0, 1]].T)
        normals.append(part.normals @ cofactors)
        triangles.append(part.triangles + sum(map(len, points[:-1])))
    counts = [len(part.triangles) for part in parts]
    return Surfaces(
        np.concatenate(points),
        np.concatenate(normals),
        np.concatenate(triangles),
        np.repeat(np.array([p.colour for p in parts], np.float32).reshape(-1, 3), counts, axis=0),
        np.repeat(np.array([part.coloured for part in parts], bool), counts),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Visible:
    """Pixels in which surfaces are seen."""

    pixels: NDArray[np.int64]  # indices (p,) into the flattened picture
    shades: Single  # their colours, (p, 3)
    closeness: Single  # reciprocal of the depth, (p,) [1/m]
    coloured: NDArray[np.bool_]  # where the surface has the colour of a role, (p,)


def visible(surfaces: Surfaces, camera: Camera) -> Visible:
    """Return what a camera sees of surfaces, whatever way round the corners of triangles are:
    files of robots are not consistent.
    """
    pixels, depths = camera.project(surfaces.points)
    triangles = surfaces.triangles
    seen = nearest_fragments(pixels[triangles], depths[triangles], camera.shape)
    corners = triangles[seen.triangles]
    weights = seen.weights.astype(np.float32)
    single = surfaces.normals.astype(np.float32)
    smooth = weights[:, :1] * single[corners[:, 0]]
    for corner in (1, 2):
        smooth += weights[:, corner, None] * single[corners[:, corner]]
    (ax, ay), (bx, by), (cx, cy) = pixels[corners].transpose(1, 2, 0)
    smooth[(bx - ax) * (cy - ay) > (by - ay) * (cx - ax)] *= -1.0  # y points down
    shades = lit(surfaces.colours[seen.triangles], smooth, camera)
    closeness = seen.closeness.astype(np.float32)
    return Visible(seen.pixels, shades, closeness, surfaces.coloured[seen.triangles])


PAPER = np.array([1.0, 1.0, 1.0])
# So that a white robot is seen against them.
_FLOOR = np.array([0.84, 0.86, 0.885])
_LINES = np.array([0.74, 0.765, 0.795])
_CELL = 0.25  # [m], of the grid on the floor
# Directions to the lights, to the right, up, and towards the camera.
_KEY = np.array([-0.45, 0.70, 0.55]) / np.linalg.norm([-0.45, 0.70, 0.55])
_FILL = np.array([0.85, 0.10, 0.50]) / np.linalg.norm([0.85, 0.10, 0.50])
_HALF = (_KEY + np.array([0.0, 0.0, 1.0])) / np.sqrt(2.0 + 2.0 * _KEY[2])
# darkness; scale and radius [coarse pixel] of its edge
_SHADOW = 0.15
_COARSE = 4
_BLUR = 3.0


def lit(colours: Single, normals: Single, camera: Camera) -> Single:
    """Return colours (p, 3) of surfaces with these colours and normals (p, 3), not of unit length.

    Lambert, Photometria, 1760, for two lights and a sky; Blinn, 1977, for the highlight.
    """
    # How far normals point up, towards both lights, and half-way between the first and the eye.
    towards = np.array([[0.0, 1.0, 0.0], _KEY, _FILL, _HALF]) @ camera.axes
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
    """Return a grid on the floor (height, width, 3) around its centre (3,) [m], fading to paper."""
    height, width = camera.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    across = (x - camera.middle[0]) / camera.focal
    up = (camera.middle[1] - y) / camera.focal
    rays = np.stack([across, up, -np.ones(camera.shape)], axis=-1) @ camera.axes
    falls = rays[..., 2] < -1e-3
    assert camera.eye is not None
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


def shade(surfaces: Surfaces, floor: float, camera: Camera) -> Pixels:
    """Return where surfaces shade a floor at this height [m]: 255, else 0; coarse."""
    pixels, depths = camera.project(surfaces.points * [1.0, 1.0, 0.0] + [0.0, 0.0, floor])
    corners = pixels[surfaces.triangles] / _COARSE
    far = depths[surfaces.triangles]
    mask: Pixels = np.zeros((camera.shape[0] // _COARSE, camera.shape[1] // _COARSE), np.uint8)
    mask.reshape(-1)[nearest_fragments(corners, far, mask.shape).pixels] = 255
    return mask


def darken(picture: Pixels, mask: Pixels) -> None:
    """Lay the shade, with a soft edge, on a picture of the floor (h, w, 3)."""
    from PIL import Image, ImageFilter

    rows = np.flatnonzero(mask.any(axis=1))
    if not len(rows):
        return
    reach = round(3.0 * _BLUR)
    first = max(int(rows[0]) - reach, 0)
    last = min(int(rows[-1]) + 1 + reach, len(mask))
    image = Image.fromarray(mask[first:last]).filter(ImageFilter.GaussianBlur(_BLUR))
    part = picture[_COARSE * first : _COARSE * last]
    wide = image.resize((part.shape[1], part.shape[0]), Image.Resampling.BILINEAR)
    bright = 1.0 - np.float32(_SHADOW / 255.0) * np.asarray(wide, dtype=np.float32)
    part[:] = part * bright[..., None] + np.float32(0.5)


_STEP = 2.0  # [pixel], length of the pieces of a line


@dataclass(frozen=True, eq=False, repr=False)
class Stroke:
    """A line in the picture.

    Attributes:
        fragments: pixels of the line.
        fraction: fraction of the length of the line [m] up to each of the pixels (p,), from 0 to 1.
    """

    fragments: Fragments
    fraction: Array


def stroke(points: Array, camera: Camera, width: float, dashes: tuple[float, ...] = ()) -> Stroke:
    """Draw a line through points (m, 3) [m], of this width [pixel].

    Args:
        points: points of the line.
        camera: camera that sees it.
        width: width of the line.
        dashes: lengths of dashes and gaps in turns [pixel]; a solid line if there are none.
    """
    pixels, depths = camera.project(points)
    done = length_fractions(points)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(pixels, axis=0), axis=1))])
    count = int(np.clip(along[-1] / _STEP, 1, 4000)) + 1
    at = np.linspace(0.0, along[-1], count)
    even = np.column_stack([np.interp(at, along, each) for each in (*pixels.T, depths, done)])
    x = even[:, :2]
    depth = even[:, 2]
    fraction = even[:, 3]
    tangent = np.gradient(x, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    aside = width / 2.0 * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    a = x + aside
    b = x - aside
    corners = np.stack([[a[:-1], b[:-1], a[1:]], [a[1:], b[:-1], b[1:]]])
    corners = corners.transpose(2, 0, 1, 3).reshape(-1, 3, 2)
    depth = np.repeat((depth[:-1] + depth[1:]) / 2.0, 2)
    piece = np.repeat((fraction[:-1] + fraction[1:]) / 2.0, 2)
    if dashes:
        phase = np.mod((at[:-1] + at[1:]) / 2.0, sum(dashes))
        drawn = np.searchsorted(np.cumsum(dashes), phase, side="right") % 2 == 0
        kept = np.repeat(drawn, 2)
        corners = corners[kept]
        depth = depth[kept]
        piece = piece[kept]
    seen = nearest_fragments(corners, np.repeat(depth[:, None], 3, axis=1), camera.shape)
    return Stroke(seen, piece[seen.triangles])


def length_fractions(points: Array) -> Array:
    """Return lengths of a line up to each of its points (m, 3), relative to the whole."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = np.concatenate([[0.0], np.cumsum(lengths)])
    fractions: Array = total / max(float(total[-1]), 1e-12)
    return fractions


def dashes_of(style: dict[str, Any], scale: float) -> tuple[float, ...]:
    """Return dashes of a matplotlib line style, in units of its width, scaled."""
    pattern = style.get("linestyle", "-")
    return () if isinstance(pattern, str) else tuple(scale * each for each in pattern[1])


def draw_disc(picture: Pixels, centre: Array, radius: float, colour: Array) -> None:
    """Blend a disc into a picture (height, width, 3)."""
    height, width = picture.shape[:2]
    low = np.maximum(np.floor(centre - radius - 1.0).astype(int), 0)
    high = np.minimum(np.ceil(centre + radius + 1.0).astype(int), [width, height])
    if (high <= low).any():
        return
    x = np.arange(low[0], high[0]) + 0.5
    y = np.arange(low[1], high[1]) + 0.5
    distance = np.hypot(x[None] - centre[0], y[:, None] - centre[1])
    share = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
    part = picture[low[1] : high[1], low[0] : high[0]]
    part[:] = (1.0 - share) * part + share * 255.0 * colour + 0.5


def edges(pixels: NDArray[np.int64], shape: tuple[int, int], width: int) -> NDArray[np.bool_]:
    """Return which of the pixels (p,) of a region are this near to its edge [pixel]."""
    from scipy.ndimage import binary_erosion

    region = np.zeros(shape, dtype=bool)
    region.reshape(-1)[pixels] = True
    inner = binary_erosion(region, iterations=width, border_value=1)
    edge: NDArray[np.bool_] = ~inner.reshape(-1)[pixels]
    return edge
