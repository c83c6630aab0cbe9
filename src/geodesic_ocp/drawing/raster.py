"""The outlines of many triangles, from the pixels that they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

_STRAIGHT = 0.25  # [pixel], within which points are on one line
# of the longer side of an outline, and of a pixel's sides
_PIXELS = 300
_SAMPLES = 3


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
