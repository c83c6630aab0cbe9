"""OsimConvention: a model, and which of its bodies are the segments of a person."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.osim_axes import ArmAxes, arm_axes
from geodesic_ocp.recordings.conventions.osim_model import (
    GROUND,
    OsimModel,
    body_poses,
    point_in,
)
from geodesic_ocp.recordings.conventions.segment_orientations import (
    ARM,
    SEGMENTS,
    SIDES,
    TRUNK,
    SegmentOrientations,
)
from geodesic_ocp.trajectory.files.text_lines import named_failures
from geodesic_ocp.trajectory.motion import FrameMotion

#: Names by which bodies are recognised, in small letters; those of arms follow after a side, as in
#: humerus_r or r_humerus. Without a side ("humerus") it is the one where the shoulder is. Bodies
#: named abdomen carry soft tissue in published models and are no segment of the trunk.
BODY_NAMES: dict[str, tuple[str, ...]] = {
    "pelvis": ("pelvis",),
    "thorax": ("thorax", "torso", "trunk"),
    "upper arm": ("humerus", "upperarm", "upper_arm"),
    "forearm": ("radius", "forearm", "lower_arm", "lowerarm"),
    "hand": ("hand",),
}


@dataclass(frozen=True)
class OsimConvention:
    """The OpenSim model with which a table of coordinates was computed.

    >>> from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention
    >>> OsimConvention("arm.osim", {"thorax": "base"}, {"pro_sup": 90.0})
    OsimConvention('arm.osim', thorax: base)

    Attributes:
        model: file (.osim).
        bodies: bodies by segment ("pelvis", "abdomen", "thorax", "right upper arm", ...), the
            names of the bodies; those without an entry are recognised by `BODY_NAMES`. The
            forearm's body is the one that turns with the palm, the radius.
        neutral: coordinates [deg] of the person who stands upright, arms hanging, palms towards the
            body; those without an entry are 0. Without any entry, the rotation of the forearm in
            that pose is the one in which the axis of wrist flexion points forward.

    Raises:
        ValueError: an unknown segment, or a name or angle of another type.
    """

    model: str | Path
    bodies: Mapping[str, str] = field(default_factory=dict)
    neutral: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.model, (str, Path)) or not str(self.model):
            raise ValueError(f"model must be a file (.osim), got {self.model!r}")
        for name in ("bodies", "neutral"):
            if not isinstance(getattr(self, name), Mapping):
                raise ValueError(f"{name} must be given by name, got {getattr(self, name)!r}")
        for segment, body in self.bodies.items():
            if segment not in SEGMENTS:
                raise ValueError(
                    f"bodies: there is no segment {segment!r}; there are {', '.join(SEGMENTS)}"
                )
            if not isinstance(body, str) or not body:
                raise ValueError(f"bodies: the body of the {segment} must be a name, got {body!r}")
        for coordinate, angle in self.neutral.items():
            as_number(f"neutral {coordinate}", angle)

    def __repr__(self) -> str:
        bodies = "".join(f", {segment}: {body}" for segment, body in self.bodies.items())
        return f"OsimConvention({str(self.model)!r}{bodies})"


def named_bodies(model: OsimModel, convention: OsimConvention) -> dict[str, str]:
    """Return the body of each segment that the model has.

    Raises:
        RecordingError: there is no thorax or no arm, two bodies have names of one segment, or the
            convention names a body that is not there; lists the bodies.
    """
    listed = f"bodies of the model are {', '.join(model.bodies)}"
    for segment, body in convention.bodies.items():
        if body not in model.bodies:
            raise RecordingError(f"there is no body {body!r} for the {segment}; {listed}")
    found: dict[str, str] = {}
    for segment in SEGMENTS:
        if segment in convention.bodies:
            found[segment] = convention.bodies[segment]
            continue
        side, _, part = segment.partition(" ")
        names = BODY_NAMES.get(part or segment, ())
        if part:
            sided = [f"{name}_{side[0]} {side[0]}_{name} {name}_{side}".split() for name in names]
            is_only = "thorax" in found and side == _single_side(model, found["thorax"])
            names = (*itertools.chain(*sided), *(names if is_only else ()))
        bodies = [body for body in model.bodies if body.lower() in names]
        if len(bodies) > 1:
            raise RecordingError(
                f"{' and '.join(bodies)} may be the {segment}; name one of them in an "
                "OsimConvention"
            )
        if bodies:
            found[segment] = bodies[0]
    arms = [side for side in SIDES if {f"{side} upper arm", f"{side} forearm"} <= set(found)]
    missing = [] if "thorax" in found else ["thorax"]
    missing += [] if arms else ["upper arm with a forearm"]
    if missing:
        raise RecordingError(
            f"no body is recognised as {' nor as '.join(missing)}; name the bodies of the segments "
            f"in an OsimConvention; {listed}"
        )
    return found


def _single_side(model: OsimModel, thorax: str) -> str | None:
    """Return the side of the only upper arm if its name has none: z points right in the thorax."""
    bodies = [body for body in model.bodies if body.lower() in BODY_NAMES["upper arm"]]
    if len(bodies) != 1:
        return None
    _, _, across = point_in(model, model.zero, thorax, bodies[0], np.zeros(3))
    return SIDES[0] if across > 0.0 else SIDES[1]


# Rotation from OpenSim's axes (x forward, y up, z right) to x right, y forward, z up.
_TO_OURS = AngleConvention("OpenSim", ()).to_right_forward_up
_UPWARDS = 0.99  # cosine between the direction against gravity and the y axis of the ground
_ACROSS = np.cos(np.radians(30.0))  # between the line of the shoulders and the thorax's z axis
_SHOWN = 8  # names in a message


def model_segments(
    file: Path,
    model: OsimModel,
    convention: OsimConvention,
    time: Array,
    columns: Mapping[str, Array],
) -> SegmentOrientations:
    """Return the orientations of the segments by forward kinematics of the model.

    Pelvis and thorax have the axes of their bodies (x forward, y up, z right), arms those of
    `arm_axes`. A segment is left out if the table has none of the unlocked coordinates between it
    and the segment before it. With a RuntimeWarning, coordinates have their default values where
    only some of those are missing, and an arm is left out whose axes the model does not show. The
    trunk's pose is known where the table has all unlocked coordinates from the ground to the
    thorax.

    Args:
        file: file of the table, for warnings.
        model: model of the coordinates.
        convention: which bodies are the segments.
        time: (k,) [s].
        columns: columns by name, (k,) [rad or m].

    Raises:
        RecordingError: the model has no arm, is not upright along y, has none of the table's
            coordinates, or joints that cannot be computed.
    """
    values = {name: column for name, column in columns.items() if name in model.coordinates}
    if not values:
        raise RecordingError(
            f"its columns {_list(columns)} are no coordinates of {model.file}; those are "
            f"{_list(model.coordinates)}"
        )
    with named_failures(model.file):
        bodies = named_bodies(model, convention)
        thorax = bodies["thorax"]
        middle = _middle_of_shoulders(model, bodies)
        arms, refusals = _arms(model, bodies, _radians(model, convention))
        left_out = dict(refusals)
        unread = []
        known = {"thorax": thorax}
        chains = [["thorax", "pelvis"], ["thorax", "abdomen"]]
        chains += [["thorax", *(f"{side} {part}" for part in ARM)] for side in arms]
        for chain in chains:
            for parent, segment in itertools.pairwise(each for each in chain if each in bodies):
                needed = _unlocked(model, bodies[parent], bodies[segment])
                missing = [name for name in needed if name not in values]
                if needed and len(missing) == len(needed):
                    left_out[segment] = f"there is no column {', '.join(missing)}"
                    break
                unread += missing
                known[segment] = bodies[segment]
        moved = {*known.values(), *(body for arm in arms.values() for body in arm.bodies)}
        poses = body_poses(model, values, moved)
        free = _unlocked(model, GROUND, thorax)
    rotations = {
        segment: _TO_OURS @ poses[body][0] @ _TO_OURS.T
        for segment, body in known.items()
        if segment in TRUNK
    }
    for side, arm in arms.items():
        for part, rotation in zip(ARM, arm.rotations(poses), strict=False):
            if f"{side} {part}" in known:
                rotations[f"{side} {part}"] = _TO_OURS @ rotation
    trunk = None
    if free and set(free) <= set(values):
        turned, place = poses[thorax]
        trunk = FrameMotion(rotations["thorax"], (place + turned @ middle) @ _TO_OURS.T)
    elif set(free) & set(values):
        unread += [name for name in free if name not in values]
    doubts = [f"the {name.split()[0]} arm is left out: {why}" for name, why in refusals.items()]
    if others := [name for name in columns if name not in values]:
        doubts.append(
            f"columns {_list(others)} are no coordinates of {model.file.name}: was it computed "
            "with another model?"
        )
    if unread:
        doubts.append(
            f"there is no column {_list(dict.fromkeys(unread))}; the default values of "
            f"{model.file.name} stand in"
        )
    for doubt in doubts:
        warnings.warn(f"{file}: {doubt}", RuntimeWarning, stacklevel=2)
    return SegmentOrientations(time, rotations, trunk, left_out=left_out)


def _arms(
    model: OsimModel, bodies: Mapping[str, str], neutral: Mapping[str, float]
) -> tuple[dict[str, ArmAxes], dict[str, str]]:
    """Return the axes of the arms by side, and by upper arm why those of others are not known.

    Raises:
        RecordingError: those of no arm are known.
    """
    arms: dict[str, ArmAxes] = {}
    refusals: dict[str, str] = {}
    for side in SIDES:
        names = [f"{side} {part}" for part in ARM]
        if not set(names[:2]) <= set(bodies):
            continue
        chain = tuple(bodies[name] for name in names if name in bodies)
        try:
            arms[side] = arm_axes(model, chain, side, neutral)
        except RecordingError as failure:
            refusals[names[0]] = str(failure)
    if not arms:
        sentences = (f"{name.split()[0]} arm: {why}" for name, why in refusals.items())
        raise RecordingError("; ".join(sentences))
    return arms, refusals


def _list(names: Iterable[str]) -> str:
    names = list(names)
    more = len(names) - _SHOWN
    return ", ".join(names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _radians(model: OsimModel, convention: OsimConvention) -> dict[str, float]:
    """Return the coordinates of the neutral pose [rad, or m for translations].

    Raises:
        RecordingError: the model has no such coordinate.
    """
    for name in convention.neutral:
        if name not in model.coordinates:
            raise RecordingError(
                f"there is no coordinate {name!r} for the neutral pose; there are "
                f"{', '.join(model.coordinates)}"
            )
    lengths = model.translations
    return {
        name: float(value if name in lengths else np.radians(value))
        for name, value in convention.neutral.items()
    }


def _unlocked(model: OsimModel, start: str, body: str) -> tuple[str, ...]:
    """Return the unlocked independent coordinates of all joints between two bodies."""
    first = model.path(start)
    second = model.path(body)
    joints = tuple(each for each in (*first, *second) if (each in first) != (each in second))
    names = model.independent(joints)
    return tuple(name for name in names if not model.coordinates[name].locked)


def _middle_of_shoulders(model: OsimModel, bodies: Mapping[str, str]) -> Array:
    """Return the point midway between the shoulders in the thorax (3,), all coordinates zero.

    Of one shoulder only it is the point beside it in the plane x-y of the thorax.

    Raises:
        RecordingError: up is not y, or the right shoulder is not to the right of the left one.
    """
    gravity = float(np.linalg.norm(model.gravity))
    if gravity > 0.0 and -model.gravity[1] < _UPWARDS * gravity:
        raise RecordingError(
            f"gravity is {model.gravity.tolist()}, but y of the ground must point up"
        )
    thorax = bodies["thorax"]
    centres = {}
    for side in SIDES:
        if body := bodies.get(f"{side} upper arm"):
            shoulder = model.joints[body].child.position
            centres[side] = point_in(model, model.zero, thorax, body, shoulder)
    if len(centres) == 2:
        across = centres["right"] - centres["left"]
        line = "line from left to right shoulder"
        middle = 0.5 * (centres["right"] + centres["left"])
        faces = across[2] > _ACROSS * np.linalg.norm(across)
    else:
        ((side, centre),) = centres.items()
        across = centre * [0.0, 0.0, 1.0]
        line = f"{side} shoulder"
        middle = centre - across
        faces = across[2] * (1.0 if side == "right" else -1.0) > 0.0
    if not faces:
        raise RecordingError(
            f"the axes of the body {thorax!r} are not x forward, y up, z right: the {line} is "
            f"along {across.round(3).tolist()}"
        )
    return np.asarray(middle)
