"""Skeleton and SkeletonMotion: a tree of joints, and how it moves."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation, direction
from geodesic_ocp.recordings.conventions.segment_orientations import (
    ARM,
    SEGMENTS,
    SIDES,
    TRUNK,
    SegmentOrientations,
)
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    AXES,
    SKELETON_CONVENTIONS,
    SkeletonConvention,
)
from geodesic_ocp.trajectory.motion import FrameMotion, Subject


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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


_SHOWN = 60  # names of joints in a message


def named_segments(
    skeleton: Skeleton, convention: SkeletonConvention | None
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
        found = _found(skeleton, convention)
        if not _fits(found):
            known = {_plain(name) for name in skeleton.names}
            named = itertools.chain(*convention.joints.values())
            absent = [name for name in named if _plain(name) not in known]
            raise RecordingError(
                f"by the convention {convention.name!r} there must be a thorax, and an upper arm "
                "with its forearm. The skeleton has no joint "
                f"{', '.join(absent[:_SHOWN]) or 'that the convention lacks'}; found are "
                f"{', '.join(found) or 'no segments'} among the joints {_listed(skeleton)}"
            )
        return convention, found
    fits = []
    ambiguous = []
    for each in SKELETON_CONVENTIONS:
        try:
            found = _found(skeleton, each)
        except RecordingError as failure:
            ambiguous.append(failure)
        else:
            fits += [(each, found)] if _fits(found) else []
    if fits:
        return max(fits, key=lambda fit: len(fit[1]))
    if ambiguous:
        raise ambiguous[0]
    raise RecordingError(
        f"no known convention names the segments of this skeleton. Its joints are "
        f"{_listed(skeleton)}. State which of them carry the thorax and an arm, such as "
        "convention=SkeletonConvention('mine', {'thorax': 'Torso', 'right upper arm': 'RArm', "
        "'right forearm': 'RElbow', 'right hand': 'RWrist'}), or in a JSON or TOML file "
        "(--convention FILE)"
    )


def _fits(found: dict[str, int]) -> bool:
    return "thorax" in found and any(f"{side} forearm" in found for side in SIDES)


def _listed(skeleton: Skeleton) -> str:
    names = [name for name in skeleton.names if name]
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


def _plain(name: str) -> str:
    """Return the name as it is compared: no namespace, case, spaces, hyphens or underscores."""
    return re.sub(r"[ \t_-]", "", name.rpartition(":")[2].lower())


def _found(skeleton: Skeleton, convention: SkeletonConvention) -> dict[str, int]:
    plain = [_plain(name) for name in skeleton.names]

    def first(segment: str, above: int = -1, below: Iterable[int] = ()) -> int | None:
        """Return the best-named joint of the segment, after the joint `above`, before `below`."""
        for name in convention.joints.get(segment, ()):
            matches = [
                joint
                for joint, given in enumerate(plain)
                if given == _plain(name)
                and above in [-1, *skeleton.path(joint)[:-1]]
                and all(joint in skeleton.path(other)[:-1] for other in below)
            ]
            if len(matches) > 1:
                raise RecordingError(
                    f"{len(matches)} joints are named {name}, any of which may carry the "
                    f"{segment}: their names must differ"
                )
            if matches:
                return matches[0]
        return None

    found: dict[str, int] = {}
    for side in SIDES:
        above = -1
        for segment in ARM:
            if (joint := first(f"{side} {segment}", above)) is None:
                break
            above = found[f"{side} {segment}"] = joint
        if f"{side} forearm" not in found:
            found.pop(f"{side} upper arm", None)
    below = [found[f"{side} upper arm"] for side in SIDES if f"{side} upper arm" in found]
    for segment in reversed(TRUNK):
        if (joint := first(segment, below=below)) is not None:
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


def body_axes(convention: SkeletonConvention, segments: dict[str, int], positions: Array) -> Array:
    """Return axes of the body in the rest pose, as columns (3, 3): x right, y forward, z up.

    Those of the convention, or those found from the rest pose: up is the axis of the file that
    points from the pelvis to the shoulders, right the one from the left shoulder to the right. In
    a rest pose that is the first frame the body faces any direction.

    Args:
        convention: convention that may state up and forward.
        segments: joint by segment.
        positions: positions of all joints in the rest pose, (n, 3).

    Raises:
        RecordingError: the rest pose does not show these axes.
    """
    if convention.up is not None and convention.forward is not None:
        up = _axis(convention.up)
        forward = _axis(convention.forward)
        return np.stack([np.cross(forward, up), forward, up], axis=1)
    pelvis = positions[segments.get("pelvis", segments.get("abdomen", 0))]
    chest = positions[segments["thorax"]]
    right, left = (
        positions[segments[arm]] if arm in segments else chest
        for arm in ("right upper arm", "left upper arm")
    )
    both = {"right upper arm", "left upper arm"} <= set(segments)
    up = _axis_along("up", (0.5 * (right + left) if both else chest) - pelvis)
    across = right - left
    across = _axis_along("right", across - (across @ up) * up, convention.rest != "zero")
    return np.stack([across, np.cross(up, across), up], axis=1)


def _axis(name: str) -> Array:
    """Return unit vector (3,) of an axis such as "+y"."""
    return direction(name.removeprefix("+"))


def _axis_along(what: str, vector: Array, is_oblique: bool = False) -> Array:
    """Return the axis of the file within 30 degrees of the vector, or the vector's direction."""
    length = float(np.linalg.norm(vector))
    along = vector / max(length, _SHORTEST)
    if length < _SHORTEST:
        fault = "the joints are at one place"
    elif not is_oblique and np.abs(along).max() < _ALONG:
        fault = f"it is {along.round(2).tolist()}"
    else:
        return along if is_oblique else _axis(_name(along))
    raise RecordingError(
        f"the rest pose (all joint angles zero) does not show which axis points {what}; state up, "
        "forward and, if the person stands upright in the first frame, rest='first frame' in a "
        f"SkeletonConvention: {fault}"
    )


def neutral_frames(
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
        names = [f"{side} {name}" for name in ARM]
        if names[1] not in segments:
            continue
        upper = _bone(segments[names[0]], segments[names[1]], skeleton, positions)
        lower = _bone(segments[names[1]], segments.get(names[2]), skeleton, positions)
        directions[side] = upper = upper @ body
        lower = lower @ body if np.any(lower) else upper
        faults = {
            "has no length": not np.any(upper),
            "points up": upper[2] > _UPWARDS,
            "is folded": lower @ upper < -_UPWARDS,
        }
        if fault := next((each for each, is_so in faults.items() if is_so), None):
            raise RecordingError(
                f"the {side} arm {fault} in the rest pose, which must be that of a person who "
                "stands with straight arms; if that is the first frame, state rest='first frame' "
                "in a SkeletonConvention"
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
        right = directions["right"]
        left = directions["left"]
        if right @ (left * [-1.0, 1.0, 1.0]) < _ALONG:
            raise RecordingError(
                "the arms do not mirror each other in the rest pose: the right one has the "
                f"direction {right.round(2).tolist()} (right, forward, up), the left one "
                f"{left.round(2).tolist()}; if the person stands upright with straight arms in "
                "the first frame, state rest='first frame' in a SkeletonConvention"
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
    turn, _ = scipy.spatial.transform.Rotation.align_vectors(end, start)
    return np.asarray(turn.as_matrix())


_SHORTEST_ARM = 0.2  # [m] from shoulder to wrist, children included
_LONGEST_ARM = 0.9  # [m] from shoulder to wrist, children included
# Cosines: a person whose thorax points along another axis than the vertical on average.
_ALONG_ANOTHER = 0.8
_NOT_UPRIGHT = 0.5


def skeleton_segments(
    motion: SkeletonMotion,
    convention: SkeletonConvention | None,
    unit: float | None = None,
    subject: Subject | None = None,
    space_up: str | None = None,
    up: str | None = None,
) -> SegmentOrientations:
    """Return the orientations of the segments, relative to those in the rest pose.

    The rotation of a segment is W R(t) R(rest)' B N, with the rotations R of its joint in the
    file's space, the body's axes B in the rest pose, the segment's axes N there, and W from the
    file's space to one with z up. A rotation of the hand about the long axis of the forearm is the
    forearm's pronation. Without a joint of its own the hand follows the forearm.

    Args:
        convention: convention of names and axes; the known one that fits best by default.
        unit: metres per unit of length; without it, or with one arm only, the trunk's pose is not
            known.
        subject: the recorded person.
        space_up: vertical axis of the format's space where the convention does not state it; by
            default the one that points up in the rest pose.
        up: vertical axis of this file's space, such as "y" or "-z", whatever these say.

    Raises:
        RecordingError: fewer than two frames, names or a rest pose that the convention does not
            fit, an arm of implausible length, or a person who is upright along another axis.
    """
    if len(motion.time) < 2:
        raise RecordingError(f"a motion needs two frames, there are {len(motion.time)}")
    convention, segments = named_segments(motion.skeleton, convention)
    moved = forward_kinematics(motion, segments.values())
    rest, positions = _rest_pose(motion, convention)
    body = body_axes(convention, segments, positions)
    hinges = {joint: rest[joint] @ axis for joint, axis in motion.skeleton.hinges.items()}
    resting = replace(motion.skeleton, hinges=hinges)
    neutral = neutral_frames(convention, segments, resting, body, positions)
    turned = {
        segment: moved[joint][0] @ rest[joint].T @ body @ neutral.get(segment, np.eye(3))
        for segment, joint in segments.items()
    }
    usual = body[:, 2] if space_up is None else _axis(space_up)
    stated = convention.space_up if up is None else up if up[0] == "-" else f"+{up}"
    space = _space(stated, usual, body, turned["thorax"])
    rotations = {segment: space @ turned[segment] for segment in SEGMENTS if segment in turned}
    trunk = None
    for side in SIDES:
        if f"{side} forearm" in rotations:
            _pronate(rotations, side)
    if unit is not None:
        _check_lengths(segments, positions, unit)
        shoulders = {"right upper arm", "left upper arm"} & set(segments)
        if len(shoulders) == 2:
            middle = 0.5 * unit * sum(moved[segments[arm]][1] for arm in shoulders) @ space.T
            trunk = FrameMotion(rotations["thorax"], middle)
    return SegmentOrientations(motion.time, rotations, trunk, subject or Subject())


def _rest_pose(motion: SkeletonMotion, convention: SkeletonConvention) -> tuple[Array, Array]:
    """Return rotations (n, 3, 3) and positions (n, 3) of all joints in the rest pose."""
    skeleton = motion.skeleton
    zero = convention.rest == "zero"

    def rotation(joint: int) -> Array:
        return np.eye(3) if zero else motion.rotation(joint).reshape(-1, 3, 3)[:1]

    def position(joint: int) -> Array:
        return skeleton.offsets[joint] if zero else motion.position(joint).reshape(-1, 3)[:1]

    still = SkeletonMotion(skeleton, motion.time[:1], rotation, position)
    poses = forward_kinematics(still, range(len(skeleton.names)))
    rotations, positions = map(np.concatenate, zip(*poses.values(), strict=True))
    return rotations, positions


def _space(stated: str | None, usual: Array, body: Array, thorax: Array) -> Array:
    """Return rotation (3, 3) from the file's space to one with z up.

    Its horizontal axes are those of the body in the rest pose, if that has the same vertical axis.

    Raises:
        RecordingError: no vertical axis is stated, and the usual one is not that of the thorax.
    """
    vertical = usual if stated is None else _axis(stated)
    mean = np.mean(thorax[:, :, 2], axis=0)
    if stated is None and np.abs(mean).max() > _ALONG_ANOTHER and mean @ vertical < _NOT_UPRIGHT:
        raise RecordingError(
            f"{_name(vertical)} should be vertical, but the thorax points along {_name(mean)}: is "
            "that the vertical axis of the recording, or does the person lie? Then pass "
            f"up={_option(mean)!r} (--up={_option(mean)}) or up={_option(vertical)!r}, or state "
            "space_up in a SkeletonConvention"
        )
    if np.allclose(vertical, body[:, 2]):
        return body.T
    first = np.roll(np.abs(vertical), 1)  # the horizontal axes follow in cyclic order
    return np.stack([first, np.cross(vertical, first), vertical])


def _option(axis: Array) -> str:
    """Return the axis as the argument `up` names it."""
    return _name(axis).removeprefix("+")


def _name(axis: Array) -> str:
    """Return the name of the axis that is nearest to a vector (3,)."""
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


def _check_lengths(segments: dict[str, int], positions: Array, unit: float) -> None:
    for side in SIDES:
        if f"{side} hand" in segments:
            ends = positions[segments[f"{side} hand"]] - positions[segments[f"{side} upper arm"]]
            length = unit * float(np.linalg.norm(ends))
            if not _SHORTEST_ARM < length < _LONGEST_ARM:
                raise RecordingError(
                    f"the {side} arm is {length:.3g} m long from shoulder to wrist: lengths have "
                    "another unit than stated (argument unit)"
                )
