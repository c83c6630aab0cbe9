"""Motions in Acclaim's AMC, with the skeleton of an ASF beside it."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.formats.skeletons.asf import AcclaimSkeleton, bone_rotations, read_asf
from geodesic_ocp.recordings.formats.skeletons.text_lines import numbers, read_lines
from geodesic_ocp.recordings.skeletons.read_skeleton_convention import as_skeleton_convention
from geodesic_ocp.recordings.skeletons.skeleton import SkeletonMotion
from geodesic_ocp.recordings.skeletons.skeleton_convention import (
    SkeletonConvention,
    metres_per_unit,
)
from geodesic_ocp.recordings.skeletons.skeleton_segments import skeleton_segments
from geodesic_ocp.recordings.units import ANGLES
from geodesic_ocp.trajectory.motion import Subject

_SLOWEST = 1e-3  # [Hz]
CMU_RATE = 120.0  # [Hz], of the CMU database; the format has no rate


def read_amc(
    file: Path,
    skeleton: str | PathLike[str] | None = None,
    rate: float | None = None,
    convention: SkeletonConvention | str | Path | None = None,
    unit: str | float | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments, and the pose of the trunk, from a motion and its skeleton.

    The subject is named after the skeleton's file.

    Args:
        file: the .amc.
        skeleton: the .asf; by default the one in the same folder of the same name, or of its part
            before "_" (02.asf of 02_05.amc), or the only one there.
        rate: frames per second [Hz]; by default that of the file's line ':samples-per-second', or
            else 120 Hz, that of the CMU database.
        convention: which bones carry which segments; the known one that fits best by default.
        unit: of lengths, "m", "cm", "mm", "in" or metres; by default that of the skeleton.

    Raises:
        RecordingError: there is no skeleton, either file is malformed, or the frames do not give
            every bone of the skeleton; the message names file and line.
        ValueError: a rate that is not positive.
    """
    chosen = as_skeleton_convention(convention)
    lines = read_lines(file)
    start, angle, stated = _header(file, lines)
    person = _skeleton(file, skeleton)
    acclaim = read_asf(person)
    angle = angle if angle is not None else acclaim.angle
    if angle is None:
        raise RecordingError(f"{file}: neither ':DEGREES' nor ':RADIANS' is stated")
    values = _frames(file, lines, start, acclaim)
    hertz = as_positive("rate", rate, "Hz") if rate is not None else stated or CMU_RATE
    names = acclaim.skeleton.names
    moves = [acclaim.dofs["root"].index(axis) for axis in ("tx", "ty", "tz")]
    turns = [column for column in range(6) if column not in moves]
    turning = replace(
        acclaim, dofs={**acclaim.dofs, "root": tuple(acclaim.dofs["root"][i] for i in turns)}
    )

    def rotation(joint: int) -> Array:
        name = names[joint]
        if name not in values:
            return np.eye(3)
        angles = angle * (values[name] if name != "root" else values[name][:, turns])
        return bone_rotations(turning, name, angles)

    def position(joint: int) -> Array:
        offset: Array = acclaim.skeleton.offsets[joint]
        return values["root"][:, moves] if joint == 0 else offset

    motion = SkeletonMotion(
        acclaim.skeleton, np.arange(len(values["root"])) / hertz, rotation, position
    )
    unit = unit if unit is not None else chosen.unit if chosen is not None else None
    metres = metres_per_unit(unit) if unit is not None else acclaim.unit
    return skeleton_segments(file, motion, chosen, metres, Subject(name=person.stem))


def _skeleton(file: Path, given: str | PathLike[str] | None) -> Path:
    """The skeleton's file."""
    if given is not None:
        return Path(given)
    try:
        found = sorted(each for each in file.parent.iterdir() if each.suffix.lower() == ".asf")
    except OSError as failure:
        raise RecordingError(f"{file}: its folder cannot be read: {failure.strerror}") from None
    stems = [file.stem.lower(), file.stem.lower().partition("_")[0]]
    for stem in stems:
        for each in found:
            if each.stem.lower() == stem:
                return each
    if len(found) == 1:
        return found[0]
    there = ", ".join(each.name for each in found[:10]) if found else "no .asf"
    raise RecordingError(
        f"{file}: an AMC needs its skeleton, an .asf: state skeleton=... (--skeleton), or put "
        f"{stems[-1]}.asf into the same folder, where there is {there}"
    )


def _header(file: Path, lines: list[str]) -> tuple[int, float | None, float | None]:
    """Index of the first line of frames, unit of angles [rad] and rate [Hz], if stated."""
    angle, rate = None, None
    for index, line in enumerate(lines):
        words = line.partition("#")[0].lower().split()
        if not words:
            continue
        if words[0] in (":degrees", ":radians"):
            angle = ANGLES[words[0][1:]]
        elif words[0] == ":samples-per-second":
            (rate,) = numbers(file, index + 1, "the rate", words[1:], 1)
            if rate < _SLOWEST:
                raise RecordingError(f"{file}: line {index + 1}: the rate is {rate:g} Hz")
        elif words[0] in (":version", ":root", ":bonedata", ":units"):
            raise RecordingError(
                f"{file}: line {index + 1}: this is a skeleton (ASF); read the motion (AMC) of it"
            )
        elif words[0].isdecimal() and len(words) == 1:
            return index, angle, rate
        elif words[0] != ":fully-specified":
            raise RecordingError(
                f"{file}: line {index + 1}: expected ':FULLY-SPECIFIED', ':DEGREES', ':RADIANS' or "
                f"the number of a frame, found {line.strip()[:40]!r}"
            )
    raise RecordingError(f"{file}: there are no frames in this AMC")


def _frames(file: Path, lines: list[str], start: int, acclaim: AcclaimSkeleton) -> dict[str, Array]:
    """Numbers (k, dofs) by bone; every frame gives every bone once."""
    dofs = acclaim.dofs
    rows: dict[str, list[list[float]]] = {name: [] for name in dofs}
    frame, frame_line, count = 0, 0, 0

    def check_complete() -> None:
        for name, row in rows.items():
            if len(row) < count:
                raise RecordingError(f"{file}: line {frame_line}: frame {frame} has no {name}")

    for number, line in enumerate(lines[start:], start=start + 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        name, given = words[0], words[1:]
        if name in rows:
            if len(rows[name]) == count:
                raise RecordingError(f"{file}: line {number}: {name} comes twice in frame {frame}")
            rows[name].append(numbers(file, number, name, given, len(dofs[name])))
        elif name.isdecimal() and not given:
            check_complete()
            if len(name) > 9 or (count and int(name) != frame + 1):
                raise RecordingError(
                    f"{file}: line {number}: frame {name[:12]} follows frame {frame}"
                )
            frame, frame_line, count = int(name), number, count + 1
        elif name in acclaim.skeleton.names:
            raise RecordingError(
                f"{file}: line {number}: {name} has no degrees of freedom in the skeleton"
            )
        else:
            raise RecordingError(f"{file}: line {number}: the skeleton has no bone {name[:40]!r}")
    check_complete()
    return {name: np.array(row) for name, row in rows.items()}
