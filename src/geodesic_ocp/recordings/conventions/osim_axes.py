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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.osim_model import OsimModel, body_poses

_STEP = 1e-4  # of coordinates [rad]
_TURNS = 1e-3  # rad a unit of the coordinate
# Cosines between an axis of rotation and a long axis: the elbow's flexion, the forearm's rotation.
_ACROSS, _ALONG = 0.6, 0.8


def turning_axes(
    model: OsimModel, zero: Mapping[str, Array], parent: str, child: str
) -> dict[str, Array]:
    """Return the rotation vector (3,) of the child per unit, by coordinate."""
    found = {}
    for name in model.independent(model.path(child, parent)):
        ends = []
        for step in (_STEP, -_STEP):
            poses = body_poses(model, {**zero, name: np.array([step])}, (parent, child))
            ends.append(poses[parent][0][0].T @ poses[child][0][0])
        turn = scipy.spatial.transform.Rotation.from_matrix(ends[0] @ ends[1].T).as_rotvec()
        if np.linalg.norm(turn) > 2.0 * _STEP * _TURNS:
            found[name] = turn / (2.0 * _STEP)
    return found


def _cosines(turning: Mapping[str, Array], along: Array) -> dict[str, float]:
    length = np.linalg.norm(along)
    return {
        name: float(abs(turn @ along) / (np.linalg.norm(turn) * length))
        for name, turn in turning.items()
    }


def turning_across(turning: Mapping[str, Array], along: Array) -> list[str]:
    """Return the coordinates that turn about axes across a long axis (3,)."""
    return [name for name, cosine in _cosines(turning, along).items() if cosine < _ACROSS]


def turning_along(turning: Mapping[str, Array], along: Array) -> str | None:
    """Get the coordinate that turns about the axis nearest to a long axis (3,), if one is near."""
    cosines = _cosines(turning, along)
    best = max(cosines, key=cosines.__getitem__, default=None)
    return best if best is not None and cosines[best] > _ALONG else None


def flexion_among(model: OsimModel, names: Sequence[str]) -> str | None:
    """Return the coordinate with "flex" in its name, or the one of the largest range."""
    named = [name for name in names if "flex" in name.lower()]
    if len(named) == 1:
        return named[0]
    ranges = {name: model.coordinates[name].range or (0.0, 0.0) for name in names}
    return max(names, key=lambda name: ranges[name][1] - ranges[name][0], default=None)


def larger_part(model: OsimModel, name: str) -> float:
    """1 or -1, the sign of the larger part of a coordinate's range."""
    limits = model.coordinates[name].range
    return -1.0 if limits is not None and limits[0] + limits[1] < 0.0 else 1.0


_SHORTEST = 0.02  # of upper arm and forearm [m]
_EXACT = 1e-9  # rad
_FAR_OUTSIDE = np.pi / 4.0
_STATE_IT = (
    "state the pose with palms towards the body in an OsimConvention, such as "
    "neutral={'pro_sup': 0}"
)


@dataclass(frozen=True, eq=False, repr=False)
class ArmAxes:
    """Points and axes within the bodies of one arm.

    Attributes:
        bodies: bodies of upper arm, forearm and (if the model has one) hand.
        upper: axes x right, y forward, z up of the upper arm, as columns in its body (3, 3).
        elbow: centre of the elbow in the upper arm's body (3,) [m].
        wrist: centre of the wrist in the forearm's body (3,) [m].
        thumb: y of the forearm in its body (3,).
        hand: axes of the hand as columns in its body (3, 3), or None.
    """

    bodies: tuple[str, ...]
    upper: Array
    elbow: Array
    wrist: Array
    thumb: Array
    hand: Array | None = None

    def rotations(self, poses: Mapping[str, tuple[Array, Array]]) -> tuple[Array, ...]:
        """Return axes (k, 3, 3) of upper arm, forearm and hand as columns in axes of the ground."""
        humerus, at = poses[self.bodies[0]]
        radius, to = poses[self.bodies[1]]
        along = (at + humerus @ self.elbow) - (to + radius @ self.wrist)
        forearm = _axes(along, radius @ self.thumb)
        if self.hand is None:
            return humerus @ self.upper, forearm
        return humerus @ self.upper, forearm, poses[self.bodies[2]][0] @ self.hand

    def __repr__(self) -> str:
        return f"ArmAxes({', '.join(self.bodies)})"


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
    zero: Mapping[str, Array],
    neutral: Mapping[str, float],
) -> ArmAxes:
    """Return the axes of the arm with these bodies of upper arm, forearm and hand (or without a
    hand).

    Args:
        model: model of the arm.
        bodies: names.
        side: "right" or "left".
        zero: coordinates of the model, one sample of zeros.
        neutral: those of the neutral pose that are not zero [rad].

    Raises:
        RecordingError: joints do not lead from the upper arm to the hand, or they do not show the
            axes; names what would.
    """
    humerus, radius = bodies[:2]
    hinge = model.path(radius, humerus)[0].parent.position
    shoulder = model.joints[humerus].child.position
    wrist = _wrist(model, bodies)
    tip = _wrist_in_upper_arm(model, zero, humerus, radius, wrist)
    for name, length in (("upper arm", shoulder - hinge), ("forearm", hinge - tip)):
        if np.linalg.norm(length) < _SHORTEST:
            raise RecordingError(f"the joint centres of the {side} {name} are at one place")
    turning = turning_axes(model, zero, humerus, radius)
    rotating = turning_along(turning, hinge - tip)
    flexing = flexion_among(
        model, [name for name in turning_across(turning, shoulder - hinge) if name != rotating]
    )
    if flexing is None:
        raise RecordingError(f"no coordinate flexes the elbow between {humerus!r} and {radius!r}")
    axis = turning[flexing] * larger_part(model, flexing)
    given = {name: np.array([value]) for name, value in neutral.items()}

    def posed(elbow: Array) -> tuple[ArmAxes, dict[str, Array]]:
        """Get the axes with this centre of the elbow, and the coordinates of the neutral pose."""
        up = shoulder - elbow
        arm = ArmAxes(bodies[:2], _axes(up, np.cross(up, axis)), elbow, wrist, np.zeros(3))
        pose = {**zero, **given}
        if given:
            poses = body_poses(model, pose, bodies[:2])
            forward = poses[humerus][0][0] @ arm.upper[:, 1]
            return replace(arm, thumb=poses[radius][0][0].T @ forward), pose
        arm, angle = _palm_inwards(model, arm, bodies, side, zero, rotating)
        return arm, pose if rotating is None else {**pose, rotating: np.array([angle])}

    _, pose = posed(hinge)
    tip = _wrist_in_upper_arm(model, pose, humerus, radius, wrist)
    arm, pose = posed(_nearest_point(hinge, axis, shoulder, tip))
    if len(bodies) < 3:
        return arm
    poses = body_poses(model, pose, bodies)
    hand = poses[bodies[2]][0][0].T @ arm.rotations(poses)[1][0]
    return replace(arm, bodies=bodies, hand=hand)


def _wrist_in_upper_arm(
    model: OsimModel, pose: Mapping[str, Array], humerus: str, radius: str, wrist: Array
) -> Array:
    """Return the centre of the wrist (3,) in the upper arm's body."""
    poses = body_poses(model, pose, (humerus, radius))
    (rotation, origin), (turned, place) = ((r[0], p[0]) for r, p in poses.values())
    result: Array = rotation.T @ (place + turned @ wrist - origin)
    return result


def _nearest_point(hinge: Array, axis: Array, start: Array, end: Array) -> Array:
    """Return the point (3,) of the axis through the hinge that is nearest to the line from start to
    end.

    It is the hinge itself if the two are within 30 degrees of one direction.
    """
    along, line = axis / np.linalg.norm(axis), end - start
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
    zero: Mapping[str, Array],
    rotating: str | None,
) -> tuple[ArmAxes, float]:
    """Return the arm with the thumb's direction, and the forearm's rotation with the palm inwards
    [rad].

    Palmar flexion turns the right hand about the direction of the thumb, the left one against it.
    """
    turning = turning_axes(model, zero, bodies[1], bodies[2]) if len(bodies) > 2 else {}
    flexing = flexion_among(
        model, turning_across(turning, arm.wrist - _elbow_in_forearm(model, arm, zero))
    )
    if flexing is None:
        raise RecordingError(
            f"the model does not show where the {side} palm is, as no coordinate flexes the wrist; "
            f"{_STATE_IT}"
        )
    thumb = turning[flexing] / np.linalg.norm(turning[flexing]) * (1.0 if side == "right" else -1.0)
    choices = [replace(arm, thumb=sign * thumb) for sign in (1.0, -1.0)]
    if rotating is None:
        return choices[0], 0.0
    angles = [_facing(model, choice, zero, rotating, side) for choice in choices]
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


def _elbow_in_forearm(model: OsimModel, arm: ArmAxes, zero: Mapping[str, Array]) -> Array:
    poses = body_poses(model, zero, arm.bodies)
    (humerus, at), (radius, to) = (poses[body] for body in arm.bodies)
    place: Array = radius[0].T @ (at[0] + humerus[0] @ arm.elbow - to[0])
    return place


def _facing(
    model: OsimModel, arm: ArmAxes, zero: Mapping[str, Array], rotating: str, side: str
) -> float:
    """Return the forearm's rotation [rad] at which its y axis is the upper arm's."""

    def away(angle: float) -> float:
        poses = body_poses(model, {**zero, rotating: np.array([angle])}, arm.bodies)
        upper, forearm = (each[0] for each in arm.rotations(poses))
        sine, cosine = forearm[:, 0] @ upper[:, 1], forearm[:, 1] @ upper[:, 1]
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
