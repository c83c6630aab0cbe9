"""Arms and obstacles as outlines seen from one side, those behind drawn first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.drawing.actors import Actor, extreme_points, model_actor, rest_of_person
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.look import Colour, Indices
from geodesic_ocp.drawing.raster import outlines
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, mixed
from geodesic_ocp.model.anthropometry import person_arms
from geodesic_ocp.model.distances import NearestPoints, nearest_points
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import HalfSpace, Obstacle, core_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LAYER = 1e-3  # between the zorders of collections
_TURNS = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
# Directions in the plane (64, 2) in which the extreme points make an outline.
DIRECTIONS = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])


@dataclass(frozen=True, eq=False, repr=False)
class Shape(ShortRepr):
    """The outline of something in a figure."""

    outlines: tuple[Array, ...]  # closed lines (m, 2) around it
    depth: float  # how near to the observer it is
    face: Colour
    edge: Colour  # colour of its outline
    width: float = 0.7  # width of its outline [pt]
    hatch: str = ""  # pattern in it

    _shown = ("outlines", "depth")

    def moved(self, shift: ArrayLike) -> Shape:
        """Return the shape elsewhere in the figure."""
        return replace(self, outlines=tuple(each + np.asarray(shift) for each in self.outlines))


def draw_shapes(axes: Axes, shapes: Iterable[Shape], zorder: float = 2.0) -> None:
    """Draw shapes, those farther from the observer first; the axes' limits stay as they are."""
    from matplotlib.collections import PolyCollection

    ordered = sorted(shapes, key=lambda shape: shape.depth)
    for layer, (hatch, run) in enumerate(groupby(ordered, key=lambda shape: shape.hatch)):
        lines = [(line, shape) for shape in run for line in shape.outlines]
        drawn = PolyCollection(
            [line for line, _ in lines],
            facecolors=[shape.face for _, shape in lines],
            edgecolors=[shape.edge for _, shape in lines],
            linewidths=[shape.width for _, shape in lines],
            hatch=hatch or None,
            joinstyle="round",
            zorder=zorder + _LAYER * layer,
        )
        axes.add_artist(drawn)


@dataclass(frozen=True, eq=False, repr=False)
class Postures(ShortRepr):
    """A model in k configurations, with the rest of the person if it is a person's."""

    model: Model
    actors: tuple[Actor, ...]  # the model, and the rest of the person
    joints: Array  # origins of the frames of the moving links and of the hands, (k, j, 3) [m]
    hands: Array  # positions of the hands, (k, hands, 3) [m]

    _shown = ("model", "hands")

    def __len__(self) -> int:
        return len(self.hands)

    @classmethod
    def of(cls, model: Model, q: ArrayLike) -> Postures:
        """Return the shapes of a model in configurations q (k, n) [rad or m]."""
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        actor = model_actor(model, rows)
        hands = np.stack([model.frame_pose(hand, rows)[1] for hand in model.hands], axis=1)
        joints = [each[:, None] for link, each in actor.positions.items() if model.moves(link)]
        actors = (actor, *rest_of_person(model))
        return cls(model, actors, np.concatenate([*joints, hands], axis=1), hands)

    @property
    def forward(self) -> int:
        """The axis along which the model faces: y of a person, x of a robot (REP 103 of ROS)."""
        return 1 if person_arms(self.model) else 0

    @cached_property
    def links(self) -> tuple[tuple[Actor, str, bool, Array, Indices], ...]:
        """Actor, name, whether it moves, vertices and triangles of each link."""
        return tuple(
            (actor, link, actor is self.actors[0] and self.model.moves(link), vertices, triangles)
            for actor in self.actors
            for link, vertices, triangles in actor.links()
        )

    @cached_property
    def still(self) -> list[Array]:
        """Extreme points (m, 3) of the links that do not move."""
        links = (each for each in self.links if not each[2])
        return [actor.placed(name, extreme_points(at))[0] for actor, name, _, at, _ in links]

    @cached_property
    def moving(self) -> list[Array]:
        """Extreme points (k, m, 3) of the links that move."""
        links = (each for each in self.links if each[2])
        return [actor.placed(name, extreme_points(at)) for actor, name, _, at, _ in links]


TINT = 0.76  # share of white in the fill of what moves
_STILL = 0.86  # of what does not


def posture_shapes(
    postures: Postures,
    index: int,
    view: Camera,
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
    shapes = []
    for number, (_, _, moves, _, _) in enumerate(postures.links):
        if moves or still:
            colour = ROLES[role]["color"] if moves else NEUTRAL["color"]
            face = mixed(colour, 1.0 - ink * (1.0 - (TINT if moves else _STILL)))
            seen = _link_outlines(postures, number, index if moves else 0, view)
            shapes.append(Shape(*seen, face, mixed(colour, 1.0 - ink)))
    return shapes


@lru_cache(maxsize=256)  # what does not move is drawn at many instants
def _link_outlines(
    postures: Postures, number: int, index: int, view: Camera
) -> tuple[tuple[Array, ...], float]:
    """Return outlines of a link, and its depth."""
    actor, link, _, vertices, triangles = postures.links[number]
    (points,) = actor.placed(link, vertices, np.array([index]))
    depths = view.depth(points)
    return outlines(view.plane(points), triangles), float(depths.min() + depths.max()) / 2.0


def outline_of_all(postures: Postures, index: int, view: Camera) -> Array:
    """Return the outline of the union of all links that move as a line (m, 2), broken by NaN."""
    links = [each for each in postures.links if each[2]]
    at = np.array([index])
    points = [actor.placed(link, vertices, at)[0] for actor, link, _, vertices, _ in links]
    starts = np.cumsum([0, *map(len, points)])
    triangles = [each[4] + start for each, start in zip(links, starts, strict=False)]
    if not links:
        return np.zeros((0, 2))
    found = outlines(view.plane(np.concatenate(points)), np.concatenate(triangles))
    gap = np.full((1, 2), np.nan)
    return np.concatenate([np.concatenate([line, line[:1], gap]) for line in found])


_ROUNDING = 1e-9
_FACE: Colour = (0.85, 0.82, 0.77)
_EDGE: Colour = (0.42, 0.38, 0.34)
_HATCH = "////"
_FAR = -1e9  # [m]: behind everything else


def draw_obstacle(
    axes: Axes, obstacle: Obstacle, columns: tuple[int, int], label: str | None = None
) -> None:
    """Draw the outline of a stationary obstacle, projected along the third axis.

    A half-space whose boundary is not seen edge-on is omitted: it would fill the figure.

    >>> from matplotlib.figure import Figure
    >>> axes = Figure().add_subplot()
    >>> draw_obstacle(axes, go.Ball(centre=(0.0, 0.0, 0.0), radius=0.1), (0, 1))

    Args:
        axes: to draw in.
        obstacle: ball, capsule, box or half-space.
        columns: indices of the axes of space to the right and up in the figure.
        label: for the legend; None: none.
    """
    from matplotlib.patches import Polygon

    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    far = 10.0 * max(float(np.abs([low, high]).max()), 1.0)
    shape = obstacle_shape(obstacle, Camera.of_axes(columns), (np.full(2, -far), np.full(2, far)))
    if shape is None:
        return
    style: dict[str, Any] = {"facecolor": _FACE, "edgecolor": _EDGE, "linewidth": 0.9}
    style |= {"hatch": _HATCH, "label": label, "zorder": 0}
    if isinstance(obstacle, HalfSpace):
        # Added as an artist, it leaves the axes' limits alone.
        axes.add_artist(Polygon(shape.outlines[0], **style))
    else:
        axes.fill(*shape.outlines[0].T, **style)


def obstacle_shape(
    obstacle: Obstacle, view: Camera, box: tuple[Array, Array] | None = None
) -> Shape | None:
    """Return the outline of a stationary obstacle in a view; None if it is not drawn.

    Args:
        obstacle: those that move with a link are not drawn.
        view: in which it is seen.
        box: corners (2,) [m] of the part of the plane that is filled by a half-space seen edge-on.
    """
    if isinstance(obstacle, HalfSpace):
        normal = view.plane(obstacle.normal)
        if box is None or np.linalg.norm(normal) < 1.0 - _ROUNDING:
            return None
        outline = _behind(*box, view.plane(obstacle.point), normal)
        return None if len(outline) < 3 else Shape((outline,), _FAR, _FACE, _EDGE, 0.0, _HATCH)
    if obstacle.link is not None:
        return None
    points, radius = core_points(obstacle)
    farthest = np.argmax(DIRECTIONS @ view.plane(points).T, axis=1)
    outline = view.plane(points)[farthest] + radius * DIRECTIONS
    return Shape((outline,), float(view.depth(points).mean()), _FACE, _EDGE, 0.9, _HATCH)


def obstacle_shapes(
    obstacles: Iterable[Obstacle], view: Camera, box: tuple[Array, Array] | None = None
) -> list[Shape]:
    """Return the outlines of the obstacles that are drawn, see `obstacle_shape`."""
    found = (obstacle_shape(each, view, box) for each in obstacles)
    return [shape for shape in found if shape is not None]


def _behind(low: Array, high: Array, point: Array, normal: Array) -> Array:
    """Return the corners (m, 2) of the part of a box that is behind a line."""
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    heights = (corners - point) @ normal
    found = []
    for k in range(4):
        here = heights[k]
        after = heights[(k + 1) % 4]
        if here <= 0.0:
            found.append(corners[k])
        if here * after < 0.0:
            share = here / (here - after)
            found.append(corners[k] + share * (corners[(k + 1) % 4] - corners[k]))
    return np.array(found)


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
    lines = near.ends - near.starts
    apart = near.distances
    narrow = (apart < apart.min() + _NEAR) & (np.abs(apart) > _TINY)
    return np.asarray(lines[narrow] / np.linalg.norm(lines[narrow], axis=1, keepdims=True))
