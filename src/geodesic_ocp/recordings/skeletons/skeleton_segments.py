"""skeleton_segments: the orientations of the body's segments from the motion of a skeleton."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS, SegmentOrientations
from geodesic_ocp.recordings.skeletons.named_segments import SIDES, named_segments
from geodesic_ocp.recordings.skeletons.rest_pose import axis_vector, body_axes, neutral_frames
from geodesic_ocp.recordings.skeletons.skeleton import SkeletonMotion, forward_kinematics
from geodesic_ocp.recordings.skeletons.skeleton_convention import AXES, SkeletonConvention
from geodesic_ocp.trajectory.motion import FrameMotion, Subject

_SHORTEST_ARM, _LONGEST_ARM = 0.2, 0.9  # [m] from shoulder to wrist, children included
# Cosines: a person whose thorax points along another axis than the vertical on average.
_ALONG_ANOTHER, _NOT_UPRIGHT = 0.8, 0.5


def skeleton_segments(
    file: Path,
    motion: SkeletonMotion,
    convention: SkeletonConvention | None,
    unit: float | None,
    subject: Subject | None = None,
    space_up: str | None = None,
) -> SegmentOrientations:
    """The orientations of the segments, relative to those in the rest pose.

    The rotation of a segment is W R(t) R(rest)' B N, with the rotations R of its joint in the
    file's space, the body's axes B in the rest pose, the segment's axes N there, and W from the
    file's space to one with z up. A rotation of the hand about the long axis of the forearm is the
    forearm's pronation. Without a joint of its own the hand follows the forearm.

    Args:
        file: for messages.
        motion: of the skeleton.
        convention: of names and axes; the known one that fits best by default.
        unit: metres per unit of length; without it, or with one arm only, the trunk's pose is not
            known.
        subject: the recorded person.
        space_up: vertical axis of the format's space where the convention does not state it; by
            default the one that points up in the rest pose.

    Raises:
        RecordingError: fewer than two frames, names or a rest pose that the convention does not
            fit, an arm of implausible length, or a person who is upright along another axis.
    """
    if len(motion.time) < 2:
        raise RecordingError(f"{file}: a motion needs two frames, there are {len(motion.time)}")
    convention, segments = named_segments(file, motion.skeleton, convention)
    moved = forward_kinematics(motion, segments.values())
    rest, positions = _rest_pose(motion, convention)
    body = body_axes(file, convention, segments, positions)
    hinges = {joint: rest[joint] @ axis for joint, axis in motion.skeleton.hinges.items()}
    resting = replace(motion.skeleton, hinges=hinges)
    neutral = neutral_frames(file, convention, segments, resting, body, positions)
    turned = {
        segment: moved[joint][0] @ rest[joint].T @ body @ neutral.get(segment, np.eye(3))
        for segment, joint in segments.items()
    }
    usual = body[:, 2] if space_up is None else axis_vector(space_up)
    space = _space(file, convention.space_up, usual, body, turned["thorax"])
    rotations = {segment: space @ turned[segment] for segment in SEGMENTS if segment in turned}
    for side in SIDES:
        if f"{side} forearm" in rotations:
            _pronate(rotations, side)
    trunk = None
    shoulders = [segments.get(f"{side} upper arm") for side in SIDES]
    if unit is not None:
        _check_lengths(file, segments, positions, unit)
        ends = [moved[joint][1] for joint in shoulders if joint is not None]
        if len(ends) == 2:
            middle = 0.5 * unit * (ends[0] + ends[1]) @ space.T
            trunk = FrameMotion(rotations["thorax"], middle)
    return SegmentOrientations(motion.time, rotations, trunk, subject or Subject())


def _rest_pose(motion: SkeletonMotion, convention: SkeletonConvention) -> tuple[Array, Array]:
    """Rotations (n, 3, 3) and positions (n, 3) of all joints in the rest pose."""
    skeleton, zero = motion.skeleton, convention.rest == "zero"

    def rotation(joint: int) -> Array:
        return np.eye(3) if zero else motion.rotation(joint).reshape(-1, 3, 3)[:1]

    def position(joint: int) -> Array:
        return skeleton.offsets[joint] if zero else motion.position(joint).reshape(-1, 3)[:1]

    still = SkeletonMotion(skeleton, motion.time[:1], rotation, position)
    poses = forward_kinematics(still, range(len(skeleton.names)))
    rotations = np.array([poses[joint][0][0] for joint in range(len(poses))])
    positions = np.array([poses[joint][1][0] for joint in range(len(poses))])
    return rotations, positions


def _space(file: Path, stated: str | None, usual: Array, body: Array, thorax: Array) -> Array:
    """Rotation (3, 3) from the file's space to one with z up.

    Its horizontal axes are those of the body in the rest pose, if that has the same vertical axis.

    Raises:
        RecordingError: no vertical axis is stated, and the usual one is not that of the thorax.
    """
    vertical = usual if stated is None else axis_vector(stated)
    mean = np.mean(thorax[:, :, 2], axis=0)
    largest = int(np.argmax(np.abs(mean)))
    if stated is None and abs(mean[largest]) > _ALONG_ANOTHER and mean @ vertical < _NOT_UPRIGHT:
        along = AXES[2 * largest + int(mean[largest] < 0.0)]
        raise RecordingError(
            f"{file}: {_name(vertical)} should be vertical, but the thorax points along {along}: "
            "is that the vertical axis of the recording, or does the person lie? State "
            f"space_up={along!r} or {_name(vertical)!r} in a SkeletonConvention"
        )
    if np.allclose(vertical, body[:, 2]):
        return body.T
    first = np.roll(np.abs(vertical), 1)  # the horizontal axes follow in cyclic order
    return np.stack([first, np.cross(vertical, first), vertical])


def _name(axis: Array) -> str:
    largest = int(np.argmax(np.abs(axis)))
    return AXES[2 * largest + int(axis[largest] < 0.0)]


def _pronate(rotations: dict[str, Array], side: str) -> None:
    """Turn the forearm by the hand's rotation about its long axis: F' H = Rz(c) Rx(a) Ry(b)."""
    forearm = rotations[f"{side} forearm"]
    if f"{side} hand" not in rotations:
        rotations[f"{side} hand"] = forearm
        return
    wrist = np.swapaxes(forearm, 1, 2) @ rotations[f"{side} hand"]
    pronation = np.arctan2(-wrist[:, 0, 1], wrist[:, 1, 1])
    rotations[f"{side} forearm"] = forearm @ axis_rotation("z", pronation)


def _check_lengths(file: Path, segments: dict[str, int], positions: Array, unit: float) -> None:
    for side in SIDES:
        if f"{side} hand" in segments:
            ends = positions[segments[f"{side} hand"]] - positions[segments[f"{side} upper arm"]]
            length = unit * float(np.linalg.norm(ends))
            if not _SHORTEST_ARM < length < _LONGEST_ARM:
                raise RecordingError(
                    f"{file}: the {side} arm is {length:.3g} m long from shoulder to wrist: "
                    "lengths have another unit than stated (argument unit)"
                )
