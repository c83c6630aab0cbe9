"""Skeletons in Acclaim's ASF, such as those of the CMU Graphics Lab Motion Capture Database."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import successive_rotations
from geodesic_ocp.recordings.formats.units import ANGLES
from geodesic_ocp.recordings.skeletons.skeleton import Skeleton
from geodesic_ocp.recordings.skeletons.text_lines import numbers, read_lines

_INCH = 0.0254  # [m]
_SHORTEST = 1e-9  # length of a direction
_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


@dataclass(frozen=True, eq=False, repr=False)
class AcclaimSkeleton:
    """A skeleton of bones, and how the numbers of a motion turn them.

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


@dataclass
class _Bone:
    """What the file says of a bone, and the line on which it begins."""

    line: int
    name: str = ""
    direction: list[float] = field(default_factory=list)
    length: float | None = None
    axis: list[float] = field(default_factory=list)
    order: str = "XYZ"
    dofs: tuple[str, ...] = ()


def read_asf(file: Path) -> AcclaimSkeleton:
    """Read an Acclaim skeleton; limits, masses and skins in it are passed over.

    Lengths are in inches divided by the unit `length`, as the CMU database's answers to frequent
    questions give it (with length 0.45, metres are value / 0.45 * 0.0254). Directions are scaled
    to unit length.

    Raises:
        RecordingError: the file is malformed, or has bones that change their length or are moved,
            or a root that is turned in the rest pose; the message names the line.
    """
    lines = read_lines(file)
    sections = _sections(file, lines)
    unit, angle = _units(file, sections.get("units", []))
    root = _root(file, sections["root"])
    bones = {"root": root}
    for bone in _bones(file, sections["bonedata"]):
        if bone.name in bones:
            raise RecordingError(f"{file}: line {bone.line}: there are two bones {bone.name}")
        bones[bone.name] = bone
    parents = _parents(file, sections["hierarchy"], bones)
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


_Lines = list[tuple[int, list[str]]]  # number of the line and its words


def _sections(file: Path, lines: list[str]) -> dict[str, _Lines]:
    """Lines by section; what stands after the section's own word is its first line."""
    sections: dict[str, _Lines] = {}
    current: _Lines | None = None
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0].startswith(":"):
            name = words[0][1:].lower()
            if name in sections:
                raise RecordingError(f"{file}: line {number}: a second section :{name}")
            current = sections[name] = []
            words = words[1:]
        elif current is None:
            raise RecordingError(f"{file}: line {number}: no section of an ASF: {line[:40]!r}")
        if words and current is not None:
            current.append((number, words))
    for name in ("root", "bonedata", "hierarchy"):
        if name not in sections:
            raise RecordingError(f"{file}: an ASF needs the section :{name}")
    return sections


def _units(file: Path, lines: _Lines) -> tuple[float | None, float | None]:
    unit, angle = None, None
    for number, words in lines:
        key = words[0].lower()
        if key == "length":
            (value,) = numbers(file, number, "the unit of length", words[1:], 1)
            if value <= 0.0:
                raise RecordingError(f"{file}: line {number}: the unit of length is {value:g}")
            unit = _INCH / value
        elif key == "angle":
            angle = ANGLES.get(" ".join(words[1:]).lower())
            if angle is None:
                raise RecordingError(
                    f"{file}: line {number}: the unit of angles must be deg or rad, not "
                    f"{' '.join(words[1:])[:40]!r}"
                )
    return unit, angle


def _root(file: Path, lines: _Lines) -> _Bone:
    bone = _Bone(lines[0][0] if lines else 0, "root", [0.0, 1.0, 0.0], 0.0, [0.0] * 3)
    for number, words in lines:
        key, given = words[0].lower(), words[1:]
        if key == "order":
            bone.dofs = tuple(word.lower() for word in given)
            if sorted(bone.dofs) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
                raise RecordingError(
                    f"{file}: line {number}: the order of the root must consist of TX TY TZ RX RY "
                    f"RZ, is {' '.join(given)!r}"
                )
        elif key == "axis":
            bone.order = _order(file, number, given[-1:])
        elif key in ("position", "orientation"):
            values = numbers(file, number, f"the {key} of the root", given, 3)
            if any(values):
                raise RecordingError(
                    f"{file}: line {number}: a root whose {key} in the rest pose is not 0 0 0 is "
                    "not supported"
                )
    if not bone.dofs:
        raise RecordingError(f"{file}: the section :root does not state an order, TX TY TZ RX ...")
    return bone


def _order(file: Path, line: int, words: list[str]) -> str:
    order = words[0].upper() if words else ""
    if order not in _ORDERS:
        raise RecordingError(
            f"{file}: line {line}: the order of axes must be one of {', '.join(_ORDERS)}, is "
            f"{order!r}"
        )
    return order


def _bones(file: Path, lines: _Lines) -> list[_Bone]:
    bones: list[_Bone] = []
    bone: _Bone | None = None
    for number, words in lines:
        key, given = words[0].lower(), words[1:]
        if key == "begin":
            if bone is not None:
                raise RecordingError(f"{file}: line {number}: 'begin' before the 'end' of a bone")
            bone = _Bone(number)
        elif bone is None:
            raise RecordingError(f"{file}: line {number}: {words[0]!r} is outside of a bone")
        elif key == "end":
            bones.append(_checked(file, bone))
            bone = None
        elif key == "name":
            bone.name = " ".join(given)
        elif key == "direction":
            bone.direction = numbers(file, number, "the direction", given, 3)
        elif key == "length":
            (bone.length,) = numbers(file, number, "the length", given, 1)
        elif key == "axis":
            bone.axis = numbers(file, number, "the axis", given[:3], 3)
            bone.order = _order(file, number, given[3:])
        elif key == "dof":
            bone.dofs = tuple(word.lower() for word in given)
            if not set(bone.dofs) <= {"rx", "ry", "rz"} or len(set(bone.dofs)) < len(bone.dofs):
                raise RecordingError(
                    f"{file}: line {number}: the degrees of freedom of {bone.name or 'a bone'} are "
                    f"{' '.join(given)!r}; only rotations rx, ry and rz are supported, each once"
                )
        elif not re.match(r"id$|limits|\(|bodymass$|cofmass$", key):
            raise RecordingError(f"{file}: line {number}: {words[0]!r} is not known of a bone")
    if bone is not None:
        raise RecordingError(f"{file}: line {bone.line}: the bone has no 'end'")
    return bones


def _checked(file: Path, bone: _Bone) -> _Bone:
    """The bone, if all is known of it."""
    for what, given in (
        ("name", bone.name),
        ("direction", np.linalg.norm(bone.direction) > _SHORTEST),
        ("length", bone.length is not None and bone.length >= 0.0),
        ("axis", bone.axis),
    ):
        if not given:
            raise RecordingError(
                f"{file}: line {bone.line}: bone {bone.name} has no {what}, or an invalid one"
            )
    return bone


def _parents(file: Path, lines: _Lines, bones: Mapping[str, _Bone]) -> dict[str, tuple[str, int]]:
    """The parent of each bone but the root, and the line that says so."""
    parents: dict[str, tuple[str, int]] = {}
    for number, words in lines:
        if words[0].lower() in ("begin", "end"):
            continue
        for name in words:
            if name not in bones:
                raise RecordingError(f"{file}: line {number}: there is no bone {name!r}")
        for child in words[1:]:
            if child in parents or child == "root":
                raise RecordingError(f"{file}: line {number}: {child} has two parents")
            parents[child] = words[0], number
    return parents
