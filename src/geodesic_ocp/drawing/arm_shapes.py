"""Arms and obstacles as outlines seen from one side, those behind drawn first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.camera import View
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES
from geodesic_ocp.model.distances import NearestPoints, nearest_points
from geodesic_ocp.model.look import Mesh
from geodesic_ocp.model.meshes import meshes, person_beside
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Colour = tuple[float, float, float]
_LAYER = 1e-3  # between the zorders of collections


@dataclass(frozen=True, eq=False, repr=False)
class Shape:
    """The outline of something in a figure.

    Attributes:
        outlines: convex polygons (m, 2) whose union it is.
        depth: how near to the observer it is.
        face: colour in it.
        edge: colour of its outline.
        width: width of its outline [pt].
        hatch: pattern in it.
    """

    outlines: tuple[Array, ...]
    depth: float
    face: Colour
    edge: Colour
    width: float = 0.7
    hatch: str = ""

    def __repr__(self) -> str:
        return f"Shape({len(self.outlines)} outlines at depth {self.depth:.3g})"

    def moved(self, shift: ArrayLike) -> Shape:
        """Return the shape elsewhere in the figure."""
        outlines = tuple(outline + np.asarray(shift) for outline in self.outlines)
        return replace(self, outlines=outlines)


def mixed(colour: str, white: float) -> Colour:
    """Return a colour with this share of white."""
    from matplotlib.colors import to_rgb

    red, green, blue = (white + (1.0 - white) * each for each in to_rgb(colour))
    return red, green, blue


def draw_shapes(axes: Axes, shapes: Iterable[Shape], zorder: float = 2.0) -> None:
    """Draw shapes, those farther from the observer first; the axes' limits stay as they are."""
    ordered = sorted(shapes, key=lambda shape: shape.depth)
    runs = groupby(ordered, key=lambda shape: shape.hatch)
    for layer, (_, run) in enumerate(runs):
        _draw_run(axes, list(run), zorder + _LAYER * layer)


def _draw_run(axes: Axes, shapes: Sequence[Shape], zorder: float) -> None:
    from matplotlib.collections import PolyCollection

    outlines: list[Array] = []
    faces, edges, widths = [], [], []
    for shape in shapes:
        if len(shape.outlines) == 1:
            outlines.append(shape.outlines[0])
            faces.append(shape.face)
            edges.append(shape.edge)
            widths.append(shape.width)
            continue
        # Lines of twice the width, and fills over their inner halves: the outline of the union.
        count = len(shape.outlines)
        outlines += [*shape.outlines, *shape.outlines]
        faces += [shape.face] * (2 * count)
        edges += [shape.edge] * count + [shape.face] * count
        widths += [2.0 * shape.width] * count + [0.0] * count
    axes.add_artist(
        PolyCollection(
            outlines,
            facecolors=faces,
            edgecolors=edges,
            linewidths=widths,
            hatch=shapes[0].hatch or None,
            joinstyle="round",
            zorder=zorder,
        )
    )


_DIRECTIONS = 400  # in which the extreme points of a part are kept
_DENSE = 0.08  # longest edge of the triangles that are divided, relative to the size of the link
_TESTED = 500  # points of the hulls whose volumes are compared
_SMALLER = 0.9  # volume of two halves, relative to the whole, for which a part is divided
_DEPTH = 3  # divisions of a part
_OVERLAP = 0.07  # of two halves, relative to their length


@dataclass(frozen=True, eq=False, repr=False)
class ConvexPart:
    """The extreme points of a convex part of a link.

    Attributes:
        link: name of the frame of the link.
        moves: whether any joint moves the link.
        points: (k, 3) [m], in the frame of the link if it moves, otherwise in the base frame.
    """

    link: str
    moves: bool
    points: Array = field(repr=False)

    def __repr__(self) -> str:
        return f"ConvexPart({self.link!r}, {len(self.points)} points)"


@lru_cache(maxsize=16)  # a figure draws the same model at many instants, and is drawn again
def convex_parts(model: Model) -> tuple[ConvexPart, ...]:
    """Return convex parts that together look like the links of a model, as given by `meshes`.

    Beside one or both arms of a person, they show the rest of the person, which does not move.
    A link that is not convex is divided in the middle of its longest principal axis, and its halves
    again, as long as the hulls of the halves are clearly smaller than that of the whole.
    """
    parts = []
    for mesh in _joined(meshes(model)):
        moves = model.moves(mesh.link)
        rotation, position = np.eye(3), np.zeros(3)
        if not moves:
            rotation, position = model.frame_pose(mesh.link, np.zeros(model.dof))
        parts += _placed(mesh, moves, rotation, position)
    beside = person_beside(model)
    if beside is not None:
        for mesh in _joined(beside[0]):
            parts += _placed(mesh, False, *beside[1:])
    return tuple(parts)


def _placed(mesh: Mesh, moves: bool, rotation: Array, position: Array) -> list[ConvexPart]:
    found = _divided(mesh)
    return [ConvexPart(mesh.link, moves, points @ rotation.T + position) for points in found]


def _joined(parts: tuple[Mesh, ...]) -> list[Mesh]:
    """Return one mesh for each link whose meshes lie within each other or touch, as those of a
    robot.
    """
    joined: dict[str, list[Mesh]] = {}
    for part in parts:
        joined.setdefault(part.link, []).append(part)
    result = []
    for link, several in joined.items():
        if len(several) <= _DEPTH:
            result += several
            continue
        starts = np.cumsum([0, *(len(part.vertices) for part in several)])
        triangles = [
            part.triangles + start for part, start in zip(several, starts[:-1], strict=True)
        ]
        vertices = np.concatenate([part.vertices for part in several])
        result.append(Mesh(link, vertices, np.concatenate(triangles), several[0].colour))
    return result


def _divided(mesh: Mesh) -> list[Array]:
    """Return extreme points of the convex parts of a mesh."""
    if not len(mesh.vertices):
        return []
    import trimesh  # takes longer to import than most figures take to draw

    whole = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    if abs(whole.volume) > _SMALLER * _volume(mesh.vertices):
        return [extreme_points(mesh.vertices)]
    longest = _DENSE * float(np.ptp(mesh.vertices, axis=0).max())
    divided: Any = trimesh.remesh.subdivide_to_size
    points, _ = divided(mesh.vertices, mesh.triangles, longest, max_iter=9)
    return [extreme_points(part) for part in _halves(np.asarray(points), _DEPTH)]


def _halves(points: Array, depth: int) -> list[Array]:
    if depth == 0 or len(points) < _TESTED // 10:
        return [points]
    centred = points - points.mean(axis=0)
    along = centred @ np.linalg.svd(centred[:: max(1, len(points) // _TESTED)])[2][0]
    middle, length = (along.max() + along.min()) / 2.0, np.ptp(along)
    sides = [
        points[along < middle + _OVERLAP * length],
        points[along > middle - _OVERLAP * length],
    ]
    if min(map(len, sides)) < 4 or sum(map(_volume, sides)) > _SMALLER * _volume(points):
        return [points]
    return [part for side in sides for part in _halves(side, depth - 1)]


def _volume(points: Array) -> float:
    """Return volume of the convex hull [m^3] of about as many points as are enough; 0 if it is
    flat.
    """
    some = points[:: max(1, len(points) // _TESTED)]
    try:
        return float(scipy.spatial.ConvexHull(some).volume)
    except scipy.spatial.QhullError:
        return 0.0


def extreme_points(points: Array) -> Array:
    """Return the points (k, 3) that are extreme in any of many directions evenly spread on a
    sphere.
    """
    turns = np.arange(_DIRECTIONS) * np.pi * (3.0 - np.sqrt(5.0))  # a Fibonacci lattice
    heights = 1.0 - (2.0 * np.arange(_DIRECTIONS) + 1.0) / _DIRECTIONS
    radii = np.sqrt(1.0 - heights**2)
    directions = np.array([radii * np.cos(turns), radii * np.sin(turns), heights])
    return np.asarray(points[np.unique(np.argmax(points @ directions, axis=0))])


@dataclass(frozen=True, eq=False, repr=False)
class Postures:
    """A model in k configurations.

    Attributes:
        model: the model.
        parts: parts of its links.
        points: points of each part in the model's base frame, (k, m, 3) [m], or (1, m, 3) if its
            link does not move.
        joints: origins of the frames of the moving links and of the hands, (k, j, 3) [m].
        hands: positions of the hands, (k, hands, 3) [m].
    """

    model: Model
    parts: tuple[ConvexPart, ...]
    points: tuple[Array, ...]
    joints: Array
    hands: Array

    def __repr__(self) -> str:
        return f"Postures({self.model.name!r}, {len(self.hands)} configurations)"

    def __len__(self) -> int:
        return len(self.hands)

    @classmethod
    def of(cls, model: Model, q: ArrayLike) -> Postures:
        """Return the shapes of a model in configurations q (k, n) [rad or m]."""
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        parts = convex_parts(model)
        poses = {part.link: model.frame_pose(part.link, rows) for part in parts if part.moves}
        points = tuple(
            part.points @ poses[part.link][0].transpose(0, 2, 1) + poses[part.link][1][:, None]
            if part.moves
            else part.points[None]
            for part in parts
        )
        hands = np.stack([model.frame_pose(hand, rows)[1] for hand in model.hands], axis=1)
        joints = np.concatenate([*(each[:, None] for _, each in poses.values()), hands], axis=1)
        return cls(model, parts, points, joints, hands)

    def still(self) -> list[Array]:
        """Return points (m, 3) of the parts that do not move."""
        pairs = zip(self.parts, self.points, strict=True)
        return [points[0] for part, points in pairs if not part.moves]

    def moving(self) -> list[Array]:
        """Return points (k, m, 3) of the parts that move."""
        pairs = zip(self.parts, self.points, strict=True)
        return [points for part, points in pairs if part.moves]


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
    """Return the links of one of the configurations in a view.

    Args:
        postures: postures of a model.
        index: index of the configuration.
        view: in which it is seen.
        role: role whose colour it has; links that do not move are grey.
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
    """Return the outline of the union of shapes as a line (m, 2), broken by NaN."""
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
    """Return whether points (k, 2) are inside a convex outline (m, 2) that is counter-clockwise."""
    sides = np.roll(outline, -1, axis=0) - outline
    offsets = points[:, None] - outline
    return np.asarray(np.all(sides[:, 0] * offsets[..., 1] > sides[:, 1] * offsets[..., 0], axis=1))


def _distinct(outline: Array) -> Array:
    """Return an outline without repeated points."""
    return np.asarray(outline[np.any(outline != np.roll(outline, 1, axis=0), axis=1)])


_NEAR = 0.01  # [m] beyond the least distance, within which bodies are about as near
_TINY = 1e-12  # [m]


def approach(
    model: Model, q: Array, obstacles: Sequence[Obstacle], links: Sequence[str] | None = None
) -> NearestPoints | None:
    """Return where the links' collision bodies come nearest to an obstacle at configurations q.

    Args:
        model: model with collision bodies.
        q: configurations (k, n) [rad or m].
        obstacles: obstacles that the links keep clear of.
        links: links whose bodies count; None: all that move.

    Returns:
        None if there are no obstacles, or no collision bodies.
    """
    try:
        found = nearest_points(model, q, obstacles, links=links) if obstacles else {}
    except ValueError:  # a model without collision bodies
        return None
    if not found:
        return None
    pairs = list(found.values())
    starts, ends = np.array([(each.starts, each.ends) for each in pairs]).transpose(1, 0, 2, 3)
    distances = np.array([each.distances for each in pairs])
    nearest = distances.argmin(axis=0), np.arange(len(q))
    return NearestPoints(starts[nearest], ends[nearest], distances[nearest])


def gap_directions(near: NearestPoints) -> Array:
    """Return unit vectors (m, 3) along the lines between the nearest points, where they are
    nearest.

    Of all configurations in which the bodies are about as near as they ever come.
    """
    lines, apart = near.ends - near.starts, near.distances
    narrow = (apart < apart.min() + _NEAR) & (np.abs(apart) > _TINY)
    return np.asarray(lines[narrow] / np.linalg.norm(lines[narrow], axis=1, keepdims=True))
