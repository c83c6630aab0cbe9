"""model_segments: the orientations of the segments by the model that a table was computed with."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
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
from geodesic_ocp.trajectory.frame_motion import FrameMotion

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
) -> ConvertedAngles:
    """The orientations of the segments by forward kinematics of the model.

    Pelvis and thorax have the axes of their bodies (x forward, y up, z right), arms those of
    `arm_axes`. A segment is left out if the table has none of the unlocked coordinates between it
    and the segment before it; where it has only some of them, the others have their default values,
    with a RuntimeWarning. The trunk's pose is known where the table has all unlocked coordinates
    from the ground to the thorax.

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
    known = {"thorax": thorax}
    reasons: dict[str, str] = {}
    unread: list[str] = []

    def is_read(segment: str, parent: str) -> bool:
        """Whether the table says how the segment turns relative to the body before it."""
        needed = _unlocked(model, parent, bodies[segment])
        missing = [name for name in needed if name not in values]
        if needed and len(missing) == len(needed):
            reasons[segment] = f"there is no column {', '.join(missing)}"
            return False
        unread.extend(missing)
        return True

    for segment in ("pelvis", "abdomen"):
        if segment in bodies and is_read(segment, thorax):
            known[segment] = bodies[segment]
    arms: dict[str, ArmAxes] = {}
    for side in SIDES:
        names = [f"{side} {part}" for part in ("upper arm", "forearm", "hand")]
        names = names[: 2 + (names[2] in bodies)]
        if not set(names) <= set(bodies):
            continue
        try:
            chain = tuple(bodies[name] for name in names)
            arms[side] = arm_axes(model, chain, side, zero, _radians(model, convention))
        except RecordingError as failure:
            reasons |= dict.fromkeys(names, str(failure).removeprefix(f"{model.file}: "))
            continue
        for name, parent in zip(names, (thorax, *chain), strict=False):
            if not is_read(name, parent):
                break
            known[name] = bodies[name]
    if not arms:
        sentences = "; ".join(dict.fromkeys(reasons.values()))
        raise RecordingError(f"{model.file}: {sentences}")
    poses = body_poses(
        model,
        values,
        dict.fromkeys([*known.values(), *(b for a in arms.values() for b in a.bodies)]),
    )
    rotations = {
        segment: _TO_OURS @ poses[body][0] @ _TO_OURS.T
        for segment, body in known.items()
        if not segment.startswith(SIDES)
    }
    for side, arm in arms.items():
        names = [f"{side} {part}" for part in ("upper arm", "forearm", "hand")]
        for name, rotation in zip(names, arm.rotations(poses), strict=False):
            if name in known:
                rotations[name] = _TO_OURS @ rotation
    trunk = None
    free = _unlocked(model, GROUND, thorax)
    if free and set(free) <= set(values):
        turned, place = poses[thorax]
        trunk = FrameMotion(rotations["thorax"], (place + turned @ middle) @ _TO_OURS.T)
    elif any(name in values for name in free):
        unread.extend(name for name in free if name not in values)
    _warn(file, model, [name for name in columns if name not in values], unread)
    return ConvertedAngles(SegmentOrientations(time, rotations, trunk), reasons)


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


def _warn(file: Path, model: OsimModel, others: Sequence[str], unread: Sequence[str]) -> None:
    sentences = []
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
