"""Skeleton and SkeletonMotion: a tree of joints, and how it moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS, SegmentOrientations
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    AXES,
    SKELETON_CONVENTIONS,
    SkeletonConvention,
)
from geodesic_ocp.trajectory.motion import FrameMotion, Subject


@dataclass(frozen=True, eq=False, repr=False)
class Skeleton:
    """A tree of joints in its rest pose, in which the frames of all joints are parallel.

    Attributes:
        names: names of the n joints, parents before their children; empty at the ends of limbs.
        parents: index of each joint's parent; -1 for the root.
        offsets: offsets of each joint from its parent in the rest pose, (n, 3), in the file's unit.
        hinges: unit axis (3,) in the rest pose, by index, of joints that turn about one axis only.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    hinges: Mapping[int, Array] = field(default_factory=dict)

    def path(self, joint: int) -> list[int]:
        """Return indices of the joints from the root to this one."""
        path = []
        while joint >= 0:
            path.append(joint)
            joint = self.parents[joint]
        return path[::-1]

    def way(self, start: int, end: int) -> list[int]:
        """Get indices of the joints from the first after `start` to `end`, which comes after it."""
        path = self.path(end)
        return path[path.index(start) + 1 :]

    def __repr__(self) -> str:
        shown = ", ".join(self.names[:8]) + (", ..." if len(self.names) > 8 else "")
        return f"Skeleton({len(self.names)} joints: {shown})"


@dataclass(frozen=True, eq=False, repr=False)
class SkeletonMotion:
    """The motion of a skeleton, joint by joint.

    Attributes:
        skeleton: the joints.
        time: (k,) [s].
        rotation: from the index of a joint to its rotations relative to its parent, (k, 3, 3); one
            (3, 3) if it does not turn.
        position: from the index of a joint to its positions relative to its parent, (k, 3), in the
            file's unit; (3,) if it stays at its offset.
    """

    skeleton: Skeleton
    time: Array
    rotation: Callable[[int], Array]
    position: Callable[[int], Array]

    def __repr__(self) -> str:
        return f"SkeletonMotion({len(self.time)} samples of {self.skeleton!r})"


def forward_kinematics(
    motion: SkeletonMotion, joints: Iterable[int]
) -> dict[int, tuple[Array, Array]]:
    """Return rotations (k, 3, 3) and positions (k, 3) in the file's space of the frames of these
    joints.

    Those of the joints on the way from the root are included.
    """
    count = len(motion.time)
    poses: dict[int, tuple[Array, Array]] = {
        -1: (np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3)))
    }
    for joint in sorted({each for last in joints for each in motion.skeleton.path(last)}):
        rotations, positions = poses[motion.skeleton.parents[joint]]
        relative = np.broadcast_to(motion.position(joint), (count, 3))
        poses[joint] = (
            rotations @ motion.rotation(joint),
            positions + np.einsum("kij,kj->ki", rotations, relative),
        )
    del poses[-1]
    return poses


SIDES = ("right", "left")
_SHOWN = 60  # names of joints in a message


def named_segments(
    file: Path, skeleton: Skeleton, convention: SkeletonConvention | None
) -> tuple[SkeletonConvention, dict[str, int]]:
    """Return the convention, or the known one that fits best, and the joint of every segment it
    finds.

    A convention fits if it finds the thorax, and upper arm and forearm of at least one arm; the
    best is the one that finds most segments. Joints must follow each other as the segments do:
    pelvis, abdomen and thorax come before the upper arm, then forearm and hand.

    Raises:
        RecordingError: the convention does not fit, or no known one does.
    """
    if convention is not None:
        found = _found(file, skeleton, convention)
        if not _fits(found):
            known = {_plain(name) for name in skeleton.names}
            absent = [
                name
                for names in convention.joints.values()
                for name in names
                if _plain(name) not in known
            ]
            raise RecordingError(
                f"{file}: by the convention {convention.name!r} there must be a thorax, and an "
                f"upper arm with its forearm. The skeleton has no joint "
                f"{', '.join(absent[:_SHOWN]) or 'that the convention lacks'}; found are "
                f"{', '.join(found) or 'no segments'} among the joints {_listed(skeleton)}"
            )
        return convention, found
    fits, ambiguous = [], []
    for each in SKELETON_CONVENTIONS:
        try:
            fits.append((each, _found(file, skeleton, each)))
        except RecordingError as failure:
            ambiguous.append(failure)
    fits = [(each, found) for each, found in fits if _fits(found)]
    if not fits and ambiguous:
        raise ambiguous[0]
    if not fits:
        raise RecordingError(
            f"{file}: no known convention names the segments of this skeleton. Its joints are "
            f"{_listed(skeleton)}. State which of them carry the thorax and an arm, such as "
            "convention=SkeletonConvention('mine', {'thorax': 'Torso', 'right upper arm': 'RArm', "
            "'right forearm': 'RElbow', 'right hand': 'RWrist'}), or in a JSON or TOML file "
            "(--convention FILE)"
        )
    return max(fits, key=lambda fit: len(fit[1]))


def _fits(found: dict[str, int]) -> bool:
    arms = [f"{side} forearm" in found for side in SIDES]
    return "thorax" in found and any(arms)


def _listed(skeleton: Skeleton) -> str:
    names = [name for name in skeleton.names if name]
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


def _plain(name: str) -> str:
    """Return the name as it is compared: no namespace, case, spaces, hyphens or underscores."""
    letters = name.rpartition(":")[2].lower()
    return "".join(letter for letter in letters if letter not in " -_\t")


def _found(file: Path, skeleton: Skeleton, convention: SkeletonConvention) -> dict[str, int]:
    plain = [_plain(name) for name in skeleton.names]

    def first(segment: str, above: int | None, below: list[int]) -> int | None:
        """Return the best-named joint of the segment, under the joint `above` and over those
        `below`.
        """
        for name in convention.joints.get(segment, ()):
            matches = [
                joint
                for joint, given in enumerate(plain)
                if given == _plain(name)
                and (above is None or above in skeleton.path(joint)[:-1])
                and all(joint in skeleton.path(other)[:-1] for other in below)
            ]
            if len(matches) > 1:
                raise RecordingError(
                    f"{file}: {len(matches)} joints are named {name}, any of which may carry the "
                    f"{segment}: their names must differ"
                )
            if matches:
                return matches[0]
        return None

    found: dict[str, int] = {}
    for side in SIDES:
        above: int | None = None
        for segment in ("upper arm", "forearm", "hand"):
            joint = first(f"{side} {segment}", above, [])
            if joint is None:
                break
            above = found[f"{side} {segment}"] = joint
        if f"{side} forearm" not in found:
            found.pop(f"{side} upper arm", None)
    below = [found[f"{side} upper arm"] for side in SIDES if f"{side} upper arm" in found]
    for segment in ("thorax", "abdomen", "pelvis"):
        joint = first(segment, None, below)
        if joint is not None:
            found[segment] = joint
            below = [joint]
    return found


# A direction is along an axis of the file if it is within 30 degrees of it; arms mirror each
# other within as much; and an arm that points up has no shortest rotation from the hanging one.
_ALONG = np.cos(np.radians(30.0))
_UPWARDS = np.cos(np.radians(10.0))
_SHORTEST = 1e-9  # joints that are nearer are at one place, in any unit
# Sine of the angle between a hinge and the long axis of the upper arm from which it is an elbow's.
_ELBOW = 0.5


def axis_vector(axis: str) -> Array:
    """Return unit vector (3,) of an axis such as "-y"."""
    vector: Array = np.eye(3)["xyz".index(axis[1])] * (1.0 if axis[0] == "+" else -1.0)
    return vector


def body_axes(
    file: Path, convention: SkeletonConvention, segments: dict[str, int], positions: Array
) -> Array:
    """Return axes of the body in the rest pose, as columns (3, 3): x right, y forward, z up.

    Those of the convention, or those found from the rest pose: up is the axis of the file that
    points from the pelvis to the shoulders, right the one from the left shoulder to the right. In
    a rest pose that is the first frame the body faces any direction.

    Args:
        file: for messages.
        convention: convention that may state up and forward.
        segments: joint by segment.
        positions: positions of all joints in the rest pose, (n, 3).

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
    """Return the axis of the file within 30 degrees of the vector."""
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
    """Return axes of the arms' segments in the rest pose, (3, 3) as columns in axes of the body.

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
    """Return direction (3,) from one joint towards another, or towards its first child.

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
    """Return matrix (3, 3) of the smallest rotation that takes one direction to another."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    vector = axis * (np.arctan2(sine, cosine) / sine) if sine > 0.0 else np.zeros(3)
    matrix: Array = scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix()
    return matrix


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
    """Return the orientations of the segments, relative to those in the rest pose.

    The rotation of a segment is W R(t) R(rest)' B N, with the rotations R of its joint in the
    file's space, the body's axes B in the rest pose, the segment's axes N there, and W from the
    file's space to one with z up. A rotation of the hand about the long axis of the forearm is the
    forearm's pronation. Without a joint of its own the hand follows the forearm.

    Args:
        file: for messages.
        motion: motion of the skeleton.
        convention: convention of names and axes; the known one that fits best by default.
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
    """Return rotations (n, 3, 3) and positions (n, 3) of all joints in the rest pose."""
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
    """Return rotation (3, 3) from the file's space to one with z up.

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
