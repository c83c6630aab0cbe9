"""Triangles in pixels: which of them is the nearest in each, and the outlines of many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.camera import NEAR

_TRIANGLE_BITS = 24
_DEPTH_STEPS = 2.0**38
_STRAIGHT = 0.25  # [pixel], within which points are on one line
# of the longer side of an outline, and of a pixel's sides
_PIXELS = 300
_SAMPLES = 3


@dataclass(frozen=True, eq=False, repr=False)
class Fragments:
    """Pixels in which something is seen."""

    pixels: NDArray[np.int64]  # indices (p,) into the flattened picture
    triangles: NDArray[np.int64]  # which of the triangles is seen, (p,)
    weights: Array  # barycentric coordinates of the pixel's centre in its triangle, (p, 3)
    closeness: Array  # reciprocal of the depth, (p,) [1/m]


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
    corners = corners[kept]
    depths = depths[kept]
    x = corners[..., 0]
    y = corners[..., 1]
    after_x = np.roll(x, -1, axis=1)
    after_y = np.roll(y, -1, axis=1)
    # Edge i leads from corner i to the next one, and is opposite to corner i - 1.
    a = y - after_y
    b = after_x - x
    c = x * after_y - after_x * y
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
    at_x = pixels % width + 0.5
    at_y = pixels // width + 0.5
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


def outlines(corners: Array, triangles: NDArray[np.int64]) -> tuple[Array, ...]:
    """Return the outlines of the union of triangles in a plane, closed lines (m, 2).

    They are contours of the share of each pixel that is covered, and keep the triangles' extent.

    Args:
        corners: corners of triangles in the plane, (k, 2); all of them belong to some triangle.
        triangles: indices of corners, (n, 3).
    """
    from contourpy import contour_generator
    from matplotlib.path import Path
    from PIL import Image, ImageDraw

    low = corners.min(axis=0)
    high = corners.max(axis=0)
    unit = float((high - low).max()) / _PIXELS or 1.0
    width, height = (np.ceil((high - low) / unit).astype(int) + 2).tolist()
    picture = Image.new("L", (_SAMPLES * width, _SAMPLES * height))
    draw = ImageDraw.Draw(picture)
    fine = _SAMPLES * ((corners - low) / unit + 1.0) - 0.5
    for triangle in fine[triangles].reshape(-1, 6).tolist():
        draw.polygon(triangle, fill=255)
    shares = np.asarray(picture.reduce(_SAMPLES))
    found = []
    lines = contour_generator(z=shares).lines(127.5)
    for line in lines:
        path = Path(np.asarray(line))
        path.simplify_threshold = _STRAIGHT
        found.append(np.asarray(path.cleaned(simplify=True, curves=False).vertices)[:-1])
    if not found:  # thinner than a pixel
        return (np.array([low, [high[0], low[1]], high, [low[0], high[1]]]),)
    every = np.concatenate(found)
    first = every.min(axis=0)
    last = every.max(axis=0)
    scale = (high - low) / np.maximum(last - first, 1e-12)
    return tuple(low + (line - first) * scale for line in found)
