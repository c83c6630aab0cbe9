"""A scene that is carried by a frame, such as an arm by the thorax of a person who walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.actor import Actor
from geodesic_ocp.scenes.markings import Trail
from geodesic_ocp.scenes.scene import Scene

_PARALLEL = 1e-9


def carried(scene: Scene, rotations: Array, positions: Array) -> Scene:
    """The actors, paths, frames and ellipsoids of a scene in a frame that is at these poses.

    Args:
        scene: in axes of the frame, whose paths have a point for each sample.
        rotations: of the frame, (k, 3, 3) or (1, 3, 3).
        positions: of its origin, (k, 3) or (1, 3) [m].
    """

    def moved(points: Array) -> Array:
        return np.asarray((rotations @ points[..., None])[..., 0] + positions)

    def actor(each: Actor) -> Actor:
        return replace(
            each,
            rotations={link: rotations @ turned for link, turned in each.rotations.items()},
            positions={link: moved(points) for link, points in each.positions.items()},
        )

    def trail(each: Trail) -> Trail:
        dot = None if each.dot is None else moved(each.dot)
        return replace(each, points=moved(each.points), dot=dot)

    return replace(
        scene,
        actors=tuple(actor(each) for each in scene.actors),
        trails=tuple(trail(each) for each in scene.trails),
        frames=tuple(
            replace(each, rotations=rotations @ each.rotations, positions=moved(each.positions))
            for each in scene.frames
        ),
        ellipsoids=tuple(
            replace(each, centres=moved(each.centres), axes=rotations @ each.axes)
            for each in scene.ellipsoids
        ),
    )


def upright(scene: Scene, up: Array) -> Scene:
    """The scene, turned by the smallest angle that makes the direction `up` (3,) that of z."""
    z = np.array([0.0, 0.0, 1.0])
    cosine = float(up @ z)
    if cosine > 1.0 - _PARALLEL:
        return scene
    if cosine < _PARALLEL - 1.0:
        turn = np.diag([1.0, -1.0, -1.0])
    else:  # Rodrigues' formula with the axis up x z
        x, y, z_ = np.cross(up, z)
        skew = np.array([[0.0, -z_, y], [z_, 0.0, -x], [-y, x, 0.0]])
        turn = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return carried(scene, turn[None], np.zeros((1, 3)))
