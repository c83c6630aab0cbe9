"""Skeletons in Acclaim's ASF, such as those of the CMU Graphics Lab Motion Capture Database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.formats.skeletons.asf_bones import (
    read_bones,
    read_parents,
    read_root,
    read_sections,
    read_units,
)
from geodesic_ocp.recordings.formats.skeletons.text_lines import read_lines
from geodesic_ocp.recordings.skeletons.skeleton import Skeleton


@dataclass(frozen=True, eq=False, repr=False)
class AcclaimSkeleton:
    """A skeleton of bones, and how the values of a motion rotate them.

    Attributes:
        skeleton: one joint a bone, at its start; the first is "root".
        dofs: by bone, the numbers that a motion gives, such as ("rx", "rz"); bones without any
            are left out.
        orders: by bone, in which order the rotations are applied: "XYZ" turns about x first, so
            that M = Rz Ry Rx.
        frames: by bone, the axes C (3, 3) about which it turns: its rotation is C M C'.
        unit: metres per unit of length, or None if the file states none.
        angle: radians per unit of angle, or None.
    """

    skeleton: Skeleton
    dofs: Mapping[str, tuple[str, ...]]
    orders: Mapping[str, str]
    frames: Mapping[str, Array]
    unit: float | None
    angle: float | None

    def __repr__(self) -> str:
        return f"AcclaimSkeleton({self.skeleton!r})"


def read_asf(file: Path) -> AcclaimSkeleton:
    """Read an Acclaim skeleton; limits, masses and skins in it are not read.

    Lengths are in inches divided by the unit `length`, as the CMU database's answers to frequent
    questions give it (with length 0.45, metres are value / 0.45 * 0.0254). Directions are scaled
    to unit length.

    Raises:
        RecordingError: the file is malformed, or has bones that change their length or are moved,
            or a root that is turned in the rest pose; the message names the line.
    """
    lines = read_lines(file)
    sections = read_sections(file, lines)
    unit, angle = read_units(file, sections.get("units", []))
    root = read_root(file, sections["root"])
    bones = {"root": root}
    for bone in read_bones(file, sections["bonedata"]):
        if bone.name in bones:
            raise RecordingError(f"{file}: line {bone.line}: there are two bones {bone.name}")
        bones[bone.name] = bone
    parents = read_parents(file, sections["hierarchy"], bones)
    # Parents come before their children.
    names = ["root"]
    for name in names:
        names += [child for child, (parent, _) in parents.items() if parent == name]
    for name, bone in bones.items():
        if name not in names:
            raise RecordingError(
                f"{file}: line {bone.line}: the hierarchy does not connect {name} with the root"
            )
    ends = {"root": np.zeros(3)}
    for name in names[1:]:
        direction, length = np.array(bones[name].direction), bones[name].length
        ends[name] = direction / np.linalg.norm(direction) * float(length or 0.0)
    offsets = np.array([np.zeros(3)] + [ends[parents[name][0]] for name in names[1:]])
    if any(any(bone.axis) for bone in bones.values()) and angle is None:
        raise RecordingError(f"{file}: ':units' does not state 'angle deg' or 'angle rad'")
    frames, hinges = {}, {}
    for index, name in enumerate(names):
        bone = bones[name]
        frames[name] = _rotation(bone.order, (angle or 0.0) * np.array([bone.axis]))[0]
        if len(bone.dofs) == 1:
            hinges[index] = frames[name][:, "xyz".index(bone.dofs[0][1])]
    order = tuple(-1 if name == "root" else names.index(parents[name][0]) for name in names)
    return AcclaimSkeleton(
        Skeleton(tuple(names), order, offsets, hinges),
        {name: bones[name].dofs for name in names if bones[name].dofs},
        {name: bones[name].order for name in names},
        frames,
        unit,
        angle,
    )


def _rotation(order: str, angles: Array) -> Array:
    """(k, 3, 3) from angles (k, 3) about x, y, z [rad], applied in the order of these letters."""
    columns = ["XYZ".index(letter) for letter in order[::-1]]
    return successive_rotations(order[::-1].lower(), angles[:, columns])


def bone_rotations(skeleton: AcclaimSkeleton, bone: str, angles: Array) -> Array:
    """Rotations (k, 3, 3) of a bone relative to its parent, from its angles (k, dofs) [rad]."""
    every = np.zeros((len(angles), 3))
    for column, dof in enumerate(skeleton.dofs[bone]):
        every[:, "xyz".index(dof[1])] = angles[:, column]
    frame = skeleton.frames[bone]
    result: Array = frame @ _rotation(skeleton.orders[bone], every) @ frame.T
    return result
