"""What there is to draw of a scene: its surfaces, and the space that they take."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.styles import ROLES, SURROUNDINGS
from geodesic_ocp.model.look import Colour, Indices
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.viewer.video.drawing.part import Part, smooth_surface

_MOST = 12000  # triangles of a scene in a pane of this many pixels
_PIXELS = 300_000
_OVERLAY, _UNBOUNDED, _ELLIPSOID = 0.40, 0.30, 0.35  # opacities
_TINT = 0.12  # of white in the colours of roles, so that dark ones keep their shading
_INSTANTS = 24  # at which the space that is taken is looked at


def is_shown(layer: str, layers: Collection[str]) -> bool:
    """Whether a layer is among those that are asked for; the nameless one always is."""
    return not layer or layer in layers


def scene_parts(scene: Scene, layers: Collection[str], pixels: float = _PIXELS) -> tuple[Part, ...]:
    """Surfaces of the actors, obstacles and ellipsoids of a scene.

    They have about 12000 triangles in a large pane, fewer in one of fewer pixels.
    """
    actors = [actor for actor in scene.actors if is_shown(actor.layer, layers)]
    total = sum(len(mesh.triangles) for actor in actors for mesh in actor.meshes)
    most = _MOST * float(np.clip(np.sqrt(pixels / _PIXELS), 0.3, 1.0))
    share = min(1.0, most / max(total, 1))
    parts = []
    for actor in actors:
        for mesh in actor.meshes:
            if not len(mesh.triangles):
                continue
            surface = smooth_surface(
                mesh.vertices, mesh.triangles, int(share * len(mesh.triangles))
            )
            colour = mesh.colour if actor.role is None else role_tint(actor.role)
            alpha = _OVERLAY if actor.translucent else 1.0
            motion = actor.rotations[mesh.link], actor.positions[mesh.link]
            coloured = actor.role is not None
            parts.append(Part(*surface, colour, alpha, *motion, actor.translucent, coloured))
    still = np.eye(3)[None], np.zeros((1, 3))
    for solid in scene.solids:
        if is_shown(solid.layer, layers) and len(solid.triangles):
            surface = smooth_surface(solid.vertices, np.asarray(solid.triangles), _MOST)
            alpha = _UNBOUNDED if solid.unbounded else 1.0
            parts.append(Part(*surface, _colour("obstacle"), alpha, *still))
    for ellipsoid in scene.ellipsoids:
        if is_shown(ellipsoid.layer, layers):
            # A mirrored ellipsoid is the same one, with its triangles outside in.
            mirrored = np.linalg.det(ellipsoid.axes) < 0.0
            axes = np.where(mirrored[:, None, None], -ellipsoid.axes, ellipsoid.axes)
            parts.append(Part(*_ball(), _colour("ellipsoid"), _ELLIPSOID, axes, ellipsoid.centres))
    return tuple(parts)


def role_tint(role: str) -> Colour:
    """The colour of a role, slightly lighter than in plots."""
    from matplotlib.colors import to_rgb

    red, green, blue = (1.0 - _TINT) * np.array(to_rgb(ROLES[role]["color"])) + _TINT
    return float(red), float(green), float(blue)


def scene_points(scene: Scene, parts: tuple[Part, ...], layers: Collection[str]) -> Array:
    """Points (m, 3) [m] that span the space in which the scene takes place."""
    points = [trail.points for trail in scene.trails if is_shown(trail.layer, layers)]
    points += [
        cloud.positions.reshape(-1, 3) for cloud in scene.clouds if is_shown(cloud.layer, layers)
    ]
    for part in parts:
        if part.alpha == _UNBOUNDED:
            continue
        ends = _extremes(part.vertices)
        chosen = np.unique(np.linspace(0, len(part.positions) - 1, _INSTANTS).astype(int))
        matrices = part.matrices[chosen if len(part.matrices) > 1 else [0]]
        moved = ends @ matrices.transpose(0, 2, 1) + part.positions[chosen][:, None]
        points.append(moved.reshape(-1, 3))
    every = np.concatenate([np.zeros((0, 3)), *points])
    every = every[np.isfinite(every).all(axis=1)]
    return every if len(every) else np.array(scene.bounds())


def _extremes(points: Array) -> Array:
    """The points (k, 3) that are farthest in each of 26 directions."""
    steps = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1)
    chosen: Array = points[np.unique((points @ steps).argmax(axis=0))]
    return chosen


def _ball() -> tuple[Array, Array, Indices]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.array(ball.vertices, dtype=float)
    return points, points, np.array(ball.faces)


def _colour(name: str) -> Colour:
    from matplotlib.colors import to_rgb

    return to_rgb(SURROUNDINGS[name])
