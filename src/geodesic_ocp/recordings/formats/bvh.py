"""BVH: a hierarchy of joints and its motion."""

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
from geodesic_ocp.recordings.formats.text_lines import numbers, read_lines

_CHANNELS = tuple(f"{axis}{what}" for what in ("rotation", "position") for axis in "xyz")
_DEEPEST = 200  # joints from the root to the end of a limb


@dataclass(eq=False)
class BvhJoint:
    """A joint of the hierarchy.

    Attributes:
        line: on which it begins.
        name: None for an end site.
        parent: index of its parent; -1 for the root.
        offset: (3,), in the file's unit.
        channels: names in lower case, such as "zrotation", in the order of the file.
        first: column of its first channel.
    """

    line: int
    name: str | None
    parent: int
    offset: list[float] | None = None
    channels: tuple[str, ...] | None = None
    first: int = 0

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


def read_hierarchy(file: Path, lines: list[str]) -> BvhHierarchy:
    """Read everything before the line MOTION.

    Raises:
        RecordingError: the hierarchy is malformed; the message names the line.
    """
    tree = BvhHierarchy()
    parent, opened, begun = -1, True, False
    for index, line in enumerate(lines):
        number = index + 1
        words = line.replace("{", " { ").replace("}", " } ").split()
        if words and not begun:
            if words[0].upper() != "HIERARCHY":
                raise RecordingError(
                    f"{file}: line {number}: a BVH begins with HIERARCHY, not {line.strip()[:40]!r}"
                )
            begun, words = True, words[1:]
        while words:
            key = words[0].upper()
            if not opened and key != "{":
                raise RecordingError(f"{file}: line {number}: expected '{{', found {words[0]!r}")
            joint = tree.joints[parent] if parent >= 0 else None
            if key == "MOTION":
                _check_complete(file, tree, number, parent)
                tree.end = index
                return tree
            if key == "{":
                if opened:
                    raise RecordingError(f"{file}: line {number}: '{{' without a joint")
                opened, words = True, words[1:]
            elif key in ("ROOT", "JOINT", "END"):
                end = words.index("{") if "{" in words else len(words)
                name = " ".join(words[1:end])
                if (key == "ROOT") != (parent < 0) or (key == "ROOT" and tree.joints):
                    raise RecordingError(
                        f"{file}: line {number}: "
                        + (
                            "a second ROOT: more than one person, or a file of several skeletons, "
                            "cannot be read"
                            if key == "ROOT" and parent < 0
                            else f"{words[0]} {'within' if key == 'ROOT' else 'outside of'} a joint"
                        )
                    )
                if not name or (joint is not None and joint.name is None):
                    raise RecordingError(
                        f"{file}: line {number}: "
                        + ("an end site has no joints" if name else f"{words[0]} without a name")
                    )
                tree.joints.append(BvhJoint(number, None if key == "END" else name, parent))
                parent, opened, words = len(tree.joints) - 1, False, words[end:]
                _check_depth(file, tree, parent)
            elif joint is None:
                raise RecordingError(
                    f"{file}: line {number}: {words[0][:40]!r} is outside of the skeleton"
                )
            elif key == "}":
                parent, words = joint.parent, words[1:]
            elif key == "OFFSET" and joint.offset is None:
                joint.offset = numbers(file, number, "OFFSET", words[1:4], 3)
                words = words[4:]
            elif key == "CHANNELS" and joint.channels is None and joint.name is not None:
                joint.channels, words = _channels(file, number, words[1:])
                joint.first = tree.columns
                tree.columns += len(joint.channels)
            else:
                raise RecordingError(
                    f"{file}: line {number}: did not expect {words[0][:40]!r} in "
                    f"{joint.name or 'an end site'}"
                )
    raise RecordingError(f"{file}: the line MOTION is missing: is the file cut off?")


def _channels(file: Path, line: int, words: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return names of the channels in lower case, and the words after them."""
    count = words[0] if words else ""
    if not (count.isdecimal() and len(count) == 1 and int(count) <= len(_CHANNELS)):
        raise RecordingError(f"{file}: line {line}: CHANNELS needs a number up to 6, has {count!r}")
    names = tuple(word.lower() for word in words[1 : int(count) + 1])
    if len(names) < int(count) or not set(names) <= set(_CHANNELS) or len(set(names)) < len(names):
        raise RecordingError(
            f"{file}: line {line}: CHANNELS {count} must be followed by {count} different names "
            f"such as Xposition or Zrotation, is followed by {' '.join(words[1:])[:80]!r}"
        )
    return names, words[int(count) + 1 :]


def _check_depth(file: Path, tree: BvhHierarchy, joint: int) -> None:
    depth, line = 0, tree.joints[joint].line
    while joint >= 0:
        depth, joint = depth + 1, tree.joints[joint].parent
    if depth > _DEEPEST:
        raise RecordingError(f"{file}: line {line}: more than {_DEEPEST} joints within each other")


def _check_complete(file: Path, tree: BvhHierarchy, line: int, parent: int) -> None:
    if not tree.joints:
        raise RecordingError(f"{file}: line {line}: MOTION, but there is no joint")
    if parent >= 0:
        name = tree.joints[parent].name
        raise RecordingError(
            f"{file}: line {line}: MOTION, but the joint {name} is not closed by '}}'"
        )
    for joint in tree.joints:
        for what, given in (("OFFSET", joint.offset), ("CHANNELS", joint.channels)):
            if given is None and (what == "OFFSET" or joint.name is not None):
                raise RecordingError(
                    f"{file}: line {joint.line}: {joint.name or 'the end site'} has no {what}"
                )
    if not tree.columns:
        raise RecordingError(f"{file}: no joint has CHANNELS")


_SHORTEST_FRAME = 1e-6  # [s]


def read_bvh(
    file: Path,
    convention: SkeletonConvention | str | Path | None = None,
    unit: str | float | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments, and with the unit of length the pose of the trunk.

    Rotations of a joint are multiplied in the order of its channels, in degrees:
    "Zrotation Xrotation Yrotation" is R = Rz Rx Ry. Position channels replace the offset of the
    joint along their axes. Axes and the rest pose, in which all channels are zero, follow the
    convention or are found from the offsets.

    Args:
        file: the .bvh.
        convention: which joints carry which segments; the known one that fits best by default.
        unit: unit of lengths, "m", "cm", "mm", "in" or metres; the format has none, and without it
            there is no pose of the trunk.

    Raises:
        RecordingError: the hierarchy is malformed, there are more or fewer frames than stated, or
            a skeleton that no convention fits; the message names the line where there is one.
    """
    chosen = as_skeleton_convention(convention)
    lines = read_lines(file)
    hierarchy = read_hierarchy(file, lines)
    period, values = _motion(file, lines, hierarchy)
    joints = hierarchy.joints
    names = [joint.name or "" for joint in joints]
    offsets = np.array([joint.offset for joint in joints])
    unit = unit if unit is not None else chosen.unit if chosen is not None else None
    if unit is not None:
        _check_positions(file, hierarchy, values)

    def rotation(index: int) -> Array:
        axes, columns = joints[index].columns("rotation")
        if not axes:
            return np.eye(3)
        return successive_rotations(axes, np.radians(values[:, columns]))

    def position(index: int) -> Array:
        axes, columns = joints[index].columns("position")
        offset: Array = offsets[index]
        if not axes:
            return offset
        positions: Array = np.tile(offset, (len(values), 1))
        positions[:, ["xyz".index(axis) for axis in axes]] = values[:, columns]
        return positions

    hinges = {
        index: np.eye(3)["xyz".index(axes)]
        for index, joint in enumerate(joints)
        if len(axes := joint.columns("rotation")[0]) == 1
    }
    parents = tuple(joint.parent for joint in joints)
    skeleton = Skeleton(tuple(names), parents, offsets, hinges)
    time = period * np.arange(len(values), dtype=np.float64)
    motion = SkeletonMotion(skeleton, time, rotation, position)
    metres = metres_per_unit(unit) if unit is not None else None
    return skeleton_segments(file, motion, chosen, metres)


def _motion(file: Path, lines: list[str], tree: BvhHierarchy) -> tuple[float, Array]:
    """Return duration of a frame [s], and the values (k, columns) of all channels."""
    stated: dict[str, tuple[int, float]] = {}
    values: list[float] = []
    for number, line in enumerate(lines[tree.end + 1 :], start=tree.end + 2):
        if not line.strip():
            continue
        if len(stated) < 2:
            key, _, value = line.partition(":")
            key = " ".join(key.lower().split())
            if key != ("frame time" if stated else "frames"):
                expected = "Frame Time:" if stated else "Frames:"
                raise RecordingError(
                    f"{file}: line {number}: expected {expected!r}, found {line.strip()[:40]!r}"
                )
            stated[key] = number, numbers(file, number, key.capitalize(), value.split(), 1)[0]
            continue
        words = line.split()
        values += numbers(file, number, "the frame", words, len(words))
    for key in ("frames", "frame time"):
        if key not in stated:
            raise RecordingError(f"{file}: '{key.title()}:' is missing after MOTION")
    at, count = stated["frames"]
    rows, rest = divmod(len(values), tree.columns)
    if rest or rows != count:
        raise RecordingError(
            f"{file}: line {at}: {count:g} frames of {tree.columns} channels are stated, there "
            f"are {rows}"
            + (f" and {rest} numbers more" if rest else "")
            + ": is the file cut off? If it is whole, correct this line"
        )
    at, period = stated["frame time"]
    if not period >= _SHORTEST_FRAME:
        raise RecordingError(f"{file}: line {at}: a frame cannot last {period:g} s")
    return period, np.array(values).reshape(rows, tree.columns)


def _check_positions(file: Path, tree: BvhHierarchy, values: Array) -> None:
    """RecordingError if position channels below the root do not contain the offset."""
    for joint in tree.joints:
        axes, columns = joint.columns("position")
        if joint.parent < 0 or not axes or joint.offset is None:
            continue
        offset = np.array([joint.offset["xyz".index(axis)] for axis in axes])
        given = np.median(values[:, columns], axis=0)
        if np.linalg.norm(given - offset) > np.linalg.norm(given):
            raise RecordingError(
                f"{file}: line {joint.line}: the positions of {joint.name} are "
                f"{given.round(4).tolist()}, its offset is {offset.tolist()}: positions that are "
                "added to the offset are not supported; without a unit they are not needed"
            )
