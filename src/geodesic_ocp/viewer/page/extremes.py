"""Points that the view of a scene must hold."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.scene import Scene

_INSTANTS = 100  # at most, at which bodies are looked at


def extremes(scene: Scene) -> Array:
    """Points (k, 3) [m] of actors, trails, markers and finite obstacles, extreme in all directions.

    A view that holds them holds nearly everything at all times.
    """
    directions = _directions()
    points = [trail.points for trail in scene.trails]
    points += [solid.vertices for solid in scene.solids if not solid.unbounded]
    points += [cloud.positions.reshape(-1, 3) for cloud in scene.clouds]
    for actor in scene.actors:
        for mesh in actor.meshes:
            rotations, positions = actor.rotations[mesh.link], actor.positions[mesh.link]
            instants = np.linspace(0, len(positions) - 1, _INSTANTS).round().astype(int)
            instants = np.unique(instants)
            corners = _extreme(mesh.vertices, directions)
            turned = corners @ rotations[instants].transpose(0, 2, 1)
            points.append((turned + positions[instants, None]).reshape(-1, 3))
    every = np.concatenate(
        [_extreme(each[np.isfinite(each).all(axis=1)], directions) for each in points]
        or [np.zeros((0, 3))]
    )
    return _extreme(every, directions) if len(every) else np.array(scene.bounds())


def _extreme(points: Array, directions: Array) -> Array:
    """The points among (k, 3) that are farthest in one of the directions (m, 3)."""
    if not len(points):
        return points
    farthest: Array = points[np.unique(np.argmax(points @ directions.T, axis=0))]
    return farthest


def _directions() -> Array:
    azimuths = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    elevations = np.linspace(-np.pi / 2.0, np.pi / 2.0, 9)
    azimuth, elevation = (each.reshape(-1) for each in np.meshgrid(azimuths, elevations))
    level = np.cos(elevation)
    return np.column_stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)])
