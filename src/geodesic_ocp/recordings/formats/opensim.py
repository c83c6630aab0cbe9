"""Motions of OpenSim: tables of joint coordinates, read by a model or a convention of angles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.angle_segments import (
    ConvertedAngles,
    fits,
    segments_of_angles,
)
from geodesic_ocp.recordings.conventions.joint_angles import JOINTS, joint_angles
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.conventions.osim_convention import (
    OsimConvention,
    as_osim_convention,
    model_segments,
    read_osim,
)
from geodesic_ocp.recordings.conventions.read_angle_convention import as_angle_convention
from geodesic_ocp.recordings.formats.delimited import (
    CoordinateTable,
    is_translation,
    read_coordinates,
)
from geodesic_ocp.trajectory.motion import Motion


def read_opensim(
    file: Path,
    joints: Sequence[str] | None = None,
    convention: AngleConvention | OsimConvention | str | Path | None = None,
) -> Motion:
    """Read the motion of these joints from a .mot or .sto file.

    Columns with the names of the Master Motor Map's joints are read as they are. Others are
    converted by the model (.osim) with which they were computed, by a convention of angles, or by
    the built-in one that fits their names. If none fits, or the joints asked for are columns, the
    motion is that of the columns.

    Args:
        file: to read.
        joints: names, in the order of the result.
        convention: the model's file or an OsimConvention; or an AngleConvention, the name of a
            built-in one, or a JSON file of either.

    Raises:
        RecordingError: the file or the model is malformed, or the columns do not give the joints;
            names the line or element, or the columns.
    """
    by_model = as_osim_convention(convention)
    if by_model is not None:
        return _by_model(file, joints, by_model)
    given = as_angle_convention(convention)  # type: ignore[arg-type] # no OsimConvention is left
    table = read_coordinates(file, given.position if given is not None else ())
    named = [name for name in table.names if name in JOINTS]
    if given is None and (named or (joints is not None and set(joints) <= set(table.names))):
        return _plain(file, table, named if joints is None else joints)
    chosen = given or _fitting(table.names)
    if chosen is None:
        if joints is None:
            return _plain(file, table, table.names)
        raise RecordingError(
            f"{file}: no known convention of joint angles fits its columns "
            f"{', '.join(table.names)}; describe their rotations by convention= (--convention): "
            "the file of the model (.osim) that they were computed with, an AngleConvention, or a "
            "JSON file of either"
        )
    columns = dict(zip(table.names, table.values.T, strict=True))
    try:
        converted = segments_of_angles(chosen, table.time, columns)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
    return _motion(file, joints, converted, f"convention {chosen.name}")


def _by_model(file: Path, joints: Sequence[str] | None, convention: OsimConvention) -> Motion:
    model = read_osim(Path(convention.model))
    table = read_coordinates(file, model.translations)
    unclear = [name for name in model.rotations if name in table.names and is_translation(name)]
    if unclear:
        raise RecordingError(
            f"{file}: {', '.join(unclear)} would be read in metres by its name, but rotates in "
            f"{model.file}; rename it in both"
        )
    columns = dict(zip(table.names, table.values.T, strict=True))
    try:
        converted = model_segments(file, model, convention, table.time, columns)
    except ValueError as failure:
        told = str(failure).startswith((str(file), str(model.file)))
        raise RecordingError(str(failure) if told else f"{file}: {failure}") from None
    return _motion(file, joints, converted, f"model {model.file.name}")


def _motion(
    file: Path, joints: Sequence[str] | None, converted: ConvertedAngles, source: str
) -> Motion:
    try:
        return joint_angles(converted.orientations, joints)
    except ValueError as failure:
        why = "".join(
            f"; {segment}: {reason}"
            for segment, reason in converted.reasons.items()
            if joints is None or segment in str(failure)
        )
        raise RecordingError(f"{file}: {source}: {failure}{why}") from None


def _fitting(names: Sequence[str]) -> AngleConvention | None:
    """Return the built-in convention that uses most of these columns."""
    best = max(ANGLE_CONVENTIONS.values(), key=lambda each: fits(each, set(names)))
    return best if fits(best, set(names)) else None


def _plain(file: Path, table: CoordinateTable, joints: Sequence[str]) -> Motion:
    missing = [name for name in joints if name not in table.names]
    if missing:
        raise RecordingError(
            f"{file}: there is no joint {', '.join(missing)}; there are {', '.join(table.names)}"
        )
    chosen = [table.names.index(name) for name in joints]
    try:
        return Motion(table.time, np.ascontiguousarray(table.values[:, chosen]), tuple(joints))
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
