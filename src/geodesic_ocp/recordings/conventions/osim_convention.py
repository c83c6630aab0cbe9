"""OsimConvention: a model, and which of its bodies are the segments of a person."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.angle_segments import ConvertedAngles
from geodesic_ocp.recordings.conventions.osim_axes import ArmAxes, arm_axes
from geodesic_ocp.recordings.conventions.osim_model import (
    GROUND,
    OsimCoordinate,
    OsimCoupler,
    OsimFunction,
    OsimJoint,
    OsimModel,
    body_poses,
    coordinates_of,
    flag,
    joint_of_body,
    joint_of_set,
    model_element,
    numbers,
    read_function,
    text_of,
)
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS, SegmentOrientations
from geodesic_ocp.records import parse_json
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


def as_osim_convention(given: object) -> OsimConvention | None:
    """Return the convention itself, that of a file .osim, or that in a JSON file with the key
    "model".

        {"model": "arm.osim", "bodies": {"thorax": "base"}, "neutral": {"pro_sup": 90}}

    A relative path of the model is one from the folder of the JSON file. None if the argument is
    something else, such as an AngleConvention.

    Raises:
        RecordingError: a JSON file with the key "model" that has other keys or values.
    """
    if isinstance(given, OsimConvention):
        return given
    if not isinstance(given, (str, Path)):
        return None
    file = Path(given)
    if file.suffix.lower() == ".osim":
        return OsimConvention(file)
    record = _record(file) if file.suffix.lower() == ".json" else None
    if not isinstance(record, dict) or "model" not in record:
        return None
    known = [each.name for each in fields(OsimConvention)]
    unknown = [key for key in record if key not in known]
    if unknown:
        raise RecordingError(f"{file}: there is no key {unknown[0]!r}; keys are {', '.join(known)}")
    try:
        convention = OsimConvention(**record)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
    return OsimConvention(file.parent / convention.model, convention.bodies, convention.neutral)


def _record(file: Path) -> Any:
    try:
        return parse_json(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None  # reported where angle conventions are read


_METRES = ("", "meters", "meter", "metres", "metre", "m")


def read_osim(file: Path) -> OsimModel:
    """Read the bodies, joints, coordinates and couplers of a model (.osim).

    Joints of unknown kinds, or with unknown functions, matter only where a motion needs them.

    Raises:
        RecordingError: the file is missing or malformed, or lengths are not in metres; names the
            element and the reason.
    """
    model = model_element(file)
    try:
        return _model(file, model)
    except RecordingError as failure:
        if str(failure).startswith(str(file)):
            raise
        raise RecordingError(f"{file}: {failure}") from None


def _model(file: Path, model: ElementTree.Element) -> OsimModel:
    unit = text_of(model, "length_units").lower()
    if unit not in _METRES:
        raise RecordingError(f"<length_units> must be meters, is {unit!r}")
    elements = model.findall("BodySet/objects/Body") + model.findall("components/Body")
    bodies = [each.get("name", "") for each in elements]
    joints: dict[str, OsimJoint] = {}
    coordinates: dict[str, OsimCoordinate] = {}
    frames = {
        each.get("name", ""): each
        for path in ("components", "BodySet/objects/Body/components", "Ground/components")
        for each in model.findall(f"{path}/PhysicalOffsetFrame")
    }
    nested = [
        (body.get("name", ""), joint) for body in elements for joint in body.findall("Joint/*")
    ]
    listed = [
        (None, joint)
        for path in ("JointSet/objects", "components")
        for joint in model.findall(f"{path}/*")
        if joint.tag.endswith("Joint")
    ]
    for body, element in nested + listed:
        name = element.get("name", "")
        try:
            joint = joint_of_set(element, frames) if body is None else joint_of_body(body, element)
            found = coordinates_of(element)
        except RecordingError as failure:
            raise RecordingError(f"joint {name!r}: {failure}") from None
        if joint.child.body in joints:
            reason = f"two joints carry the body {joint.child.body!r}"
            joint = OsimJoint(name, joint.parent, joint.child, refusal=reason)
        joints[joint.child.body] = joint
        for coordinate in found:
            if coordinate.name in coordinates:
                raise RecordingError(f"there are two coordinates {coordinate.name!r}")
            coordinates[coordinate.name] = coordinate
    if not joints:
        raise RecordingError("there are no joints in <BodySet> nor in <JointSet>")
    gravity = numbers(model, "gravity", 3, np.zeros(3))
    return OsimModel(file, tuple(bodies), joints, coordinates, _couplers(model), gravity)


def _couplers(model: ElementTree.Element) -> dict[str, OsimCoupler]:
    couplers = {}
    for element in model.findall("ConstraintSet/objects/CoordinateCouplerConstraint"):
        if flag(element, "isDisabled") or not flag(element, "isEnforced", True):
            continue
        dependent = text_of(element, "dependent_coordinate_name")
        independent = tuple(text_of(element, "independent_coordinate_names").split())
        scale = float(numbers(element, "scale_factor", 1, np.ones(1))[0])
        holder = element.find("coupled_coordinates_function")
        try:
            if holder is None or len(holder) != 1 or not independent or not dependent:
                raise RecordingError("needs two names of coordinates and a function")
            function = read_function(holder[0], len(independent))
        except RecordingError as failure:
            raise RecordingError(
                f"CoordinateCouplerConstraint {element.get('name', '')!r}: {failure}"
            ) from None
        couplers[dependent] = OsimCoupler(independent, _scaled(function, scale))
    return couplers


def _scaled(function: OsimFunction, scale: float) -> OsimFunction:
    return lambda values: scale * function(values)


SIDES = ("right", "left")


def named_bodies(model: OsimModel, convention: OsimConvention) -> dict[str, str]:
    """Return the body of each segment that the model has.

    Raises:
        RecordingError: there is no thorax or no arm, two bodies have names of one segment, or the
            convention names a body that is not there; lists the bodies.
    """
    listed = f"bodies of the model are {', '.join(model.bodies)}"
    for segment, body in convention.bodies.items():
        if body not in model.bodies:
            raise RecordingError(
                f"{model.file}: there is no body {body!r} for the {segment}; {listed}"
            )
    zero = zero_coordinates(model)
    found: dict[str, str] = {}
    for segment in SEGMENTS:
        if segment in convention.bodies:
            found[segment] = convention.bodies[segment]
            continue
        side, _, part = segment.partition(" ")
        if side not in SIDES:
            names = BODY_NAMES.get(segment, ())
        else:
            letter = side[0]
            names = tuple(
                text
                for name in BODY_NAMES[part]
                for text in (f"{name}_{letter}", f"{letter}_{name}", f"{name}_{side}")
            )
            if "thorax" in found and side == _single_side(model, found["thorax"], zero):
                names += BODY_NAMES[part]
        bodies = [body for body in model.bodies if body.lower() in names]
        if len(bodies) > 1:
            raise RecordingError(
                f"{model.file}: {' and '.join(bodies)} may be the {segment}; name one of them in "
                "an OsimConvention"
            )
        if bodies:
            found[segment] = bodies[0]
    arms = [side for side in SIDES if f"{side} upper arm" in found and f"{side} forearm" in found]
    missing = [] if "thorax" in found else ["thorax"]
    missing += [] if arms else ["upper arm with a forearm"]
    if missing:
        raise RecordingError(
            f"{model.file}: no body is recognised as {' nor as '.join(missing)}; name the bodies "
            f"of the segments in an OsimConvention; {listed}"
        )
    return found


def zero_coordinates(model: OsimModel) -> Mapping[str, Array]:
    """Return all independent coordinates zero, one sample."""
    return {name: np.zeros(1) for name in model.coordinates if name not in model.couplers}


def _single_side(model: OsimModel, thorax: str, zero: Mapping[str, Array]) -> str | None:
    """Return the side of the only upper arm if its name has none: z points right in the thorax."""
    bodies = [body for body in model.bodies if body.lower() in BODY_NAMES["upper arm"]]
    if len(bodies) != 1:
        return None
    poses = body_poses(model, zero, (thorax, bodies[0]))
    across = (poses[bodies[0]][1] - poses[thorax][1])[0] @ poses[thorax][0][0][:, 2]
    return SIDES[0] if across > 0.0 else SIDES[1]


# Rotation from OpenSim's axes (x forward, y up, z right) to x right, y forward, z up.
_TO_OURS = AngleConvention("OpenSim", ()).to_right_forward_up
_UPWARDS = 0.99  # cosine between the direction against gravity and the y axis of the ground
_ACROSS = np.cos(np.radians(30.0))  # between the line of the shoulders and the thorax's z axis
_ARM = ("upper arm", "forearm", "hand")
_SHOWN = 8  # names in a message


def model_segments(
    file: Path,
    model: OsimModel,
    convention: OsimConvention,
    time: Array,
    columns: Mapping[str, Array],
) -> ConvertedAngles:
    """Return the orientations of the segments by forward kinematics of the model.

    Pelvis and thorax have the axes of their bodies (x forward, y up, z right), arms those of
    `arm_axes`. A segment is left out if the table has none of the unlocked coordinates between it
    and the segment before it. With a RuntimeWarning, coordinates have their default values where
    only some of those are missing, and an arm is left out whose axes the model does not show. The
    trunk's pose is known where the table has all unlocked coordinates from the ground to the
    thorax.

    Args:
        file: file of the table, for messages.
        model: model of the coordinates.
        convention: which bodies are the segments.
        time: (k,) [s].
        columns: columns by name, (k,) [rad or m].

    Raises:
        RecordingError: the model has no arm, is not upright along y, has none of the table's
            coordinates, or joints that cannot be computed.
    """
    values = _values(file, model, columns)
    bodies = named_bodies(model, convention)
    zero = zero_coordinates(model)
    thorax = bodies["thorax"]
    middle = _middle_of_shoulders(model, bodies, zero)
    arms, refusals = _arms(model, bodies, zero, _radians(model, convention))
    reasons = dict(refusals)
    unread: list[str] = []
    known = {"thorax": thorax}
    chains = [["thorax", "pelvis"], ["thorax", "abdomen"]]
    chains += [["thorax", *(f"{side} {part}" for part in _ARM)] for side in arms]
    for chain in chains:
        for parent, segment in pairwise(each for each in chain if each in bodies):
            needed = _unlocked(model, bodies[parent], bodies[segment])
            missing = [name for name in needed if name not in values]
            if needed and len(missing) == len(needed):
                reasons[segment] = f"there is no column {', '.join(missing)}"
                break
            unread += missing
            known[segment] = bodies[segment]
    moved = {*known.values(), *(body for arm in arms.values() for body in arm.bodies)}
    poses = body_poses(model, values, moved)
    rotations = {
        segment: _TO_OURS @ poses[body][0] @ _TO_OURS.T
        for segment, body in known.items()
        if not segment.startswith(SIDES)
    }
    for side, arm in arms.items():
        for part, rotation in zip(_ARM, arm.rotations(poses), strict=False):
            if f"{side} {part}" in known:
                rotations[f"{side} {part}"] = _TO_OURS @ rotation
    trunk = None
    free = _unlocked(model, GROUND, thorax)
    if free and set(free) <= set(values):
        turned, place = poses[thorax]
        trunk = FrameMotion(rotations["thorax"], (place + turned @ middle) @ _TO_OURS.T)
    elif set(free) & set(values):
        unread += [name for name in free if name not in values]
    left_out = [f"the {name.split()[0]} arm is left out: {why}" for name, why in refusals.items()]
    _warn(file, model, [name for name in columns if name not in values], unread, left_out)
    return ConvertedAngles(SegmentOrientations(time, rotations, trunk), reasons)


def _arms(
    model: OsimModel,
    bodies: Mapping[str, str],
    zero: Mapping[str, Array],
    neutral: Mapping[str, float],
) -> tuple[dict[str, ArmAxes], dict[str, str]]:
    """Return the axes of the arms by side, and by upper arm why those of others are not known.

    Raises:
        RecordingError: those of no arm are known.
    """
    arms, refusals = {}, {}
    for side in SIDES:
        names = [f"{side} {part}" for part in _ARM]
        if not set(names[:2]) <= set(bodies):
            continue
        chain = tuple(bodies[name] for name in names if name in bodies)
        try:
            arms[side] = arm_axes(model, chain, side, zero, neutral)
        except RecordingError as failure:
            refusals[names[0]] = str(failure).removeprefix(f"{model.file}: ")
    if not arms:
        sentences = "; ".join(f"{name.split()[0]} arm: {why}" for name, why in refusals.items())
        raise RecordingError(f"{model.file}: {sentences}")
    return arms, refusals


def _values(file: Path, model: OsimModel, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns that are coordinates of the model.

    Raises:
        RecordingError: none is.
    """
    values = {name: column for name, column in columns.items() if name in model.coordinates}
    if not values:
        raise RecordingError(
            f"{file}: its columns {_list(columns)} are no coordinates of {model.file}; those are "
            f"{_list(model.coordinates)}"
        )
    return values


def _warn(
    file: Path,
    model: OsimModel,
    others: Sequence[str],
    unread: Sequence[str],
    sentences: list[str],
) -> None:
    if others:
        sentences.append(
            f"columns {_list(others)} are no coordinates of {model.file.name}: was it computed "
            "with another model?"
        )
    if unread:
        sentences.append(
            f"there is no column {_list(dict.fromkeys(unread))}; the default values of "
            f"{model.file.name} stand in"
        )
    for sentence in sentences:
        warnings.warn(f"{file}: {sentence}", RuntimeWarning, stacklevel=3)


def _list(names: Sequence[str] | Mapping[str, object]) -> str:
    shown = list(names)[:_SHOWN]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _radians(model: OsimModel, convention: OsimConvention) -> dict[str, float]:
    """Return the coordinates of the neutral pose [rad, or m for translations].

    Raises:
        RecordingError: the model has no such coordinate.
    """
    for name in convention.neutral:
        if name not in model.coordinates:
            raise RecordingError(
                f"{model.file}: there is no coordinate {name!r} for the neutral pose; there are "
                f"{', '.join(model.coordinates)}"
            )
    lengths = model.translations
    return {
        name: float(value if name in lengths else np.radians(value))
        for name, value in convention.neutral.items()
    }


def _unlocked(model: OsimModel, start: str, body: str) -> tuple[str, ...]:
    """Return the unlocked independent coordinates of all joints between two bodies."""
    ways = [model.path(each) for each in (start, body)]
    joints = tuple(
        joint for joint in (*ways[0], *ways[1]) if (joint in ways[0]) != (joint in ways[1])
    )
    names = model.independent(joints)
    return tuple(name for name in names if not model.coordinates[name].locked)


def _middle_of_shoulders(
    model: OsimModel, bodies: Mapping[str, str], zero: Mapping[str, Array]
) -> Array:
    """Return the point midway between the shoulders in the thorax (3,), all coordinates zero.

    Of one shoulder only it is the point beside it in the plane x-y of the thorax.

    Raises:
        RecordingError: up is not y, or the right shoulder is not to the right of the left one.
    """
    gravity = float(np.linalg.norm(model.gravity))
    if gravity > 0.0 and -model.gravity[1] < _UPWARDS * gravity:
        raise RecordingError(
            f"{model.file}: gravity is {model.gravity.tolist()}, but y of the ground must point up"
        )
    thorax = bodies["thorax"]
    centres = {}
    for side in SIDES:
        if f"{side} upper arm" in bodies:
            body = bodies[f"{side} upper arm"]
            poses = body_poses(model, zero, (thorax, body))
            (rotation, origin), (turned, place) = ((r[0], p[0]) for r, p in poses.values())
            centre = place + turned @ model.joints[body].child.position
            centres[side] = rotation.T @ (centre - origin)
    if len(centres) < 2:
        ((side, centre),) = centres.items()
        sign = 1.0 if side == "right" else -1.0
        across = np.array([0.0, 0.0, centre[2]])
        faces = sign * centre[2] > 0.0
    else:
        across = centres["right"] - centres["left"]
        centre = 0.5 * (centres["right"] + centres["left"])
        faces = across[2] > _ACROSS * np.linalg.norm(across)
    if not faces:
        raise RecordingError(
            f"{model.file}: the axes of the body {thorax!r} are not x forward, y up, z right: the "
            f"{'line from left to right shoulder' if len(centres) > 1 else side + ' shoulder'} is "
            f"along {across.round(3).tolist()}"
        )
    result: Array = centre if len(centres) > 1 else centre * [1.0, 1.0, 0.0]
    return result
