"""model_segments: the orientations of the segments by the model that a table was computed with."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.angle_segments import ConvertedAngles
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.opensim_models.arm_axes import ArmAxes, arm_axes
from geodesic_ocp.recordings.opensim_models.named_bodies import (
    SIDES,
    named_bodies,
    zero_coordinates,
)
from geodesic_ocp.recordings.opensim_models.osim_convention import OsimConvention
from geodesic_ocp.recordings.opensim_models.osim_model import GROUND, OsimModel
from geodesic_ocp.recordings.opensim_models.osim_poses import body_poses
from geodesic_ocp.trajectory.motion import FrameMotion

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
    """The orientations of the segments by forward kinematics of the model.

    Pelvis and thorax have the axes of their bodies (x forward, y up, z right), arms those of
    `arm_axes`. A segment is left out if the table has none of the unlocked coordinates between it
    and the segment before it. With a RuntimeWarning, coordinates have their default values where
    only some of those are missing, and an arm is left out whose axes the model does not show. The
    trunk's pose is known where the table has all unlocked coordinates from the ground to the
    thorax.

    Args:
        file: of the table, for messages.
        model: of the coordinates.
        convention: which bodies are the segments.
        time: (k,) [s].
        columns: by name, (k,) [rad or m].

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
    """The axes of the arms by side, and by upper arm why those of others are not known.

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
    """The columns that are coordinates of the model.

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
    """The coordinates of the neutral pose [rad, or m for translations].

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
    """The unlocked independent coordinates of all joints between two bodies."""
    ways = [model.path(each) for each in (start, body)]
    joints = tuple(
        joint for joint in (*ways[0], *ways[1]) if (joint in ways[0]) != (joint in ways[1])
    )
    names = model.independent(joints)
    return tuple(name for name in names if not model.coordinates[name].locked)


def _middle_of_shoulders(
    model: OsimModel, bodies: Mapping[str, str], zero: Mapping[str, Array]
) -> Array:
    """The point midway between the shoulders in the thorax (3,), all coordinates zero.

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
