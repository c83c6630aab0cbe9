"""Surfaces as they are seen in the picture: lit, and hidden by those before them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.viewer.video.drawing.camera import Camera
from geodesic_ocp.viewer.video.drawing.fragments import nearest_fragments
from geodesic_ocp.viewer.video.drawing.light import Single, covered, lit
from geodesic_ocp.viewer.video.drawing.part import Moment, Part, placed


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
    """What a camera sees of the outsides of parts."""
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
    """The opaque parts that do not move, above a floor at this height [m]."""
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
    """Triangles (m, 3) of all parts, as indices into the vertices of all."""
    sizes = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return np.concatenate(
        [part.triangles + first for part, first in zip(parts, sizes[:-1], strict=True)]
    )


def outline(pixels: NDArray[np.int64], shape: tuple[int, int], width: int) -> NDArray[np.bool_]:
    """Which of the pixels (p,) of a region are this near to its edge [pixel]."""
    region = np.zeros(shape, dtype=bool)
    region.reshape(-1)[pixels] = True
    inner = region.copy()
    inner[width:] &= region[:-width]
    inner[:-width] &= region[width:]
    inner[:, width:] &= region[:, :-width]
    inner[:, :-width] &= region[:, width:]
    edge: NDArray[np.bool_] = ~inner.reshape(-1)[pixels]
    return edge
