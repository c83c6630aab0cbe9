"""The sections of an ASF file, and the bones in them; errors name the line (RecordingError)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.skeletons.text_lines import numbers
from geodesic_ocp.recordings.units import ANGLES

_INCH = 0.0254  # [m]
_SHORTEST = 1e-9  # length of a direction
_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
Lines = list[tuple[int, list[str]]]  # number of the line and its words


@dataclass
class AcclaimBone:
    """What the file says of a bone, and the line on which it begins."""

    line: int
    name: str = ""
    direction: list[float] = field(default_factory=list)
    length: float | None = None
    axis: list[float] = field(default_factory=list)
    order: str = "XYZ"
    dofs: tuple[str, ...] = ()


def read_sections(file: Path, lines: list[str]) -> dict[str, Lines]:
    """Lines by section; what stands after the section's own word is its first line."""
    sections: dict[str, Lines] = {}
    current: Lines | None = None
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


def read_units(file: Path, lines: Lines) -> tuple[float | None, float | None]:
    """Metres and radians in the units of length and of angles, None where they are not stated."""
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


def read_root(file: Path, lines: Lines) -> AcclaimBone:
    """The root, as a bone of no length that can also be moved."""
    bone = AcclaimBone(lines[0][0] if lines else 0, "root", [0.0, 1.0, 0.0], 0.0, [0.0] * 3)
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


def read_bones(file: Path, lines: Lines) -> list[AcclaimBone]:
    """The bones in the order of the file."""
    bones: list[AcclaimBone] = []
    bone: AcclaimBone | None = None
    for number, words in lines:
        key, given = words[0].lower(), words[1:]
        if key == "begin":
            if bone is not None:
                raise RecordingError(f"{file}: line {number}: 'begin' before the 'end' of a bone")
            bone = AcclaimBone(number)
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


def _checked(file: Path, bone: AcclaimBone) -> AcclaimBone:
    """The bone, if all is known of it."""
    for what, given in (
        ("name", bone.name),
        ("direction", math.hypot(*bone.direction) > _SHORTEST),
        ("length", bone.length is not None and bone.length >= 0.0),
        ("axis", bone.axis),
    ):
        if not given:
            raise RecordingError(
                f"{file}: line {bone.line}: bone {bone.name} has no {what}, or an invalid one"
            )
    return bone


def read_parents(
    file: Path, lines: Lines, bones: Mapping[str, AcclaimBone]
) -> dict[str, tuple[str, int]]:
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
