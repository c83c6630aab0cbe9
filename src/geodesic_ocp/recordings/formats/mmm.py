"""Motions in the Master Motor Map's XML, in the legacy layout and in that of version 2.0.

Legacy: Motion / JointOrder / Joint, Motion / MotionFrames / MotionFrame with Timestep and
JointPosition. Version 2.0: Motion / Sensors / Sensor of type Kinematic with Configuration / Joint
and Data / Measurement. The legacy files' JointVelocity is often all zeros and is not read. The
trunk is read where the file has the root's pose, the joints of the trunk and the person's height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.mmm_trunk import TRUNK_JOINTS, root_motion, thorax_motion
from geodesic_ocp.recordings.formats.xml_root import xml_root
from geodesic_ocp.trajectory.motion import FrameMotion, Motion, Subject

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
    """The single source of the legacy layout, or every kinematic sensor of version 2.0."""
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
    """The poses of the pelvis at these times; None if the file does not have them at all of them.

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
