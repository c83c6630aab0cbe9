"""The axes of the body and of the arms' segments in the rest pose of a skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation
from geodesic_ocp.recordings.skeletons.named_segments import SIDES
from geodesic_ocp.recordings.skeletons.skeleton import Skeleton
from geodesic_ocp.recordings.skeletons.skeleton_convention import SkeletonConvention

# A direction is along an axis of the file if it is within 30 degrees of it; arms mirror each
# other within as much; and an arm that points up has no shortest rotation from the hanging one.
_ALONG = np.cos(np.radians(30.0))
_UPWARDS = np.cos(np.radians(10.0))
_SHORTEST = 1e-9  # joints that are nearer are at one place, in any unit
# Sine of the angle between a hinge and the long axis of the upper arm from which it is an elbow's.
_ELBOW = 0.5


def axis_vector(axis: str) -> Array:
    """Unit vector (3,) of an axis such as "-y"."""
    vector: Array = np.eye(3)["xyz".index(axis[1])] * (1.0 if axis[0] == "+" else -1.0)
    return vector


def body_axes(
    file: Path, convention: SkeletonConvention, segments: dict[str, int], positions: Array
) -> Array:
    """Axes of the body in the rest pose, as columns (3, 3): x right, y forward, z up.

    Those of the convention, or those found from the rest pose: up is the axis of the file that
    points from the pelvis to the shoulders, right the one from the left shoulder to the right. In
    a rest pose that is the first frame the body faces any direction.

    Args:
        file: for messages.
        convention: with up and forward, or without.
        segments: joint by segment.
        positions: of all joints in the rest pose, (n, 3).

    Raises:
        RecordingError: the rest pose does not show these axes.
    """
    if convention.up is not None and convention.forward is not None:
        up, forward = axis_vector(convention.up), axis_vector(convention.forward)
        return np.stack([np.cross(forward, up), forward, up], axis=1)
    pelvis = positions[segments.get("pelvis", segments.get("abdomen", 0))]
    shoulders = [
        positions[segments[f"{side} upper arm"]]
        for side in SIDES
        if f"{side} upper arm" in segments
    ]
    chest = positions[segments["thorax"]]
    if len(shoulders) == 2:
        spine, across = 0.5 * (shoulders[0] + shoulders[1]) - pelvis, shoulders[0] - shoulders[1]
    else:
        sign = 1.0 if "right upper arm" in segments else -1.0
        spine, across = chest - pelvis, sign * (shoulders[0] - chest)
    up = _axis_along(file, "up", spine)
    across = across - (across @ up) * up
    if convention.rest == "zero":
        right = _axis_along(file, "right", across)
    else:
        right = across / _length(file, "right", across)
    return np.stack([right, np.cross(up, right), up], axis=1)


def _length(file: Path, what: str, vector: Array) -> float:
    length = float(np.linalg.norm(vector))
    if length < _SHORTEST:
        raise RecordingError(f"{file}: {_unclear(what)}: the joints are at one place")
    return length


def _axis_along(file: Path, what: str, vector: Array) -> Array:
    """The axis of the file within 30 degrees of the vector."""
    direction = vector / _length(file, what, vector)
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) < _ALONG:
        raise RecordingError(f"{file}: {_unclear(what)}: it is {direction.round(2).tolist()}")
    axis: Array = np.eye(3)[largest] * np.sign(direction[largest])
    return axis


def _unclear(what: str) -> str:
    return (
        f"the rest pose (all joint angles zero) does not show which axis points {what}; state up, "
        "forward and, if the person stands upright in the first frame, rest='first frame' in a "
        "SkeletonConvention"
    )


def neutral_frames(
    file: Path,
    convention: SkeletonConvention,
    segments: dict[str, int],
    skeleton: Skeleton,
    body: Array,
    positions: Array,
) -> dict[str, Array]:
    """Axes of the arms' segments in the rest pose, (3, 3) as columns in axes of the body.

    Upper arm: the shortest rotation takes the hanging arm (-z, palm towards the body) to the
    direction of the bone; in a T pose this is pure abduction, and the palms face down. The forearm
    follows by the shortest rotation from the direction of the upper arm to its own, the hand is in
    line with it. A rest pose with palms that face elsewhere shows as constant axial rotation of
    the forearm; the convention's twist corrects it. If the elbow turns about one axis only, that
    axis is the upper arm's x axis, up to the part along the bone.

    Raises:
        RecordingError: an arm has no length or points upwards, or the arms do not mirror each
            other, so that the rest pose is not that of a standing person.
    """
    frames: dict[str, Array] = {}
    directions = {}
    for side in SIDES:
        names = [f"{side} {name}" for name in ("upper arm", "forearm", "hand")]
        if names[1] not in segments:
            continue
        upper = _bone(segments[names[0]], segments[names[1]], skeleton, positions)
        lower = _bone(segments[names[1]], segments.get(names[2]), skeleton, positions)
        directions[side] = upper = upper @ body
        lower = lower @ body if np.any(lower) else upper
        fault = (
            "has no length"
            if not np.any(upper)
            else "points up"
            if upper[2] > _UPWARDS
            else "is folded"
            if lower @ upper < -_UPWARDS
            else ""
        )
        if fault:
            raise RecordingError(
                f"{file}: the {side} arm {fault} in the rest pose, which must be that of a person "
                "who stands with straight arms; if that is the first frame, state rest='first "
                "frame' in a SkeletonConvention"
            )
        frames[names[0]] = _shortest(np.array([0.0, 0.0, -1.0]), upper)
        frames[names[1]] = frames[names[2]] = _shortest(upper, lower) @ frames[names[0]]
        twists = {name: np.radians(convention.twist.get(name, 0.0)) for name in names}
        elbow = skeleton.way(segments[names[0]], segments[names[1]])
        hinge = next((skeleton.hinges[joint] for joint in elbow if joint in skeleton.hinges), None)
        if names[0] not in convention.twist and hinge is not None:
            x, y, _ = frames[names[0]].T @ body.T @ hinge
            if np.hypot(x, y) > _ELBOW:
                twists[names[0]] = np.arctan(y / x) if x else np.pi / 2.0
        frames |= {name: frames[name] @ axis_rotation("z", twists[name]) for name in names}
    if len(directions) == 2:
        mirrored = directions["left"] * [-1.0, 1.0, 1.0]
        if directions["right"] @ mirrored < _ALONG:
            raise RecordingError(
                f"{file}: the arms do not mirror each other in the rest pose: the right one has "
                f"the direction {directions['right'].round(2).tolist()} (right, forward, up), the "
                f"left one {directions['left'].round(2).tolist()}; if the person stands upright "
                "with straight arms in the first frame, state rest='first frame' in a "
                "SkeletonConvention"
            )
    return frames


def _bone(start: int, end: int | None, skeleton: Skeleton, positions: Array) -> Array:
    """Direction (3,) from one joint towards another, or towards its first child.

    It is that to the first joint on the way that is elsewhere; zero if there is none.
    """
    children = [joint for joint, parent in enumerate(skeleton.parents) if parent == start]
    for joint in children if end is None else skeleton.way(start, end):
        vector = positions[joint] - positions[start]
        length = np.linalg.norm(vector)
        if length > _SHORTEST:
            return np.asarray(vector / length, dtype=float)
    return np.zeros(3)


def _shortest(start: Array, end: Array) -> Array:
    """Matrix (3, 3) of the smallest rotation that takes one direction to another."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    vector = axis * (np.arctan2(sine, cosine) / sine) if sine > 0.0 else np.zeros(3)
    matrix: Array = scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix()
    return matrix
