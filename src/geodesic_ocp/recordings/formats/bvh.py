"""BVH: a hierarchy of joints and its motion; messages name the line."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    SkeletonConvention,
    as_skeleton_convention,
    metres_per_unit,
)
from geodesic_ocp.recordings.conventions.skeleton_segments import (
    Skeleton,
    SkeletonMotion,
    skeleton_segments,
)
from geodesic_ocp.trajectory.files.text_lines import named_failures, numbers, read_lines

_CHANNELS = tuple(f"{axis}{what}" for what in ("rotation", "position") for axis in "xyz")
_DEEPEST = 200  # joints from the root to the end of a limb


@dataclass(eq=False)
class BvhJoint:
    """A joint of the hierarchy."""

    line: int  # on which it begins
    name: str | None  # None for an end site
    parent: int  # index of its parent; -1 for the root
    depth: int  # number of joints from the root to this one
    # (3,), in the file's unit; files of the SOMA skeleton add the joint's rotation in the rest
    # pose, angles about x, y and z [deg]
    offset: list[float] | None = None
    # names in lower case, such as "zrotation", in the order of the file
    channels: tuple[str, ...] | None = None
    first: int = 0  # column of its first channel

    def columns(self, what: str) -> tuple[str, list[int]]:
        """Return axes of the channels of a kind, "rotation" or "position", and their columns."""
        channels = [(i, name) for i, name in enumerate(self.channels or ()) if name.endswith(what)]
        return "".join(name[0] for _, name in channels), [self.first + i for i, _ in channels]


@dataclass(eq=False)
class BvhHierarchy:
    """Joints, parents before their children; the number of channels; the index of line MOTION."""

    joints: list[BvhJoint] = field(default_factory=list)
    columns: int = 0
    end: int = 0


def read_hierarchy(lines: list[str]) -> BvhHierarchy:
    """Read everything before the line MOTION.

    Raises:
        RecordingError: the hierarchy is malformed; the message names the line.
    """
    tree = BvhHierarchy()
    parent = -1
    opened = True
    begun = False
    for number, line in enumerate(lines, start=1):
        words = line.replace("{", " { ").replace("}", " } ").split()
        if words and not begun:
            if words[0].upper() != "HIERARCHY":
                raise RecordingError(
                    f"line {number}: a BVH begins with HIERARCHY, not {line.strip()[:40]!r}"
                )
            begun = True
            words = words[1:]
        while words:
            key = words[0].upper()
            if not opened and key != "{":
                raise RecordingError(f"line {number}: expected '{{', found {words[0]!r}")
            joint = tree.joints[parent] if parent >= 0 else None
            if key == "MOTION":
                _check_complete(tree, number, joint)
                tree.end = number - 1
                return tree
            if key == "{":
                if opened:
                    raise RecordingError(f"line {number}: '{{' without a joint")
                opened = True
                words = words[1:]
            elif key in ("ROOT", "JOINT", "END"):
                end = words.index("{") if "{" in words else len(words)
                tree.joints.append(_joint(tree, number, words[:end], parent))
                parent = len(tree.joints) - 1
                opened = False
                words = words[end:]
            elif joint is None:
                raise RecordingError(f"line {number}: {words[0][:40]!r} is outside of the skeleton")
            elif key == "}":
                parent = joint.parent
                words = words[1:]
            elif key == "OFFSET" and joint.offset is None:
                count = 6 if words[4:] and words[4][0] in "+-.0123456789" else 3
                joint.offset = numbers(number, "OFFSET", words[1 : count + 1], count)
                words = words[count + 1 :]
            elif key == "CHANNELS" and joint.channels is None and joint.name is not None:
                joint.channels, words = _channels(number, words[1:])
                joint.first = tree.columns
                tree.columns += len(joint.channels)
            else:
                where = joint.name or "an end site"
                raise RecordingError(f"line {number}: did not expect {words[0][:40]!r} in {where}")
    raise RecordingError("the line MOTION is missing: is the file cut off?")


def _joint(tree: BvhHierarchy, line: int, words: list[str], parent: int) -> BvhJoint:
    """Return the joint that begins with these words, such as "JOINT Spine"."""
    is_root = words[0].upper() == "ROOT"
    name = " ".join(words[1:])
    above = tree.joints[parent] if parent >= 0 else None
    depth = 1 if above is None else above.depth + 1
    fault = ""
    if is_root and above is None and tree.joints:
        fault = (
            "a second ROOT: more than one person, or a file of several skeletons, cannot be read"
        )
    elif is_root != (above is None):
        fault = f"{words[0]} {'within' if is_root else 'outside of'} a joint"
    elif not name:
        fault = f"{words[0]} without a name"
    elif above is not None and above.name is None:
        fault = "an end site has no joints"
    elif depth > _DEEPEST:
        fault = f"more than {_DEEPEST} joints within each other"
    if fault:
        raise RecordingError(f"line {line}: {fault}")
    return BvhJoint(line, None if words[0].upper() == "END" else name, parent, depth)


def _channels(line: int, words: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return names of the channels in lower case, and the words after them."""
    count = words[0] if words else ""
    if not (count.isdecimal() and len(count) == 1 and int(count) <= len(_CHANNELS)):
        raise RecordingError(f"line {line}: CHANNELS needs a number up to 6, has {count!r}")
    names = tuple(word.lower() for word in words[1 : int(count) + 1])
    if len(names) < int(count) or not set(names) <= set(_CHANNELS) or len(set(names)) < len(names):
        raise RecordingError(
            f"line {line}: CHANNELS {count} must be followed by {count} different names "
            f"such as Xposition or Zrotation, is followed by {' '.join(words[1:])[:80]!r}"
        )
    return names, words[int(count) + 1 :]


def _check_complete(tree: BvhHierarchy, line: int, unclosed: BvhJoint | None) -> None:
    if not tree.joints:
        raise RecordingError(f"line {line}: MOTION, but there is no joint")
    if unclosed is not None:
        raise RecordingError(
            f"line {line}: MOTION, but the joint {unclosed.name} is not closed by '}}'"
        )
    for joint in tree.joints:
        name = joint.name or "the end site"
        if joint.offset is None:
            raise RecordingError(f"line {joint.line}: {name} has no OFFSET")
        if joint.channels is None and joint.name is not None:
            raise RecordingError(f"line {joint.line}: {name} has no CHANNELS")
    if not tree.columns:
        raise RecordingError("no joint has CHANNELS")


_SHORTEST_FRAME = 1e-6  # [s]


def read_bvh(
    file: Path,
    convention: SkeletonConvention | str | Path | None = None,
    unit: str | float | None = None,
    up: str | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments, and with the unit of length the pose of the trunk.

    Rotations of a joint are multiplied in the order of its channels, in degrees:
    "Zrotation Xrotation Yrotation" is R = Rz Rx Ry. Position channels replace the offset of the
    joint along their axes. The rest pose is that of the offsets: rotations are zero there, or the
    last three of the six numbers of an offset. Its axes follow the convention or are found from it.

    Args:
        convention: which joints carry which segments; the known one that fits best by default.
        unit: unit of lengths, "m", "cm", "mm", "in" or metres; the format has none, and without it
            there is no pose of the trunk.
        up: vertical axis of the space, such as "y"; by default that of the rest pose.

    Raises:
        RecordingError: the hierarchy is malformed, there are more or fewer frames than stated, or
            a skeleton that no convention fits; the message names the line where there is one.
    """
    with named_failures(file):
        chosen = as_skeleton_convention(convention)
        metres = metres_per_unit(unit, chosen)
        lines = read_lines(file)
        hierarchy = read_hierarchy(lines)
        period, values = _motion(lines, hierarchy)
        if metres is not None:
            _check_positions(hierarchy, values)
        motion = _skeleton_motion(hierarchy, period, values)
        return skeleton_segments(motion, chosen, metres, up=up)


def _skeleton_motion(hierarchy: BvhHierarchy, period: float, values: Array) -> SkeletonMotion:
    joints = hierarchy.joints
    given = [np.array(joint.offset)[:3] for joint in joints]
    # Of the joints' axes in the rest pose, to which a Skeleton's are parallel.
    rest = {-1: np.eye(3)}
    for index, joint in enumerate(joints):
        rest[index] = rest[joint.parent] @ _resting(joint)
    offsets = np.array([rest[joint.parent] @ given[i] for i, joint in enumerate(joints)])

    def rotation(index: int) -> Array:
        axes, columns = joints[index].columns("rotation")
        turned = successive_rotations(axes, np.radians(values[:, columns])) if axes else np.eye(3)
        parallel: Array = rest[joints[index].parent] @ turned @ rest[index].T
        return parallel

    def position(index: int) -> Array:
        axes, columns = joints[index].columns("position")
        positions: Array = np.tile(given[index], (len(values), 1))
        positions[:, ["xyz".index(axis) for axis in axes]] = values[:, columns]
        parallel: Array = positions @ rest[joints[index].parent].T
        return parallel

    hinges = {
        index: rest[index][:, "xyz".index(axes)]
        for index, joint in enumerate(joints)
        if len(axes := joint.columns("rotation")[0]) == 1
    }
    names, parents = zip(*((joint.name or "", joint.parent) for joint in joints), strict=True)
    skeleton = Skeleton(names, parents, offsets, hinges)
    time = period * np.arange(len(values), dtype=np.float64)
    return SkeletonMotion(skeleton, time, rotation, position)


def _resting(joint: BvhJoint) -> Array:
    """Return the rotation (3, 3) of a joint relative to its parent in the rest pose."""
    axes, _ = joint.columns("rotation")
    angles = (joint.offset or [])[3:]
    if not axes or not angles:
        return np.eye(3)
    turned = np.radians([[angles["xyz".index(axis)] for axis in axes]])
    rotation: Array = successive_rotations(axes, turned)[0]
    return rotation


def _motion(lines: list[str], tree: BvhHierarchy) -> tuple[float, Array]:
    """Return duration of a frame [s], and the values (k, columns) of all channels."""
    stated: dict[str, tuple[int, float]] = {}
    values: list[float] = []
    for number, line in enumerate(lines[tree.end + 1 :], start=tree.end + 2):
        if not line.strip():
            continue
        if len(stated) < 2:
            key, _, value = line.partition(":")
            key = " ".join(key.split()).title()
            expected = "Frame Time" if stated else "Frames"
            if key != expected:
                raise RecordingError(
                    f"line {number}: expected '{expected}:', found {line.strip()[:40]!r}"
                )
            stated[key] = number, numbers(number, key.capitalize(), value.split(), 1)[0]
            continue
        words = line.split()
        values += numbers(number, "the frame", words, len(words))
    for key in ("Frames", "Frame Time"):
        if key not in stated:
            raise RecordingError(f"'{key}:' is missing after MOTION")
    at, count = stated["Frames"]
    rows, rest = divmod(len(values), tree.columns)
    if rest or rows != count:
        more = f" and {rest} numbers more" if rest else ""
        raise RecordingError(
            f"line {at}: {count:g} frames of {tree.columns} channels are stated, there are "
            f"{rows}{more}: is the file cut off? If it is whole, correct this line"
        )
    at, period = stated["Frame Time"]
    if not period >= _SHORTEST_FRAME:
        raise RecordingError(f"line {at}: a frame cannot last {period:g} s")
    return period, np.array(values).reshape(rows, tree.columns)


def _check_positions(tree: BvhHierarchy, values: Array) -> None:
    """Raise RecordingError if position channels below the root do not contain the offset."""
    for joint in tree.joints:
        axes, columns = joint.columns("position")
        if joint.parent < 0 or not axes or joint.offset is None:
            continue
        offset = np.array([joint.offset["xyz".index(axis)] for axis in axes])
        given = np.median(values[:, columns], axis=0)
        if np.linalg.norm(given - offset) > np.linalg.norm(given):
            raise RecordingError(
                f"line {joint.line}: the positions of {joint.name} are "
                f"{given.round(4).tolist()}, its offset is {offset.tolist()}: positions that are "
                "added to the offset are not supported; without a unit they are not needed"
            )
