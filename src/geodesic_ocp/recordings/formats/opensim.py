"""Motions of OpenSim: tables of joint coordinates, read by a model or a convention of angles."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    SegmentRelation,
    fits,
    segments_of_angles,
)
from geodesic_ocp.recordings.conventions.known_angle_conventions import (
    ANGLE_CONVENTIONS,
    as_convention,
)
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention, model_segments
from geodesic_ocp.recordings.conventions.osim_file import read_osim
from geodesic_ocp.recordings.conventions.osim_model import OsimModel
from geodesic_ocp.recordings.conventions.segment_orientations import (
    JOINTS,
    SEGMENTS,
    SIDES,
    TRUNK,
    SegmentOrientations,
    joint_angles,
)
from geodesic_ocp.recordings.formats.opensim_table import is_translation, read_coordinates
from geodesic_ocp.trajectory.files.angle_tables import as_columns, mapped, wanted_of
from geodesic_ocp.trajectory.files.series import Series
from geodesic_ocp.trajectory.files.text_lines import named_failures
from geodesic_ocp.trajectory.motion import Motion


def read_opensim(
    file: Path,
    joints: Sequence[str] | None = None,
    convention: AngleConvention | OsimConvention | str | Path | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    degrees_in: bool | None = None,
    rate: float | None = None,
) -> Motion:
    """Read the motion of these joints from a .mot or .sto file.

    Columns with the names of the Master Motor Map's joints are read as they are. Others are
    converted by the model (.osim) with which they were computed, by a convention of angles, or by
    the built-in one that fits their names. If none fits, or the joints asked for are columns, the
    motion is that of the columns. Wrists that are asked for, but of which no column says anything,
    are straight, with a RuntimeWarning.

    Args:
        joints: names, in the order of the result.
        convention: the model's file or an OsimConvention; or an AngleConvention, the name of a
            built-in one, or a JSON file of either.
        columns: which columns are which joints, instead of a convention, see `as_columns`.
        fill, part: what becomes of gaps in the columns that are needed, see `Series.motion`.
        degrees_in, rate: what the file does not say, see `read_coordinates`.

    Raises:
        Gaps: samples are missing, beyond those that are bridged.
        RecordingError: the file or the model is malformed, or the columns do not give the joints;
            names the line or element, or the columns.
    """
    with named_failures(file):
        read = partial(read_coordinates, file, degrees_in=degrees_in, rate=rate)
        return motion_of_columns(file, read, joints, convention, columns, fill=fill, part=part)


def motion_of_columns(
    file: Path,
    read: Callable[[Iterable[str]], Series],
    joints: Sequence[str] | None,
    convention: AngleConvention | OsimConvention | str | Path | None,
    columns: Any = None,
    *,
    fill: float | None = None,
    part: int | None = None,
) -> Motion:
    """Return the motion of these joints from the columns of a file, see `read_opensim`.

    Args:
        file: of the columns, for messages.
        read: from the names of coordinates in metres to the columns [rad or m].
        joints, convention, columns, fill, part: those of `read_opensim`.
    """

    def whole(table: Series, names: Iterable[str]) -> Motion:
        return table.motion(file, list(dict.fromkeys(names)), fill=fill, part=part)

    if columns is not None:
        known = as_columns(columns)
        named = [known[joint].name for joint in wanted_of(known, joints)]
        return mapped(whole(read(()), named), known, joints)
    chosen = as_convention(convention)
    if isinstance(chosen, OsimConvention):
        model = read_osim(Path(chosen.model))
        table = read(model.translations)
        return _by_model(
            file, whole(table, table.joint_names), joints, convention=chosen, model=model
        )
    table = read(chosen.position if chosen is not None else ())
    names = table.joint_names
    ours = [name for name in names if name in JOINTS]
    if chosen is None and (ours or (joints is not None and set(joints) <= set(names))):
        return whole(table, ours if joints is None else joints)
    chosen = chosen or _fitting(names)
    if chosen is not None:
        used = _needed(chosen, joints)
        motion = whole(table, [name for name in names if name in used])
        angles = dict(zip(motion.joint_names, motion.q.T, strict=True))
        straight = _unsaid_of_wrists(chosen, names, joints)
        angles |= {name: np.zeros(len(motion)) for each in straight for name in each.columns}
        segments = segments_of_angles(chosen, motion.time, angles)
        if hands := [each.segment for each in straight if each.segment in segments.rotations]:
            warnings.warn(
                f"{file}: no column is of the {' or the '.join(hands)}: the wrist is taken as "
                "straight, its angles are not measured",
                RuntimeWarning,
                stacklevel=3,
            )
        return _motion(segments, joints, f"convention {chosen.name}")
    if joints is None:
        return whole(table, names)
    raise RecordingError(
        f"no known convention of joint angles fits its columns {', '.join(names)}; describe "
        "their rotations by convention= (--convention): the file of the model (.osim) that "
        "they were computed with, an AngleConvention, or a JSON file of either"
    )


def _unsaid_of_wrists(
    convention: AngleConvention, names: Sequence[str], joints: Sequence[str] | None
) -> list[SegmentRelation]:
    """Return the relations of hands of whose wrists joints are asked for, but no column is there,
    as in motions of OpenCap.
    """
    hands = {f"{side[0].upper()}W": f"{side} hand" for side in SIDES}
    asked = {hands.get(joint[:2]) for joint in joints or ()}
    return [
        each
        for each in convention.relations
        if each.segment in asked and not each.refusal and not set(each.columns) & set(names)
    ]


def _needed(convention: AngleConvention, joints: Sequence[str] | None) -> set[str]:
    """Return columns that these joints follow from, or all joints, with those of the position."""
    segments = (
        {*SEGMENTS}
        if joints is None
        else {*TRUNK, *chain(*(JOINTS.get(each, ()) for each in joints))}
    )
    needed: set[str] = set(convention.position)
    for each in reversed(convention.relations):  # parents come before their children
        if each.segment in segments:
            segments.add(each.parent or each.segment)
            needed |= {turn.column for turn in each.rotations if turn.column is not None}
    return needed


def _by_model(
    file: Path,
    table: Motion,
    joints: Sequence[str] | None,
    *,
    convention: OsimConvention,
    model: OsimModel,
) -> Motion:
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
