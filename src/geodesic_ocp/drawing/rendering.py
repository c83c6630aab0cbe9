"""Rendering: a perspective camera, a depth buffer, light, shadows and strokes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.part import Moment, Part, placed

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
        """Return pixels (..., 2) and depths (...,) [m] of points (..., 3) [m]."""
        seen = (points - self.eye) @ self.axes.T
        depth = seen[..., 2]
        scale = self.focal / np.maximum(depth, NEAR)
        pixels = np.stack([seen[..., 0] * scale, -seen[..., 1] * scale], axis=-1)
        return pixels + self.middle, depth

    def coarser(self, factor: int) -> Camera:
        """Return the same view with one pixel in place of factor^2."""
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
    """Return cameras that see all points (m, 3) [m] of each scene, all at the same scale.

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
    """Return the camera moved around a vertical axis through the target (3,) by an angle [rad]."""
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
    """Return points on circles that the given ones describe about a vertical axis."""
    radius = np.linalg.norm((points - target)[:, :2], axis=1)
    angles = np.arange(0.0, 2.0 * np.pi, np.pi / 8.0)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    flat = target[:2] + radius[:, None, None] * ring
    heights = np.broadcast_to(points[:, 2, None, None], (*flat.shape[:2], 1))
    return np.concatenate([flat, heights], axis=2).reshape(-1, 3)


_TRIANGLE_BITS = 24
_DEPTH_STEPS = 2.0**38


@dataclass(frozen=True, eq=False, repr=False)
class Fragments:
    """Pixels in which something is seen.

    Attributes:
        pixels: indices (p,) into the flattened picture.
        triangles: which of the triangles is seen, (p,).
        weights: barycentric coordinates of the pixel's centre in its triangle, (p, 3).
        closeness: reciprocal of the depth, (p,) [1/m].
    """

    pixels: NDArray[np.int64]
    triangles: NDArray[np.int64]
    weights: Array
    closeness: Array


def nearest_fragments(corners: Array, depths: Array, shape: tuple[int, int]) -> Fragments:
    """Return the nearest of the triangles in each pixel of a picture of this height and width.

    A pixel belongs to the triangles that contain its centre, see Pineda, A parallel algorithm for
    polygon rasterization, 1988, for the edge functions E(x, y) = a x + b y + c.

    Args:
        corners: corners of the triangles (n, 3, 2) [pixel]; those with negative area are seen too.
        depths: depths of the corners (n, 3) [m]; triangles that come too near are left out.
    """
    height, width = shape
    kept = np.flatnonzero(depths.min(axis=1, initial=np.inf) > NEAR)
    corners, depths = corners[kept], depths[kept]
    x, y = corners[..., 0], corners[..., 1]
    after_x, after_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    # Edge i leads from corner i to the next one, and is opposite to corner i - 1.
    a, b, c = y - after_y, after_x - x, x * after_y - after_x * y
    area = c.sum(axis=1)
    sign = np.sign(area)[:, None]
    first = np.clip(np.ceil(y.min(axis=1) - 0.5), 0, height).astype(np.int64)
    rows_each = np.clip(np.ceil(y.max(axis=1) - 0.5), 0, height).astype(np.int64) - first
    rows_each[area == 0.0] = 0
    triangle, row = _counted(first, rows_each)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -(b[triangle] * (row[:, None] + 0.5) + c[triangle]) / a[triangle]
    rising = (a * sign)[triangle]
    low = np.where(rising > 0.0, crossing, -np.inf).max(axis=1, initial=-np.inf)
    high = np.where(rising < 0.0, crossing, np.inf).min(axis=1, initial=np.inf)
    start = np.ceil(np.clip(low - 0.5, 0, width)).astype(np.int64)
    stop = np.ceil(np.clip(high - 0.5, 0, width)).astype(np.int64)
    # 1 / depth is affine in the picture, and so along a span.
    scale = (1.0 / np.where(area == 0.0, 1.0, area))[:, None]
    closeness = np.roll(1.0 / depths, 1, axis=1) * (scale * NEAR)
    across, down, base = ((each * closeness).sum(axis=1)[triangle] for each in (a, b, c))
    counts = np.maximum(stop - start, 0)
    before = start - (np.cumsum(counts) - counts)
    steps = np.arange(int(counts.sum()))
    at_start = base + down * (row + 0.5) + across * (before + 0.5)
    near = np.repeat(at_start, counts) + np.repeat(across, counts) * steps
    keys = (np.clip(near, 1e-9, 1.0) * _DEPTH_STEPS).astype(np.int64) << _TRIANGLE_BITS
    keys |= np.repeat(triangle, counts)
    places = np.repeat(row * width + before, counts) + steps
    buffer = np.zeros(height * width, dtype=np.int64)
    np.maximum.at(buffer, places, keys)
    pixels = np.flatnonzero(buffer)
    keys = buffer[pixels]
    seen = keys & ((1 << _TRIANGLE_BITS) - 1)
    at_x, at_y = pixels % width + 0.5, pixels // width + 0.5
    edges = a[seen] * at_x[:, None] + b[seen] * at_y[:, None] + c[seen]
    weights = np.roll(edges * scale[seen], -1, axis=1)
    closeness = (keys >> _TRIANGLE_BITS) / _DEPTH_STEPS / NEAR
    return Fragments(pixels, kept[seen], weights, closeness)


def _counted(
    first: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return owner and value of first[i], first[i] + 1, ... (counts[i] values) of all i."""
    owner = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return owner, np.arange(len(owner)) + np.repeat(first - ends + counts, counts)


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
    """Return colours (p, 3) of surfaces with these colours and normals (p, 3), not of unit length.

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
    """Return a grid on the floor (height, width, 3) around its centre (3,) [m], fading to paper."""
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
    """Return where triangles of points (v, 3) shade the floor: 255, else 0; coarse."""
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
    x, depth, fraction = even[:, :2], even[:, 2], even[:, 3]
    tangent = np.gradient(x, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    aside = width / 2.0 * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    a, b = x + aside, x - aside
    corners = np.stack([[a[:-1], b[:-1], a[1:]], [a[1:], b[:-1], b[1:]]])
    corners = corners.transpose(2, 0, 1, 3).reshape(-1, 3, 2)
    depth = np.repeat((depth[:-1] + depth[1:]) / 2.0, 2)
    piece = np.repeat((fraction[:-1] + fraction[1:]) / 2.0, 2)
    if dashes:
        phase = np.mod((at[:-1] + at[1:]) / 2.0, sum(dashes))
        drawn = np.searchsorted(np.cumsum(dashes), phase, side="right") % 2 == 0
        kept = np.repeat(drawn, 2)
        corners, depth, piece = corners[kept], depth[kept], piece[kept]
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


def draw_disc(
    picture: NDArray[np.uint8], centre: Array, radius: float, colour: Array, alpha: float
) -> None:
    """Blend a disc into a picture (height, width, 3)."""
    height, width = picture.shape[:2]
    low = np.maximum(np.floor(centre - radius - 1.0).astype(int), 0)
    high = np.minimum(np.ceil(centre + radius + 1.0).astype(int), [width, height])
    if (high <= low).any():
        return
    x, y = np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5
    distance = np.hypot(x[None] - centre[0], y[:, None] - centre[1])
    share = alpha * np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
    part = picture[low[1] : high[1], low[0] : high[0]]
    part[:] = (1.0 - share) * part + share * 255.0 * colour + 0.5


@dataclass(frozen=True, eq=False, repr=False)
class Visible:
    """Pixels in which surfaces are seen.

    Attributes:
        pixels: indices (p,) into the flattened picture.
        shades: their colours, (p, 3).
        closeness: reciprocal of the depth, (p,) [1/m].
        coloured: where the surface has the colour of a role, (p,).
    """

    pixels: NDArray[np.int64]
    shades: Single
    closeness: Single
    coloured: NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class Still:
    """Opaque surfaces that do not move: what is seen of them, and where they shade the floor."""

    seen: Visible
    shade: NDArray[np.uint8]


def visible(parts: tuple[Part, ...], when: Moment, camera: Camera) -> Visible:
    """Return the outsides of parts that a camera sees."""
    points, normals = placed(parts, when)
    triangles = joined(parts)
    counts = [len(part.triangles) for part in parts]
    colours = np.repeat(np.array([part.colour for part in parts], dtype=np.float32), counts, axis=0)
    coloured = np.repeat([part.coloured for part in parts], counts)
    pixels, depths = camera.project(points)
    (ax, ay), (bx, by), (cx, cy) = pixels[triangles].transpose(1, 2, 0)
    front = (bx - ax) * (cy - ay) < (by - ay) * (cx - ax)  # y points down
    triangles, colours, coloured = triangles[front], colours[front], coloured[front]
    seen = nearest_fragments(pixels[triangles], depths[triangles], camera.shape)
    corners, weights = triangles[seen.triangles], seen.weights.astype(np.float32)
    single = normals.astype(np.float32)
    smooth = weights[:, :1] * single[corners[:, 0]]
    for corner in (1, 2):
        smooth += weights[:, corner, None] * single[corners[:, corner]]
    shades = lit(colours[seen.triangles], smooth, camera)
    closeness = seen.closeness.astype(np.float32)
    return Visible(seen.pixels, shades, closeness, coloured[seen.triangles])


def still_surfaces(parts: tuple[Part, ...], floor: float, camera: Camera) -> Still:
    """Return the opaque parts that do not move, above a floor at this height [m]."""
    chosen = tuple(part for part in parts if part.still and part.alpha == 1.0)
    start = Moment(0, 0, 0.0)
    if not chosen:
        nothing = np.zeros((0, 3), dtype=np.float32)
        seen = Visible(np.zeros(0, dtype=np.int64), nothing, nothing[:, 0], np.zeros(0, dtype=bool))
        none = np.zeros((1, 3)), np.zeros((0, 3), dtype=np.int64)
        return Still(seen, covered(*none, floor, camera))
    points = placed(chosen, start)[0]
    return Still(visible(chosen, start, camera), covered(points, joined(chosen), floor, camera))


def joined(parts: tuple[Part, ...]) -> NDArray[np.int64]:
    """Return triangles (m, 3) of all parts, as indices into the vertices of all."""
    sizes = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return np.concatenate(
        [part.triangles + first for part, first in zip(parts, sizes[:-1], strict=True)]
    )


def outline(pixels: NDArray[np.int64], shape: tuple[int, int], width: int) -> NDArray[np.bool_]:
    """Return which of the pixels (p,) of a region are this near to its edge [pixel]."""
    region = np.zeros(shape, dtype=bool)
    region.reshape(-1)[pixels] = True
    inner = region.copy()
    inner[width:] &= region[:-width]
    inner[:-width] &= region[width:]
    inner[:, width:] &= region[:, :-width]
    inner[:, :-width] &= region[:, width:]
    edge: NDArray[np.bool_] = ~inner.reshape(-1)[pixels]
    return edge
