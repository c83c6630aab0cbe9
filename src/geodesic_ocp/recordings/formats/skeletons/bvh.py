"""Motions in Biovision's BVH."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.formats.skeletons.bvh_hierarchy import BvhHierarchy, read_hierarchy
from geodesic_ocp.recordings.formats.skeletons.text_lines import numbers, read_lines
from geodesic_ocp.recordings.skeletons.read_skeleton_convention import as_skeleton_convention
from geodesic_ocp.recordings.skeletons.skeleton import Skeleton, SkeletonMotion
from geodesic_ocp.recordings.skeletons.skeleton_convention import (
    SkeletonConvention,
    metres_per_unit,
)
from geodesic_ocp.recordings.skeletons.skeleton_segments import skeleton_segments

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
        unit: of lengths, "m", "cm", "mm", "in" or metres; the format has none, and without it
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
    """Duration of a frame [s], and the values (k, columns) of all channels."""
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
