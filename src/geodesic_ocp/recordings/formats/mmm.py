"""MMM XML of the Master Motor Map, legacy and version 2.0: joint angles and the trunk.

A recording has the pose of the root, which is the pelvis: RootPosition [mm] and RootRotation, roll,
pitch and yaw [rad] about fixed axes. The joints of the trunk lead from there to the thorax, in the
reference model scaled by the person's height. Of take_book_from_shelf_right_arm_02 of the KIT
database, the markers at C7 and CLAV are then 26 and 12 mm from where the model has them; with the
angles about axes that turn with the pelvis it would be 43 and 22 mm.

Legacy: Motion / JointOrder / Joint, Motion / MotionFrames / MotionFrame with Timestep and
JointPosition. Version 2.0: Motion / Sensors / Sensor of type Kinematic with Configuration / Joint
and Data / Measurement. The legacy files' JointVelocity is often all zeros and is not read. The
trunk is read where the file has the root's pose, the joints of the trunk and the person's height.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.trajectory.motion import FrameMotion, Motion, Subject

#: The joints of the trunk, from the pelvis to the thorax.
TRUNK_JOINTS = tuple(f"B{part}{axis}_joint" for part in "PT" for axis in "xzy")
_MILLIMETRE = 1e-3  # [m]


def root_motion(positions: Array, angles: Array) -> FrameMotion:
    """Return the poses of the pelvis from RootPosition [mm] and RootRotation [rad], (k, 3) each.

    Raises:
        ValueError: a pose is not finite.
    """
    finite = np.isfinite(positions).all(axis=1) & np.isfinite(angles).all(axis=1)
    if not finite.all():
        raise ValueError(f"the pose of the root is not finite at sample {int(np.argmin(finite))}")
    turned = scipy.spatial.transform.Rotation.from_euler("xyz", angles)
    return FrameMotion(turned.as_matrix(), _MILLIMETRE * positions)


def thorax_motion(root: FrameMotion, angles: Array, height: float) -> FrameMotion:
    """Return the poses of the thorax, its origin midway between the shoulders.

    Args:
        root: poses of the pelvis.
        angles: angles of `TRUNK_JOINTS` (k, 6) [rad].
        height: height of the person [m].
    """
    rotation = scipy.spatial.transform.Rotation
    lengths = trunk()
    rotations, positions = np.array(root.rotations), np.array(root.positions)
    steps = (lengths.pelvis, angles[:, :3]), (lengths.abdomen.length, angles[:, 3:])
    for length, turned in steps:
        positions += height * length * rotations[:, :, 2]
        rotations = rotations @ rotation.from_euler("XZY", turned).as_matrix()
    positions += height * lengths.thorax.length * rotations[:, :, 2]
    return FrameMotion(rotations, positions)


def xml_root(file: Path) -> ElementTree.Element:
    """Return the root element of an XML file without entities.

    Raises:
        RecordingError: the XML is broken, or defines entities, which can expand to more than memory
            holds; names the line.
        OSError: the file cannot be read.
    """
    try:
        _refuse_entities(file)
        return ElementTree.parse(file).getroot()
    except ElementTree.ParseError as failure:
        line, column = failure.position
        reason = str(failure).partition(": line ")[0]  # which names the place once more
        raise RecordingError(
            f"{file}: broken XML at line {line}, column {column}: {reason}; is the file cut off?"
        ) from None
    except RecordingError:
        raise
    except (LookupError, ValueError) as failure:
        raise RecordingError(f"{file}: broken XML: {failure}") from None


def _refuse_entities(file: Path) -> None:
    parser = expat.ParserCreate()

    def refuse(name: str, *_: object) -> None:
        raise RecordingError(
            f"{file}: line {parser.CurrentLineNumber} defines the entity {name!r}, which is not "
            "supported"
        )

    parser.EntityDeclHandler = refuse
    with file.open("rb") as stream, suppress(expat.ExpatError):  # reported by ElementTree
        parser.ParseFile(stream)


_ROOT = ("RootPosition", "RootRotation")


def read_mmm(file: Path, joints: Sequence[str] | None = None) -> Motion:
    """Read the first motion in the file that has these joints (all joints, if none are given).

    Raises:
        RecordingError: the XML is broken, is not MMM, or has no such joints or no frames.
    """
    root = xml_root(file)
    motions = root.findall("Motion") if root.tag == "MMM" else []
    if not motions:
        raise RecordingError(
            f"{file}: expected <MMM> with a <Motion>, found <{root.tag}>: not an MMM recording"
        )
    wanted, missing = list(joints or ()), []
    for motion in motions:
        for source in _sources(motion):
            names = [joint.get("name", "") for joint in source.joints]
            missing = [name for name in wanted if name not in names]
            if names and not missing:
                return _motion(file, motion, source, names, wanted or names)
    if not missing:
        raise RecordingError(f"{file}: no <Motion> in it names any joints")
    raise RecordingError(f"{file}: there is no joint {', '.join(missing)} in this recording")


@dataclass(frozen=True)
class _Source:
    """Joints, and the frames of their positions: (name in messages, time, positions)."""

    joints: list[ElementTree.Element]
    frames: list[tuple[str, str | None, str | None]]


def _sources(motion: ElementTree.Element) -> list[_Source]:
    """Return the single source of the legacy layout, or every kinematic sensor of version 2.0."""
    sensors = motion.findall("Sensors/Sensor[@type='Kinematic']")
    if not sensors:
        frames = [
            (f"MotionFrame {index}", frame.findtext("Timestep"), frame.findtext("JointPosition"))
            for index, frame in enumerate(motion.findall("MotionFrames/MotionFrame"))
        ]
        return [_Source(motion.findall("JointOrder/Joint"), frames)]
    return [
        _Source(
            sensor.findall("Configuration/Joint"),
            [
                (f"Measurement {index}", frame.get("timestep"), frame.findtext("JointPosition"))
                for index, frame in enumerate(sensor.findall("Data/Measurement"))
            ],
        )
        for sensor in sensors
    ]


def _motion(
    file: Path,
    motion: ElementTree.Element,
    source: _Source,
    names: list[str],
    wanted: list[str],
) -> Motion:
    columns = [names.index(name) for name in wanted]
    times, rows = [], []
    for frame, time, positions in source.frames:
        if time is None or positions is None:
            raise RecordingError(
                f"{file}: {frame} has no {'time' if time is None else 'positions'}"
            )
        times.append(_numbers(file, f"the time of {frame}", time, 1)[0])
        row = _numbers(file, f"the JointPosition of {frame}", positions, len(names))
        rows.append(row)
    subject = _subject(file, motion)
    shaped = np.array(rows).reshape(len(times), len(names))
    try:
        result = Motion(np.array(times), shaped[:, columns], tuple(wanted), subject=subject)
        if subject.height is not None and set(TRUNK_JOINTS) <= set(names):
            root = _root(file, motion, result.time)
            if root is not None:
                angles = shaped[:, [names.index(name) for name in TRUNK_JOINTS]]
                result = replace(result, trunk=thorax_motion(root, angles, subject.height))
        return result
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _root(file: Path, motion: ElementTree.Element, time: Array) -> FrameMotion | None:
    """Return the poses of the pelvis at these times; None if the file does not have them at all of
    them.

    Version 2.0 has them in a sensor of their own, with times of their own.
    """
    sensor = motion.find("Sensors/Sensor[@type='ModelPose']")
    frames = (
        motion.findall("MotionFrames/MotionFrame")
        if sensor is None
        else sensor.findall("Data/Measurement")
    )
    found = {name: [frame.findtext(name) for frame in frames] for name in _ROOT}
    if not frames or all(text is None for texts in found.values() for text in texts):
        return None
    values = {}
    for name, texts in found.items():
        if None in texts:
            raise RecordingError(f"{file}: frame {texts.index(None)} has no {name}, others have")
        values[name] = np.array(
            [
                _numbers(file, f"the {name} of frame {index}", text or "", 3)
                for index, text in enumerate(texts)
            ]
        )
    root = root_motion(*values.values())
    if sensor is None:
        return root
    stamps = [frame.get("timestep", "") for frame in frames]
    own = np.concatenate(
        [_numbers(file, f"the time of root {i}", text, 1) for i, text in enumerate(stamps)]
    )
    if np.array_equal(own, time):
        return root
    covered = own.size > 1 and own[0] <= time[0] and own[-1] >= time[-1]
    return root.interpolated(own, time) if covered and np.all(np.diff(own) > 0.0) else None


def _subject(file: Path, motion: ElementTree.Element) -> Subject:
    config = next(motion.iter("ModelProcessorConfig"), None)
    values: dict[str, float | None] = {"Height": None, "Mass": None}
    for name in values:
        text = None if config is None else config.findtext(name)
        if text is not None:
            number = float(_numbers(file, f"ModelProcessorConfig/{name}", text, 1)[0])
            if not np.isfinite(number) or number <= 0.0:
                raise RecordingError(f"{file}: {name} of the subject must be positive, is {number}")
            values[name] = number
    return Subject(values["Height"], values["Mass"], motion.get("name", ""))


def _numbers(file: Path, element: str, text: str, count: int) -> Array:
    try:
        numbers = np.array(text.split(), dtype=float)
    except ValueError:
        raise RecordingError(
            f"{file}: {element} does not consist of numbers: {text.strip()[:40]!r}"
        ) from None
    if numbers.size != count:
        raise RecordingError(f"{file}: {element} has {numbers.size} numbers, expected {count}")
    return numbers
