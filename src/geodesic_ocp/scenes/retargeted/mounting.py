"""Where the base of a robot is in a scene, so that its shoulder is the person's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.model.human import DEFAULT_HEIGHT, stature
from geodesic_ocp.retargeting.arm_result import RetargetedArm


@dataclass(frozen=True, eq=False, repr=False)
class BasePose:
    """Where the base of a model is in a scene.

    Attributes:
        rotation: of the base (3, 3).
        position: of its origin (3,) [m].
    """

    rotation: Array
    position: Array

    def __repr__(self) -> str:
        return f"BasePose(at {self.position.round(3).tolist()} m)"

    def points(self, positions: Array) -> Array:
        """Points (..., 3) [m] of the base frame, in the scene."""
        return np.asarray(positions @ self.rotation.T + self.position)

    def rotations(self, rotations: Array) -> Array:
        """Rotations (..., 3, 3) of the base frame, in the scene."""
        return np.asarray(self.rotation @ rotations)


def shoulder(arm: RetargetedArm, count: int) -> Array:
    """The person's shoulder in the scene (3,) [m]: the origin, or to one side of it if of two."""
    model = arm.analysis.model
    if count == 1 or not {"left", "right"} & set(model.name.split()):
        return np.zeros(3)
    height = stature(model) or DEFAULT_HEIGHT
    side = -1.0 if "left" in model.name else 1.0
    return np.array([side * trunk().half_width * height, 0.0, 0.0])


def share_a_body(arms: Sequence[RetargetedArm]) -> bool:
    """Whether the arms are those of one robot: same links, with shoulders at several places."""
    frames = [{str(frame.name) for frame in arm.robot.pin.frames} for arm in arms]
    shoulders = np.array([np.asarray(arm.mapping.target.shoulder) for arm in arms])
    are_distinct = len(np.unique(shoulders.round(6), axis=0)) == len(arms)
    return len(arms) > 1 and are_distinct and all(names == frames[0] for names in frames)


def mountings(arms: Sequence[RetargetedArm]) -> tuple[BasePose, ...]:
    """Where each robot's base is: its axes along the person's, its shoulder at the person's.

    The arms of one robot keep their distance from each other, and their middle is the origin.
    """
    one_body = share_a_body(arms)
    middle = np.mean([np.asarray(arm.mapping.target.shoulder) for arm in arms], axis=0)
    placed = []
    for arm in arms:
        back = np.asarray(arm.mapping.target.base).T
        if one_body:
            position = -back @ middle
        else:
            position = shoulder(arm, len(arms)) - back @ np.asarray(arm.mapping.target.shoulder)
        placed.append(BasePose(back, position))
    return tuple(placed)
