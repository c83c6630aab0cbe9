"""Arms as shapes in a figure: bodies, or the outline of all of them."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.figures.arms.shapes import Shape, mixed
from geodesic_ocp.figures.arms.view import View
from geodesic_ocp.figures.styles import NEUTRAL, ROLES

TINT = 0.76  # share of white in the fill of what moves
_STILL = 0.86  # of what does not
_STEPS = 4  # of the pieces into which the sides of an outline are cut


def posture_shapes(
    postures: Postures,
    index: int,
    view: View,
    role: str = "observed",
    *,
    ink: float = 1.0,
    still: bool = True,
) -> list[Shape]:
    """The links of one of the configurations in a view.

    Args:
        postures: of a model.
        index: of the configuration.
        view: in which it is seen.
        role: whose colour it has; links that do not move are grey.
        ink: how dark it is, from 0 to 1.
        still: whether links that do not move are drawn.
    """
    links: dict[tuple[str, bool], list[Array]] = {}
    for part, points in zip(postures.parts, postures.points, strict=True):
        links.setdefault((part.link, part.moves), []).append(points[index if part.moves else 0])
    shapes = []
    for (_, moves), parts in links.items():
        if not (moves or still):
            continue
        colour = ROLES[role]["color"] if moves else NEUTRAL["color"]
        depths = view.depth(np.concatenate(parts))
        shapes.append(
            Shape(
                tuple(_distinct(view.outlines(part)) for part in parts),
                float(depths.min() + depths.max()) / 2.0,
                mixed(colour, 1.0 - ink * (1.0 - (TINT if moves else _STILL))),
                mixed(colour, 1.0 - ink),
            )
        )
    return shapes


def outline_of_all(shapes: list[Shape]) -> Array:
    """The outline of the union of shapes as a line (m, 2), broken by NaN."""
    outlines = [outline for shape in shapes for outline in shape.outlines]
    pieces = []
    for number, outline in enumerate(outlines):
        shares = np.linspace(0.0, 1.0, _STEPS, endpoint=False)[None, :, None]
        after = np.roll(outline, -1, axis=0)
        line = (outline[:, None] + shares * (after - outline)[:, None]).reshape(-1, 2)
        line = np.concatenate([line, line[:1]])
        low, high = outline.min(axis=0), outline.max(axis=0)
        others = [
            other
            for other in outlines[:number] + outlines[number + 1 :]
            if np.all(other.min(axis=0) < high) and np.all(other.max(axis=0) > low)
        ]
        covered = np.any([_inside(line, other) for other in others], axis=0) if others else False
        pieces += [np.where(np.reshape(covered, (-1, 1)), np.nan, line), np.full((1, 2), np.nan)]
    return np.concatenate(pieces) if pieces else np.zeros((0, 2))


def _inside(points: Array, outline: Array) -> Array:
    """Whether points (k, 2) are inside a convex outline (m, 2) that is counter-clockwise."""
    sides = np.roll(outline, -1, axis=0) - outline
    offsets = points[:, None] - outline
    return np.asarray(np.all(sides[:, 0] * offsets[..., 1] > sides[:, 1] * offsets[..., 0], axis=1))


def _distinct(outline: Array) -> Array:
    """An outline without repeated points."""
    return np.asarray(outline[np.any(outline != np.roll(outline, 1, axis=0), axis=1)])
