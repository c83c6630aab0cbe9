"""ASF/AMC, Acclaim's skeletons and motions; messages name the line."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
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
from geodesic_ocp.trajectory.files.text_lines import ANGLES, named_failures, numbers, read_lines
from geodesic_ocp.trajectory.motion import Subject

_INCH = 0.0254  # [m]
_SHORTEST = 1e-9  # length of a direction
_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
Lines = list[tuple[int, list[str]]]  # number of the line and its words


@dataclass
class AcclaimBone:
    """A bone's description in the file, and the line on which it begins."""

    line: int  # number of the line
    name: str = ""
    direction: list[float] = field(default_factory=list)  # direction in the rest pose (3,)
    length: float = -1.0  # length in the file's unit
    # angles (3,) of the axes about which the bone turns, in the file's unit
    axis: list[float] = field(default_factory=list)
    order: str = "XYZ"  # order of the rotations; "XYZ" turns about x first, so that M = Rz Ry Rx
    # degrees of freedom, the numbers that a motion gives, such as ("rx", "rz")
    dofs: tuple[str, ...] = ()

    def rotations(self, values: Array, dofs: tuple[str, ...]) -> Array:
        """Return rotations M (k, 3, 3) from values (k, n) of degrees of freedom [rad]."""
        axes = self.order[::-1].lower()
        angles = np.zeros((len(values), 3))
        for column, dof in enumerate(dofs):
            if dof[0] == "r":
                angles[:, axes.index(dof[1])] = values[:, column]
        return successive_rotations(axes, angles)


def read_sections(lines: list[str]) -> dict[str, Lines]:
    """Return lines by section; what stands after the section's own word is its first line."""
    sections: dict[str, Lines] = {}
    current: Lines | None = None
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0].startswith(":"):
            name = words[0][1:].lower()
            if name in sections:
                raise RecordingError(f"line {number}: a second section :{name}")
            current = sections[name] = []
            words = words[1:]
        elif current is None:
            raise RecordingError(f"line {number}: no section of an ASF: {line[:40]!r}")
        if words and current is not None:
            current.append((number, words))
    for name in ("root", "bonedata", "hierarchy"):
        if name not in sections:
            raise RecordingError(f"an ASF needs the section :{name}")
    return sections


def read_units(lines: Lines) -> tuple[float | None, float | None]:
    """Return metres and radians in the units of length and of angles, None where they are not
    stated.
    """
    unit = None
    angle = None
    for number, words in lines:
        key = words[0].lower()
        given = " ".join(words[1:])
        if key == "length":
            (value,) = numbers(number, "the unit of length", words[1:], 1)
            if value <= 0.0:
                raise RecordingError(f"line {number}: the unit of length is {value:g}")
            unit = _INCH / value
        elif key == "angle":
            angle = ANGLES.get(given.lower())
            if angle is None:
                raise RecordingError(
                    f"line {number}: the unit of angles must be deg or rad, not {given[:40]!r}"
                )
    return unit, angle


def read_root(lines: Lines) -> AcclaimBone:
    """Return the root, as a bone of no length that can also be moved."""
    bone = AcclaimBone(lines[0][0] if lines else 0, "root", [0.0, 1.0, 0.0], 0.0, [0.0] * 3)
    for number, words in lines:
        key = words[0].lower()
        given = words[1:]
        if key == "order":
            bone.dofs = tuple(word.lower() for word in given)
            if sorted(bone.dofs) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
                raise RecordingError(
                    f"line {number}: the order of the root must consist of TX TY TZ RX RY RZ, is "
                    f"{' '.join(given)!r}"
                )
        elif key == "axis":
            bone.order = _order(number, given[-1:])
        elif key in ("position", "orientation") and any(
            numbers(number, f"the {key} of the root", given, 3)
        ):
            raise RecordingError(
                f"line {number}: a root whose {key} in the rest pose is not 0 0 0 is not supported"
            )
    if not bone.dofs:
        raise RecordingError("the section :root does not state an order, TX TY TZ RX ...")
    return bone


def _order(line: int, words: list[str]) -> str:
    order = words[0].upper() if words else ""
    if order not in _ORDERS:
        raise RecordingError(
            f"line {line}: the order of axes must be one of {', '.join(_ORDERS)}, is {order!r}"
        )
    return order


def read_bones(lines: Lines) -> list[AcclaimBone]:
    """Return the bones in the order of the file."""
    bones: list[AcclaimBone] = []
    bone: AcclaimBone | None = None
    for number, words in lines:
        key = words[0].lower()
        given = words[1:]
        if key == "begin":
            if bone is not None:
                raise RecordingError(f"line {number}: 'begin' before the 'end' of a bone")
            bone = AcclaimBone(number)
        elif bone is None:
            raise RecordingError(f"line {number}: {words[0]!r} is outside of a bone")
        elif key == "end":
            _check_complete(bone)
            bones.append(bone)
            bone = None
        elif key == "name":
            bone.name = " ".join(given)
        elif key == "direction":
            bone.direction = numbers(number, "the direction", given, 3)
        elif key == "length":
            (bone.length,) = numbers(number, "the length", given, 1)
        elif key == "axis":
            bone.axis = numbers(number, "the axis", given[:3], 3)
            bone.order = _order(number, given[3:])
        elif key == "dof":
            bone.dofs = tuple(word.lower() for word in given)
            if not set(bone.dofs) <= {"rx", "ry", "rz"} or len(set(bone.dofs)) < len(bone.dofs):
                raise RecordingError(
                    f"line {number}: the degrees of freedom of {bone.name or 'a bone'} are "
                    f"{' '.join(given)!r}; only rotations rx, ry and rz are supported, each once"
                )
        elif not re.match(r"id$|limits|\(|bodymass$|cofmass$", key):
            raise RecordingError(f"line {number}: {words[0]!r} is not known of a bone")
    if bone is not None:
        raise RecordingError(f"line {bone.line}: the bone has no 'end'")
    return bones


def _check_complete(bone: AcclaimBone) -> None:
    for what, given in (
        ("name", bone.name),
        ("direction", math.hypot(*bone.direction) > _SHORTEST),
        ("length", bone.length >= 0.0),
        ("axis", bone.axis),
    ):
        if not given:
            raise RecordingError(
                f"line {bone.line}: bone {bone.name} has no {what}, or an invalid one"
            )


def read_parents(lines: Lines, bones: Mapping[str, AcclaimBone]) -> dict[str, str]:
    """Return the parent of each bone but the root."""
    parents: dict[str, str] = {}
    for number, words in lines:
        if words[0].lower() in ("begin", "end"):
            continue
        for name in words:
            if name not in bones:
                raise RecordingError(f"line {number}: there is no bone {name!r}")
        for child in words[1:]:
            if child in parents or child == "root":
                raise RecordingError(f"line {number}: {child} has two parents")
            parents[child] = words[0]
    return parents


@dataclass(frozen=True, eq=False)
class AcclaimSkeleton:
    """A skeleton of bones, and how the values of a motion rotate them."""

    skeleton: Skeleton  # one joint a bone, at its start; the first is "root"
    bones: tuple[AcclaimBone, ...]  # the bones in the same order
    frames: tuple[Array, ...]  # axes C (3, 3) about which each bone turns: its rotation is C M C'
    unit: float | None  # metres per unit of length, or None if the file states none
    angle: float | None  # radians per unit of angle, or None


def read_asf(file: Path) -> AcclaimSkeleton:
    """Read an Acclaim skeleton; limits, masses and skins in it are not read.

    Lengths are in inches divided by the unit `length`, as the CMU database's answers to frequent
    questions give it (with length 0.45, metres are value / 0.45 * 0.0254). Directions are scaled
    to unit length.

    Raises:
        RecordingError: the file is malformed, or has bones that change their length or are moved,
            or a root that is turned in the rest pose; the message names the line.
    """
    with named_failures(file):
        sections = read_sections(read_lines(file))
        unit, angle = read_units(sections.get("units", []))
        root = read_root(sections["root"])
        bones = {"root": root}
        for bone in read_bones(sections["bonedata"]):
            if bone.name in bones:
                raise RecordingError(f"line {bone.line}: there are two bones {bone.name}")
            bones[bone.name] = bone
        parents = read_parents(sections["hierarchy"], bones)
        names = ["root"]  # parents before their children
        for name in names:
            names += [child for child, parent in parents.items() if parent == name]
        for name, bone in bones.items():
            if name not in names:
                raise RecordingError(
                    f"line {bone.line}: the hierarchy does not connect {name} with the root"
                )
        if any(any(bone.axis) for bone in bones.values()) and angle is None:
            raise RecordingError("':units' does not state 'angle deg' or 'angle rad'")
    ordered = tuple(bones[name] for name in names)
    above = (-1, *(names.index(parents[name]) for name in names[1:]))
    ends = [
        np.array(bone.direction) / math.hypot(*bone.direction) * bone.length for bone in ordered
    ]
    offsets = np.array([np.zeros(3), *(ends[parent] for parent in above[1:])])
    frames = []
    hinges = {}
    for index, bone in enumerate(ordered):
        frames.append(bone.rotations((angle or 0.0) * np.array([bone.axis]), ("rx", "ry", "rz"))[0])
        if len(bone.dofs) == 1:
            hinges[index] = frames[index][:, "xyz".index(bone.dofs[0][1])]
    skeleton = Skeleton(tuple(names), above, offsets, hinges)
    return AcclaimSkeleton(skeleton, ordered, tuple(frames), unit, angle)


_SLOWEST = 1e-3  # [Hz]
CMU_RATE = 120.0  # [Hz], of the CMU database; the format has no rate


def read_amc(
    file: Path,
    skeleton: str | PathLike[str] | None = None,
    rate: float | None = None,
    convention: SkeletonConvention | str | Path | None = None,
    unit: str | float | None = None,
    up: str | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments, and the pose of the trunk, from a motion and its skeleton.

    The subject is named after the skeleton's file.

    Args:
        skeleton: the .asf; by default the one in the same folder of the same name, or of its part
            before "_" (02.asf of 02_05.amc), or the only one there.
        rate: frames per second [Hz]; by default that of the file's line ':samples-per-second', or
            else 120 Hz, that of the CMU database.
        convention: which bones carry which segments; the known one that fits best by default.
        unit: unit of lengths, "m", "cm", "mm", "in" or metres; by default that of the skeleton.
        up: vertical axis of the space, such as "y"; by default that of the rest pose.

    Raises:
        RecordingError: there is no skeleton, either file is malformed, the frames do not give
            every bone of the skeleton, or the rate is not positive; the message names file and
            line.
    """
    with named_failures(file):
        lines = read_lines(file)
        start, angle, stated = _header(lines)
        person = Path(skeleton) if skeleton is not None else _skeleton_beside(file)
    acclaim = read_asf(person)
    with named_failures(file):
        chosen = as_skeleton_convention(convention)
        angle = angle if angle is not None else acclaim.angle
        if angle is None:
            raise RecordingError("neither ':DEGREES' nor ':RADIANS' is stated")
        values = _frames(lines, start, acclaim)
        hertz = as_positive("rate", rate, "Hz") if rate is not None else stated or CMU_RATE
        motion = _skeleton_motion(acclaim, values, angle, hertz)
        metres = metres_per_unit(unit, chosen) or acclaim.unit
        return skeleton_segments(motion, chosen, metres, Subject(name=person.stem), up=up)


def _skeleton_motion(
    acclaim: AcclaimSkeleton, values: dict[str, Array], angle: float, rate: float
) -> SkeletonMotion:
    moves = [acclaim.bones[0].dofs.index(axis) for axis in ("tx", "ty", "tz")]

    def rotation(joint: int) -> Array:
        bone = acclaim.bones[joint]
        frame = acclaim.frames[joint]
        if not bone.dofs:
            return np.eye(3)
        turned: Array = frame @ bone.rotations(angle * values[bone.name], bone.dofs) @ frame.T
        return turned

    def position(joint: int) -> Array:
        offset: Array = acclaim.skeleton.offsets[joint]
        return values["root"][:, moves] if joint == 0 else offset

    time = np.arange(len(values["root"])) / rate
    return SkeletonMotion(acclaim.skeleton, time, rotation, position)


def _skeleton_beside(file: Path) -> Path:
    """Return the skeleton's file in the same folder."""
    try:
        found = sorted(each for each in file.parent.iterdir() if each.suffix.lower() == ".asf")
    except OSError as failure:
        raise RecordingError(f"its folder cannot be read: {failure.strerror}") from None
    stems = [file.stem.lower(), file.stem.lower().partition("_")[0]]
    for stem in stems:
        for each in found:
            if each.stem.lower() == stem:
                return each
    if len(found) == 1:
        return found[0]
    there = ", ".join(each.name for each in found[:10]) or "no .asf"
    raise RecordingError(
        f"an AMC needs its skeleton, an .asf: state skeleton=... (--skeleton), or put "
        f"{stems[-1]}.asf into the same folder, where there is {there}"
    )


def _header(lines: list[str]) -> tuple[int, float | None, float | None]:
    """Return index of the first line of frames, unit of angles [rad] and rate [Hz], if stated."""
    angle = None
    rate = None
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].lower().split()
        if not words:
            continue
        if words[0] in (":degrees", ":radians"):
            angle = ANGLES[words[0][1:]]
        elif words[0] == ":samples-per-second":
            (rate,) = numbers(number, "the rate", words[1:], 1)
            if rate < _SLOWEST:
                raise RecordingError(f"line {number}: the rate is {rate:g} Hz")
        elif words[0] in (":version", ":root", ":bonedata", ":units"):
            raise RecordingError(
                f"line {number}: this is a skeleton (ASF); read the motion (AMC) of it"
            )
        elif words[0].isdecimal() and len(words) == 1:
            return number - 1, angle, rate
        elif words[0] != ":fully-specified":
            raise RecordingError(
                f"line {number}: expected ':FULLY-SPECIFIED', ':DEGREES', ':RADIANS' or "
                f"the number of a frame, found {line.strip()[:40]!r}"
            )
    raise RecordingError("there are no frames in this AMC")


def _frames(lines: list[str], start: int, acclaim: AcclaimSkeleton) -> dict[str, Array]:
    """Return numbers (k, dofs) by bone; every frame gives every bone once."""
    dofs = {bone.name: len(bone.dofs) for bone in acclaim.bones if bone.dofs}
    rows: dict[str, list[list[float]]] = {name: [] for name in dofs}
    frame = 0
    frame_line = 0
    count = 0

    def check_complete() -> None:
        for name, row in rows.items():
            if len(row) < count:
                raise RecordingError(f"line {frame_line}: frame {frame} has no {name}")

    for number, line in enumerate(lines[start:], start=start + 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        name = words[0]
        given = words[1:]
        if name in rows:
            if len(rows[name]) == count:
                raise RecordingError(f"line {number}: {name} comes twice in frame {frame}")
            rows[name].append(numbers(number, name, given, dofs[name]))
        elif name.isdecimal() and not given:
            check_complete()
            if len(name) > 9 or (count and int(name) != frame + 1):
                raise RecordingError(f"line {number}: frame {name[:12]} follows frame {frame}")
            frame = int(name)
            frame_line = number
            count = count + 1
        elif name in acclaim.skeleton.names:
            raise RecordingError(f"line {number}: {name} has no degrees of freedom in the skeleton")
        else:
            raise RecordingError(f"line {number}: the skeleton has no bone {name[:40]!r}")
    check_complete()
    return {name: np.array(row) for name, row in rows.items()}
