"""MVNX of Xsens MVN: the orientations and positions of a person's segments, in XML.

The frames of type "normal" are the motion: for every segment a unit quaternion (w, x, y, z), which
turns its axes into those of the space, and the position of its origin, the joint before it
[m]; without positions there is no pose of the trunk. Joints say how segments are connected; files
without them are read by MVN's names of segments. The T pose, from which orientations are
counted, is the frame of type "identity" or "tpose". Joint angles, sensors, fingers and props are
not read.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.conventions.skeleton_convention import (
    SkeletonConvention,
    as_skeleton_convention,
)
from geodesic_ocp.recordings.conventions.skeleton_segments import (
    Skeleton,
    SkeletonMotion,
    skeleton_segments,
)
from geodesic_ocp.trajectory.files.mmm import Texts, xml_root
from geodesic_ocp.trajectory.files.text_lines import (
    SAME_RATE,
    named_failures,
    rate_of,
    stated_rate,
    times_at,
)
from geodesic_ocp.trajectory.motion import Subject

_REST = ("identity", "tpose")
# Segments of MVN, and those before each from the nearest to the pelvis (Xsens MVN user manual).
_SPINE = ("T8", "T12", "L3", "L5", "Pelvis")
_LIMBS = (
    ("Head", "Neck", *_SPINE),
    *(
        (f"{s}Hand", f"{s}ForeArm", f"{s}UpperArm", f"{s}Shoulder", *_SPINE)
        for s in ("Right", "Left")
    ),
    *((f"{s}Toe", f"{s}Foot", f"{s}LowerLeg", f"{s}UpperLeg", "Pelvis") for s in ("Right", "Left")),
)
_BEFORE = {name: limb[k + 1 :] for limb in _LIMBS for k, name in enumerate(limb)}
_LATE = 0.01  # [s] by which two times of a frame may differ, beside a part of them
_UNIT = 0.01  # by which the length of a quaternion may differ from one
_FARTHEST = 1e5  # [m]
# Directions of bones of so many metres by positions and by orientations, and how far they differ.
_LONG = 0.15  # [m], [deg]
_APART = 10.0  # [m], [deg]


def read_mvnx(
    file: Path,
    convention: SkeletonConvention | str | Path | None = None,
    rate: float | None = None,
) -> SegmentOrientations:
    """Read the orientations of segments and the pose of the trunk of the person in an MVNX file.

    Args:
        convention: another one than that of MVN's names of segments.
        rate: rate of the frames [Hz], if the file has neither times nor frameRate.

    Raises:
        RecordingError: the XML is broken or has not one person, a frame lacks numbers, there is no
            T pose, or positions and orientations contradict each other.
    """
    with named_failures(file):
        root = xml_root(file)
        subjects = root.findall("{*}subject")
        if len(subjects) != 1:
            raise RecordingError(
                f"<{root.tag.rpartition('}')[2]}> has {len(subjects)} <subject>; MVNX with one "
                "is read: export each person by itself"
            )
        subject = subjects[0]
        names = [each.get("label", "") for each in subject.findall("{*}segments/{*}segment")]
        if not names:
            raise RecordingError(
                "there is no <segment> in <segments>: export MVNX with the body segments"
            )
        frames = subject.findall("{*}frames/{*}frame")
        kinds = [frame.get("type", "normal") for frame in frames]
        rest = next((frames[kinds.index(kind)] for kind in _REST if kind in kinds), None)
        if rest is None:
            raise RecordingError(
                "there is no <frame> of type identity or tpose, which give the T pose; export it "
                "with the calibration frames"
            )
        moving = [frame for frame, kind in zip(frames, kinds, strict=True) if kind == "normal"]
        if len(moving) < 2:
            raise RecordingError(f"a motion needs two <frame> of type normal, has {len(moving)}")
        if not any(frame.find("{*}orientation") is not None for frame in moving):
            held = ", ".join(dict.fromkeys(each.tag.rpartition("}")[2] for each in moving[0]))
            raise RecordingError(
                f"no <frame> has an <orientation>, only {held or 'nothing'}: export MVNX with the "
                "orientations of the segments"
            )
        has_places = any(frame.find("{*}position") is not None for frame in moving)
        motion = _motion(
            names,
            _parents(subject, names),
            _time(file, subject, moving, given=rate),
            (_rotations([rest], "T pose", len(names)), _places([rest], "T pose", len(names))),
            _rotations(moving, "frame", len(names)),
            _places(moving, "frame", len(names)) if has_places else None,
        )
        person = Subject(name=subject.get("label", ""))
        chosen = as_skeleton_convention(convention)
        metres = 1.0 if has_places else None
        return skeleton_segments(motion, chosen, metres, person)


def _parents(subject: Element, names: list[str]) -> tuple[int, ...]:
    """Return the index of the segment before each: joints connect "Pelvis/jL5S1" to "L5/jL5S1".

    Without joints they are those of MVN's segments.
    """
    parents = [-1] * len(names)
    joints = subject.findall("{*}joints/{*}joint")
    if not joints:
        for index, name in enumerate(names):
            nearer = _BEFORE.get(name, ())
            parents[index] = next((names.index(each) for each in nearer if each in names), -1)
            if parents[index] > index:
                raise RecordingError(
                    f"there is no <joint> in <joints>, and the segment {name} does not come after "
                    f"{names[parents[index]]}, as in MVN's list: export MVNX with the joints"
                )
        if not {*names} & {*_BEFORE}:
            raise RecordingError(
                "there is no <joint> in <joints>, and the segments are not MVN's but "
                f"{', '.join(names)}: export MVNX with the joints"
            )
    for joint in joints:
        ends = [joint.findtext(f"{{*}}connector{k}", "").partition("/")[0] for k in (1, 2)]
        if not set(ends) <= set(names):
            raise RecordingError(f"the joint {joint.get('label')} connects {' and '.join(ends)}")
        before, after = map(names.index, ends)
        if before >= after:
            raise RecordingError(f"the segment {ends[1]} must come after {ends[0]}")
        parents[after] = before
    return tuple(parents)


def _time(file: Path, subject: Element, frames: list[Element], *, given: float | None) -> Array:
    """Return times [s]: by the index of each frame and frameRate, or those in milliseconds."""
    rate = subject.get("frameRate")
    steps = {"time": 1e-3}
    if rate is not None:
        steps["index"] = 1.0 / as_positive("frameRate", float(rate), "Hz")
    times = {}
    for name, step in steps.items():
        if all(frame.get(name) for frame in frames):
            texts = Texts(name, "frame", [frame.get(name) for frame in frames])
            with np.errstate(over="ignore", invalid="ignore"):  # of damaged files
                times[name] = step * (texts.numbers(1) - texts.numbers(1)[:1])[:, 0]
    if not times and given is not None:
        return times_at(len(frames), given)
    if not times:
        raise RecordingError(
            "frames have neither time nor index with a frameRate, nor is there rate (--sample-rate)"
        )
    if len(times) == 2:
        ends = [float(each[-1]) for each in times.values()]
        if not abs(ends[0] - ends[1]) <= _LATE + SAME_RATE * abs(ends[0]):
            raise RecordingError(
                f"the last frame is at {ends[0]:g} s by its time, at {ends[1]:g} s by its index "
                f"and frameRate {rate}"
            )
    time = times["index" if "index" in times else "time"]
    stated_rate(file, rate_of(time), given)
    return time


def _vectors(frames: list[Element], what: str, name: str, shape: tuple[int, int]) -> Array:
    texts = Texts(name, what, [each.findtext(f"{{*}}{name}") for each in frames])
    return texts.numbers(shape[0] * shape[1]).reshape(len(frames), *shape)


def _check(good: NDArray[np.bool_], what: str, name: str, values: Array) -> None:
    for frame, segment in np.argwhere(~good)[:1].tolist():
        given = values[frame, segment].tolist()
        raise RecordingError(f"the {name} of segment {segment} in {what} {frame} is {given}")


def _rotations(frames: list[Element], what: str, count: int) -> Array:
    """Return rotations (k, n, 3, 3) of the segments."""
    quaternions = _vectors(frames, what, "orientation", (count, 4))
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.abs(np.linalg.norm(quaternions, axis=2) - 1.0) < _UNIT
    _check(good, what, "orientation", quaternions)
    rotation = scipy.spatial.transform.Rotation
    matrices = rotation.from_quat(quaternions.reshape(-1, 4)[:, [1, 2, 3, 0]]).as_matrix()
    return np.asarray(matrices.reshape(len(frames), count, 3, 3))


def _places(frames: list[Element], what: str, count: int) -> Array:
    """Return positions (k, n, 3) of the segments [m]."""
    places = _vectors(frames, what, "position", (count, 3))
    _check(np.all(np.abs(places) < _FARTHEST, axis=2), what, "position", places)
    return places


def _motion(
    names: list[str],
    parents: tuple[int, ...],
    time: Array,
    rest: tuple[Array, Array],
    rotated: Array,
    moved: Array | None,
) -> SkeletonMotion:
    """Return the motion of the skeleton that rests in the T pose, in axes of its first segment.

    Args:
        names: names of the n segments.
        parents: index of the segment before each.
        time: (k,) [s].
        rest: rotations (1, n, 3, 3) and positions (1, n, 3) in the T pose.
        rotated: rotations (k, n, 3, 3).
        moved: positions (k, n, 3), or None if the file has none.

    Raises:
        RecordingError: a long bone has another direction by positions than by orientations.
    """
    (resting,), (places,) = rest
    rotations = rotated @ np.swapaxes(resting, 1, 2) @ resting[:1]
    offsets = places.copy()
    steps = {} if moved is None else {0: moved[:, 0]}
    for joint, parent in enumerate(parents):
        if parent >= 0:
            offsets[joint] = (places[joint] - places[parent]) @ resting[0]
        if parent >= 0 and moved is not None:
            between = moved[:, joint] - moved[:, parent]
            steps[joint] = np.einsum("kji,kj->ki", rotations[:, parent], between)
            apart = _angles(offsets[joint], steps[joint])
            if np.linalg.norm(offsets[joint]) > _LONG and not np.median(apart) < _APART:
                raise RecordingError(
                    f"from {names[parent]} to {names[joint]} the positions are in another "
                    f"direction than the orientations, by {np.median(apart):.0f} deg (median): "
                    "these are not the orientations of MVN's segments"
                )

    def rotation(joint: int) -> Array:
        before = rotations[:, parents[joint]] if parents[joint] >= 0 else np.eye(3)[None]
        relative: Array = np.swapaxes(before, 1, 2) @ rotations[:, joint]
        return relative

    skeleton = Skeleton(tuple(names), parents, offsets)
    return SkeletonMotion(skeleton, time, rotation, lambda joint: steps.get(joint, offsets[joint]))


def _angles(offset: Array, steps: Array) -> Array:
    """Return angles (k,) [deg] between a vector (3,) and others (k, 3)."""
    sines = np.linalg.norm(np.cross(offset, steps), axis=1)
    angles: Array = np.degrees(np.arctan2(sines, steps @ offset))
    return angles
