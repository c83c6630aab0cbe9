"""Lines and dots of constant width in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.viewer.video.drawing.camera import Camera
from geodesic_ocp.viewer.video.drawing.fragments import Fragments, nearest_fragments

_STEP = 2.0  # [pixel], length of the pieces of a line


@dataclass(frozen=True, eq=False, repr=False)
class Stroke:
    """A line in the picture.

    Attributes:
        fragments: pixels of the line.
        fraction: of the length of the line [m] up to each of the pixels (p,), from 0 to 1.
    """

    fragments: Fragments
    fraction: Array


def stroke(points: Array, camera: Camera, width: float, dashes: tuple[float, ...] = ()) -> Stroke:
    """Draw a line through points (m, 3) [m], of this width [pixel].

    Args:
        points: of the line.
        camera: that sees it.
        width: of the line.
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
    """Lengths of a line up to each of its points (m, 3), relative to the whole."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = np.concatenate([[0.0], np.cumsum(lengths)])
    fractions: Array = total / max(float(total[-1]), 1e-12)
    return fractions


def dashes_of(style: dict[str, Any], scale: float) -> tuple[float, ...]:
    """Dashes of a matplotlib line style, in units of its width, scaled."""
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
