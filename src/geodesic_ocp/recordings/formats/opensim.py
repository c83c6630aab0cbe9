"""Motions of OpenSim: tables of joint coordinates, read by a model or a convention of angles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.angle_segments import fits, segments_of_angles
from geodesic_ocp.recordings.conventions.joint_angles import JOINTS, joint_angles
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention, model_segments
from geodesic_ocp.recordings.conventions.osim_file import read_osim
from geodesic_ocp.recordings.conventions.read_convention import as_convention
from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
from geodesic_ocp.recordings.formats.angle_tables import mapped
from geodesic_ocp.recordings.formats.delimited import is_translation, read_coordinates
from geodesic_ocp.recordings.formats.text_lines import named_failures
from geodesic_ocp.trajectory.motion import Motion


def read_opensim(
    file: Path,
    joints: Sequence[str] | None = None,
    convention: AngleConvention | OsimConvention | str | Path | None = None,
    columns: Any = None,
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
        columns: which columns are which joints, instead of a convention, see `as_columns`.

    Raises:
        RecordingError: the file or the model is malformed, or the columns do not give the joints;
            names the line or element, or the columns.
    """
    with named_failures(file):
        if columns is not None:
            return mapped(read_coordinates(file), columns, joints)
        chosen = as_convention(convention)
        if isinstance(chosen, OsimConvention):
            return _by_model(file, joints, chosen)
        table = read_coordinates(file, chosen.position if chosen is not None else ())
        names = table.joint_names
        ours = [name for name in names if name in JOINTS]
        if chosen is None and (ours or (joints is not None and set(joints) <= set(names))):
            return table.select(ours if joints is None else joints)
        chosen = chosen or _fitting(names)
        if chosen is not None:
            columns = dict(zip(names, table.q.T, strict=True))
            segments = segments_of_angles(chosen, table.time, columns)
            return _motion(segments, joints, f"convention {chosen.name}")
        if joints is None:
            return table
        raise RecordingError(
            f"no known convention of joint angles fits its columns {', '.join(names)}; describe "
            "their rotations by convention= (--convention): the file of the model (.osim) that "
            "they were computed with, an AngleConvention, or a JSON file of either"
        )


def _by_model(file: Path, joints: Sequence[str] | None, convention: OsimConvention) -> Motion:
    model = read_osim(Path(convention.model))
    table = read_coordinates(file, model.translations)
    names = table.joint_names
    if unclear := [name for name in model.rotations if name in names and is_translation(name)]:
        raise RecordingError(
            f"{', '.join(unclear)} would be read in metres by its name, but rotates in "
            f"{model.file}; rename it in both"
        )
    columns = dict(zip(names, table.q.T, strict=True))
    segments = model_segments(file, model, convention, table.time, columns)
    return _motion(segments, joints, f"model {model.file.name}")


def _motion(segments: SegmentOrientations, joints: Sequence[str] | None, source: str) -> Motion:
    try:
        return joint_angles(segments, joints)
    except RecordingError as failure:
        raise RecordingError(f"{source}: {failure}") from None


def _fitting(names: Sequence[str]) -> AngleConvention | None:
    """Return the built-in convention that uses most of these columns."""
    best = max(ANGLE_CONVENTIONS.values(), key=lambda each: fits(each, set(names)))
    return best if fits(best, set(names)) else None
