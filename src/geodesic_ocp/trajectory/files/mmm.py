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

from collections.abc import Iterator, Sequence
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
from geodesic_ocp.trajectory.files.text_lines import named_failures, numbers
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
    rotations = np.array(root.rotations)
    positions = np.array(root.positions)
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


def read_mmm(file: Path, joints: Sequence[str] | None = None) -> Motion:
    """Read the first motion in the file that has these joints (all joints, if none are given).

    Raises:
        RecordingError: the XML is broken, is not MMM, or has no such joints or no frames.
    """
    with named_failures(file):
        root = xml_root(file)
        motions = root.findall("Motion") if root.tag == "MMM" else []
        if not motions:
            raise RecordingError(
                f"expected <MMM> with a <Motion>, found <{root.tag}>: not an MMM recording"
            )
        wanted = list(joints or ())
        missing = []
        for motion in motions:
            for names, time, positions in _sources(motion):
                missing = [name for name in wanted if name not in names]
                if names and not missing:
                    return _motion(motion, names, time, positions, wanted or names)
        if not missing:
            raise RecordingError("no <Motion> in it names any joints")
        raise RecordingError(f"there is no joint {', '.join(missing)} in this recording")


@dataclass(frozen=True)
class Texts:
    """Texts of one kind in the frames of a recording, None where a frame has none."""

    what: str  # what they are, for messages
    frame: str  # what a frame is called there
    texts: list[str | None]  # one a frame

    def numbers(self, count: int) -> Array:
        """Return `count` numbers of every frame, (k, count)."""
        if None in self.texts:
            others = ", others have" if any(self.texts) else ""
            where = f"{self.frame} {self.texts.index(None)}"
            raise RecordingError(f"{where} has no {self.what}{others}")
        rows = [
            numbers(None, f"the {self.what} of {self.frame} {index}", (text or "").split(), count)
            for index, text in enumerate(self.texts)
        ]
        return np.array(rows).reshape(len(rows), count)


def _sources(motion: ElementTree.Element) -> Iterator[tuple[list[str], Texts, Texts]]:
    """Yield names of joints, times and positions: of the legacy layout, or of every kinematic
    sensor of version 2.0.
    """
    sensors = motion.findall("Sensors/Sensor[@type='Kinematic']")
    for source in sensors or [motion]:
        joints = source.findall("Configuration/Joint" if sensors else "JointOrder/Joint")
        name = "Measurement" if sensors else "MotionFrame"
        frames = source.findall("Data/Measurement" if sensors else "MotionFrames/MotionFrame")
        times = [each.get("timestep") if sensors else each.findtext("Timestep") for each in frames]
        positions = [each.findtext("JointPosition") for each in frames]
        yield (
            [joint.get("name", "") for joint in joints],
            Texts("time", name, times),
            Texts("JointPosition", name, positions),
        )


def _motion(
    motion: ElementTree.Element,
    names: list[str],
    time: Texts,
    positions: Texts,
    wanted: list[str],
) -> Motion:
    subject = _subject(motion)
    times = time.numbers(1)[:, 0]
    q = positions.numbers(len(names))

    def columns(joints: Sequence[str]) -> Array:
        return q[:, [names.index(name) for name in joints]]

    result = Motion(times, columns(wanted), tuple(wanted), subject=subject)
    if subject.height is None or not set(TRUNK_JOINTS) <= set(names):
        return result
    if (root := _root(motion, result.time)) is None:
        return result
    return replace(result, trunk=thorax_motion(root, columns(TRUNK_JOINTS), subject.height))


def _root(motion: ElementTree.Element, time: Array) -> FrameMotion | None:
    """Return the poses of the pelvis at these times; None if the file does not have them at all of
    them.

    Version 2.0 has them in a sensor of their own, with times of their own.
    """
    sensor = motion.find("Sensors/Sensor[@type='ModelPose']")
    legacy = motion.findall("MotionFrames/MotionFrame")
    frames = legacy if sensor is None else sensor.findall("Data/Measurement")
    found = [
        Texts(name, "frame", [frame.findtext(name) for frame in frames])
        for name in ("RootPosition", "RootRotation")
    ]
    if not any(text is not None for each in found for text in each.texts):
        return None
    root = root_motion(*(each.numbers(3) for each in found))
    if sensor is None:
        return root
    own = Texts("time", "frame", [frame.get("timestep") for frame in frames]).numbers(1)[:, 0]
    if np.array_equal(own, time):
        return root
    covered = own.size > 1 and own[0] <= time[0] and own[-1] >= time[-1]
    return root.interpolated(own, time) if covered and np.all(np.diff(own) > 0.0) else None


def _subject(motion: ElementTree.Element) -> Subject:
    config = next(motion.iter("ModelProcessorConfig"), None)
    values: dict[str, float | None] = {"Height": None, "Mass": None}
    for name in values:
        text = None if config is None else config.findtext(name)
        if text is not None:
            (number,) = numbers(None, f"ModelProcessorConfig/{name}", text.split(), 1)
            if number <= 0.0:
                raise RecordingError(f"{name} of the subject must be positive, is {number}")
            values[name] = number
    return Subject(values["Height"], values["Mass"], motion.get("name", ""))
