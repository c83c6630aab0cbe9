"""Scenes of alignments: robots beside a person, placed so that shoulders coincide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import Actor, model_actor, rest_of_person
from geodesic_ocp.drawing.model_scene import hand_frames, hand_trails
from geodesic_ocp.drawing.scene import Curve, FrameTrack, Playback, Plot, Scene, Span, Trail
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.model.human import DEFAULT_HEIGHT, human_arm, stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.nearest_poses import nearest_poses, search_range


@dataclass(frozen=True, eq=False, repr=False)
class BasePose:
    """Return where a model's base is in a scene.

    Attributes:
        rotation: rotation of the base (3, 3).
        position: position of its origin (3,) [m].
    """

    rotation: Array
    position: Array

    def __repr__(self) -> str:
        return f"BasePose(at {self.position.round(3).tolist()} m)"

    def points(self, positions: Array) -> Array:
        """Return points (..., 3) [m] of the base frame, in the scene."""
        return np.asarray(positions @ self.rotation.T + self.position)

    def rotations(self, rotations: Array) -> Array:
        """Return rotations (..., 3, 3) of the base frame, in the scene."""
        return np.asarray(self.rotation @ rotations)


def shoulder(arm: RetargetedArm, count: int) -> Array:
    """Return the person's shoulder in the scene (3,) [m]: the origin, or to one side of it if of
    two.
    """
    model = arm.analysis.model
    if count == 1 or not {"left", "right"} & set(model.name.split()):
        return np.zeros(3)
    height = stature(model) or DEFAULT_HEIGHT
    side = -1.0 if "left" in model.name else 1.0
    return np.array([side * trunk().half_width * height, 0.0, 0.0])


def share_a_body(arms: Sequence[RetargetedArm]) -> bool:
    """Return whether the arms are of one robot: same links, shoulders at several places."""
    frames = [{str(frame.name) for frame in arm.robot.pin.frames} for arm in arms]
    shoulders = np.array([np.asarray(arm.mapping.target.shoulder) for arm in arms])
    are_distinct = len(np.unique(shoulders.round(6), axis=0)) == len(arms)
    return len(arms) > 1 and are_distinct and all(names == frames[0] for names in frames)


def mountings(arms: Sequence[RetargetedArm]) -> tuple[BasePose, ...]:
    """Return each robot's base: its axes along the person's, its shoulder at the person's.

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


# Flexion of shoulder and elbow [rad], the first and the fourth joint of a human arm.
_POSTURES = {
    "hanging": (0.0, 0.2),
    "elbow bent": (0.2, 1.6),
    "reaching forward": (1.2, 0.4),
}
_SECONDS, _RATE = 1.5, 20.0  # from one posture to the next [s], samples [Hz]
_STARTS, _STEPS = 30, 60
_TARGET, _ROBOT, _SCALED = "person's hand, mapped", "robot's hand", "scaled person's arm"


def alignment_playback(aligned: Alignment, robot: Model) -> Playback:
    """Return a person's arm that moves through some postures, and the robot's hand where the
    person's is.

    The robot is shown in the person's axes, its shoulder where the person's is. The person's arm,
    scaled to the length of the robot's, can be switched on beside it; so can the frames of the
    hands.

    Args:
        aligned: the alignment of the robot with a person.
        robot: the arm.
    """
    side = aligned.side or "right"
    person = human_arm(side)
    time, q = _postures(person)
    scale = aligned.length / person.reach
    rotations, positions = aligned.to_robot(*person.hand_pose(q), scale=scale)
    found = _followed(robot, rotations, positions)
    turn = np.asarray(aligned.base).T
    place = -turn @ np.asarray(aligned.shoulder)
    reached, at = robot.hand_pose(found)
    lines = {_TARGET: positions @ turn.T + place, _ROBOT: at @ turn.T + place}
    axes = {_TARGET: turn @ rotations, _ROBOT: turn @ reached}
    scenes = (
        Scene(
            "person",
            time,
            (model_actor(person, q, role="observed"), *rest_of_person(person)),
            hand_trails(person, q, "observed"),
            frames=hand_frames(person, q),
            note=person.name,
        ),
        Scene(
            robot.name,
            time,
            (
                model_actor(robot, found, rotation=turn, position=place),
                _scaled(person, q, scale),
            ),
            (
                Trail(_TARGET, lines[_TARGET], "observed", lines[_TARGET]),
                Trail(_ROBOT, lines[_ROBOT], "predicted", lines[_ROBOT]),
            ),
            frames=tuple(FrameTrack(name, axes[name], lines[name]) for name in lines),
            note=f"positions scaled by {scale:.3g}",
        ),
    )
    off = 1000.0 * np.linalg.norm(at - positions, axis=1)
    distance = Plot("hand's distance [mm]", (Curve(robot.name, time, off, "predicted"),))
    starts = np.arange(len(_POSTURES)) * _SECONDS
    edges = np.clip(np.append(starts - _SECONDS / 2.0, np.inf), 0.0, time[-1])
    spans = tuple(
        Span(name, float(start), float(stop))
        for name, (start, stop) in zip(_POSTURES, pairwise(edges), strict=True)
    )
    return Playback(
        f"alignment of {robot.name} with a person's {side} arm",
        scenes,
        {"posture": spans},
        (replace(distance, title=f"from the {_TARGET}"),),
        azimuth=-50.0 if side == "left" else 50.0,
        hidden=(*Playback.hidden, _SCALED),
    )


def _postures(person: Model) -> tuple[Array, Array]:
    """Return times (k,) [s], and configurations (k, n) that pause at each of the postures."""
    key = np.zeros((len(_POSTURES), person.dof))
    key[:, [0, 3]] = list(_POSTURES.values())
    count = int(_SECONDS * _RATE)
    fraction = np.arange(count) / count
    eased = (fraction**2 * (3.0 - 2.0 * fraction))[:, None]
    moving = [a + eased * (b - a) for a, b in pairwise(key)]
    q = np.concatenate([*moving, key[-1:]])
    return np.arange(len(q)) / _RATE, q


def _followed(robot: Model, rotations: Array, positions: Array) -> Array:
    """Return configurations (k, n), each the nearest pose from the one before, from the best of
    all.
    """
    lower, upper = search_range(robot)
    starts = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.dof))
    starts[0] = np.clip(0.0, lower, upper)
    count = len(positions)
    best, least = np.zeros((count, robot.dof)), np.inf
    for first in dict.fromkeys((count // 2, 0, count - 1)):
        q, errors = np.zeros((count, robot.dof)), np.zeros(count)
        steps = [(first, starts)]
        steps += [(k, q[k - 1 : k]) for k in range(first + 1, count)]
        steps += [(k, q[k + 1 : k + 2]) for k in range(first - 1, -1, -1)]
        for k, begin in steps:  # each begins where the one before, which is its neighbour, ended
            pose = rotations[k : k + 1], positions[k : k + 1]
            found = nearest_poses(robot, *pose, begin[None], _STEPS)
            q[k], errors[k] = found.q[0], max(found.distances[0], found.angles[0])
        if errors.max() < least:
            best, least = q, float(errors.max())
    return best


def _scaled(person: Model, q: Array, scale: float) -> Actor:
    """Return the person's arm in the size of the robot's, with the shoulder at the origin."""
    actor = model_actor(person, q, name=_SCALED, role="observed", translucent=True, layer=_SCALED)
    return replace(
        actor,
        meshes=tuple(replace(mesh, vertices=scale * mesh.vertices) for mesh in actor.meshes),
        positions={link: scale * position for link, position in actor.positions.items()},
    )
