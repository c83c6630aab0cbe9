"""The axes about which coordinates turn one body relative to another, and what they are for.

They follow from joint centres and joint axes, and not from how the bodies are drawn or posed:

upper arm: z from the elbow's centre to the shoulder's, x the axis of elbow flexion. Flexion is the
    sense of the larger part of the coordinate's range. The elbow's centre is the point of this axis
    nearest to the line from shoulder to wrist in the neutral pose: where along its axis a hinge is
    drawn does not change how a model moves.
forearm: z from the wrist's centre to the elbow's at every sample, y the axis of wrist flexion, on
    the side of the thumb. That is where the palm faces the body. Palmar flexion is the sense of the
    coordinate that brings this pose nearer to the range of the forearm's rotation; if both are
    within it or the model has no range, positive is palmar flexion.
    Of several coordinates that could flex elbow or wrist it is the one with "flex" in its name, or
    the one of the largest range.
hand: in line with the forearm in the neutral pose, in which all coordinates are zero but the
    rotation of the forearm, where y of the forearm is y of the upper arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.osim_model import OsimModel, body_poses, point_in

_STEP = 1e-4  # of coordinates [rad]
_TURNS = 1e-3  # rad a unit of the coordinate
# Cosines between an axis of rotation and a long axis: the elbow's flexion, the forearm's rotation.
_ACROSS = 0.6
_ALONG = 0.8


def turning_axes(model: OsimModel, parent: str, child: str) -> dict[str, Array]:
    """Return the rotation vector (3,) of the child per unit, by coordinate, at zero."""
    found = {}
    for name in model.independent(model.path(child, parent)):
        poses = body_poses(model, {**model.zero, name: np.array([_STEP, -_STEP])}, (parent, child))
        ahead, back = np.swapaxes(poses[parent][0], 1, 2) @ poses[child][0]
        turn = scipy.spatial.transform.Rotation.from_matrix(ahead @ back.T).as_rotvec()
        if np.linalg.norm(turn) > 2.0 * _STEP * _TURNS:
            found[name] = turn / (2.0 * _STEP)
    return found


def _cosines(turning: Mapping[str, Array], along: Array) -> dict[str, float]:
    """Return the cosines between the axes of coordinates and a long axis (3,)."""
    length = np.linalg.norm(along)
    return {
        name: float(abs(turn @ along) / (np.linalg.norm(turn) * length))
        for name, turn in turning.items()
    }


def _flexion_among(model: OsimModel, cosines: Mapping[str, float]) -> str | None:
    """Return the coordinate about an axis across the long one that has "flex" in its name, or the
    largest range.
    """
    names = [name for name, cosine in cosines.items() if cosine < _ACROSS]
    named = [name for name in names if "flex" in name.lower()]
    if len(named) == 1:
        return named[0]
    return max(names, key=lambda name: float(np.ptp(_range(model, name))), default=None)


def _range(model: OsimModel, name: str) -> tuple[float, float]:
    return model.coordinates[name].range or (0.0, 0.0)


_SHORTEST = 0.02  # of upper arm and forearm [m]
_EXACT = 1e-9  # rad
_FAR_OUTSIDE = np.pi / 4.0
_STATE_IT = (
    "state the pose with palms towards the body in an OsimConvention, such as "
    "neutral={'pro_sup': 0}"
)


@dataclass(frozen=True, eq=False)
class ArmAxes:
    """Points and axes within the bodies of one arm."""

    bodies: tuple[str, ...]  # bodies of upper arm, forearm and (if the model has one) hand
    upper: Array  # axes x right, y forward, z up of the upper arm, as columns in its body (3, 3)
    elbow: Array  # centre of the elbow in the upper arm's body (3,) [m]
    wrist: Array  # centre of the wrist in the forearm's body (3,) [m]
    thumb: Array  # y of the forearm in its body (3,)
    hand: Array | None = None  # axes of the hand as columns in its body (3, 3), or None

    def rotations(self, poses: Mapping[str, tuple[Array, Array]]) -> tuple[Array, ...]:
        """Return axes (k, 3, 3) of upper arm, forearm and hand as columns in axes of the ground."""
        humerus, at = poses[self.bodies[0]]
        radius, to = poses[self.bodies[1]]
        along = (at + humerus @ self.elbow) - (to + radius @ self.wrist)
        forearm = _axes(along, radius @ self.thumb)
        if self.hand is None:
            return humerus @ self.upper, forearm
        return humerus @ self.upper, forearm, poses[self.bodies[2]][0] @ self.hand


def _axes(up: Array, forward: Array) -> Array:
    """Get axes (..., 3, 3) as columns with z along `up` and y next to `forward`, both (..., 3)."""
    z = up / np.linalg.norm(up, axis=-1, keepdims=True)
    x = np.cross(forward, z)
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def arm_axes(
    model: OsimModel,
    bodies: tuple[str, ...],
    side: str,
    neutral: Mapping[str, float],
) -> ArmAxes:
    """Return the axes of the arm with these bodies of upper arm, forearm and hand (or without a
    hand).

    Args:
        bodies: names.
        side: "right" or "left".
        neutral: those of the neutral pose that are not zero [rad].

    Raises:
        RecordingError: joints do not lead from the upper arm to the hand, or they do not show the
            axes; names what would.
    """
    humerus, radius = bodies[:2]
    hinge = model.path(radius, humerus)[0].parent.position
    shoulder = model.joints[humerus].child.position
    wrist = _wrist(model, bodies)
    tip = point_in(model, model.zero, humerus, radius, wrist)
    for name, length in (("upper arm", shoulder - hinge), ("forearm", hinge - tip)):
        if np.linalg.norm(length) < _SHORTEST:
            raise RecordingError(f"the joint centres of the {side} {name} are at one place")
    turning = turning_axes(model, humerus, radius)
    along = _cosines(turning, hinge - tip)
    rotating = max(along, key=along.__getitem__, default=None)
    if rotating is not None and along[rotating] <= _ALONG:
        rotating = None
    across = _cosines(turning, shoulder - hinge)
    flexing = _flexion_among(
        model, {name: cosine for name, cosine in across.items() if name != rotating}
    )
    if flexing is None:
        raise RecordingError(f"no coordinate flexes the elbow between {humerus!r} and {radius!r}")
    axis = turning[flexing] * (-1.0 if sum(_range(model, flexing)) < 0.0 else 1.0)
    given = {name: np.array([value]) for name, value in neutral.items()}

    def posed(elbow: Array) -> tuple[ArmAxes, dict[str, Array]]:
        """Get the axes with this centre of the elbow, and the coordinates of the neutral pose."""
        up = shoulder - elbow
        arm = ArmAxes(bodies[:2], _axes(up, np.cross(up, axis)), elbow, wrist, np.zeros(3))
        pose = {**model.zero, **given}
        if given:
            poses = body_poses(model, pose, bodies[:2])
            forward = poses[humerus][0][0] @ arm.upper[:, 1]
            return replace(arm, thumb=poses[radius][0][0].T @ forward), pose
        arm, angle = _palm_inwards(model, arm, bodies, side, rotating)
        return arm, pose if rotating is None else {**pose, rotating: np.array([angle])}

    _, pose = posed(hinge)
    tip = point_in(model, pose, humerus, radius, wrist)
    arm, pose = posed(_nearest_point(hinge, axis, shoulder, tip))
    if len(bodies) < 3:
        return arm
    poses = body_poses(model, pose, bodies)
    hand = poses[bodies[2]][0][0].T @ arm.rotations(poses)[1][0]
    return replace(arm, bodies=bodies, hand=hand)


def _nearest_point(hinge: Array, axis: Array, start: Array, end: Array) -> Array:
    """Return the point (3,) of the axis through the hinge that is nearest to the line from start to
    end.

    It is the hinge itself if the two are within 30 degrees of one direction.
    """
    along = axis / np.linalg.norm(axis)
    line = end - start
    across = along - (along @ line) / (line @ line) * line
    if across @ across < 0.25:
        return hinge
    return hinge + ((start - hinge) @ across) / (across @ across) * along


def _wrist(model: OsimModel, bodies: tuple[str, ...]) -> Array:
    """Return centre of the first joint after the forearm, towards the hand if there is one."""
    radius = bodies[1]
    if len(bodies) > 2:
        return model.path(bodies[2], radius)[0].parent.position
    joints = [joint for joint in model.joints.values() if joint.parent.body == radius]
    if len(joints) != 1:
        raise RecordingError(
            f"the centre of the wrist is not known: {len(joints)} joints follow the body {radius!r}"
            "; name the body of the hand in an OsimConvention"
        )
    return joints[0].parent.position


def _palm_inwards(
    model: OsimModel,
    arm: ArmAxes,
    bodies: tuple[str, ...],
    side: str,
    rotating: str | None,
) -> tuple[ArmAxes, float]:
    """Return the arm with the thumb's direction, and the forearm's rotation with the palm inwards
    [rad].

    Palmar flexion turns the right hand about the direction of the thumb, the left one against it.
    """
    turning = turning_axes(model, bodies[1], bodies[2]) if len(bodies) > 2 else {}
    elbow = point_in(model, model.zero, bodies[1], bodies[0], arm.elbow)
    flexing = _flexion_among(model, _cosines(turning, arm.wrist - elbow))
    if flexing is None:
        raise RecordingError(
            f"the model does not show where the {side} palm is, as no coordinate flexes the wrist; "
            f"{_STATE_IT}"
        )
    thumb = turning[flexing] / np.linalg.norm(turning[flexing]) * (1.0 if side == "right" else -1.0)
    choices = [replace(arm, thumb=sign * thumb) for sign in (1.0, -1.0)]
    if rotating is None:
        return choices[0], 0.0
    angles = [_facing(model, choice, rotating, side) for choice in choices]
    limits = model.coordinates[rotating].range
    if limits is None:
        return choices[0], angles[0]
    outside = [max(limits[0] - angle, angle - limits[1], 0.0) for angle in angles]
    best = 0 if outside[0] <= outside[1] else 1
    if outside[best] > _FAR_OUTSIDE:
        raise RecordingError(
            f"by the axis of wrist flexion, the {side} palm is towards the body where {rotating!r} "
            f"is {np.degrees(angles[best]):.0f} degrees, far outside its range; {_STATE_IT}"
        )
    return choices[best], angles[best]


def _facing(model: OsimModel, arm: ArmAxes, rotating: str, side: str) -> float:
    """Return the forearm's rotation [rad] at which its y axis is the upper arm's."""

    def away(angle: float) -> float:
        poses = body_poses(model, {**model.zero, rotating: np.array([angle])}, arm.bodies)
        upper, forearm = (each[0] for each in arm.rotations(poses))
        sine = forearm[:, 0] @ upper[:, 1]
        cosine = forearm[:, 1] @ upper[:, 1]
        return float(np.arctan2(sine, cosine))

    turn = away(_STEP) - away(-_STEP)  # without a whole turn, where the sign of `away` changes
    slope = float(np.arctan2(np.sin(turn), np.cos(turn))) / (2.0 * _STEP)
    angle = 0.0
    for _ in range(50):
        error = away(angle)
        if abs(error) < _EXACT:
            return angle
        angle -= error / (slope if abs(slope) > 0.1 else 1.0)
    raise RecordingError(
        f"no value of {rotating!r} is found with the {side} palm towards the body; {_STATE_IT}"
    )
