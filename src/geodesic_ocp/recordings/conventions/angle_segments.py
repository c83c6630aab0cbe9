"""Orientations of segments from the joint angles of a convention."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    AxisRotation,
    SegmentRelation,
)
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation
from geodesic_ocp.recordings.conventions.segment_orientations import (
    SEGMENTS,
    TRUNK,
    SegmentOrientations,
)
from geodesic_ocp.trajectory.motion import FrameMotion


def segments_of_angles(
    convention: AngleConvention,
    time: Array,
    columns: Mapping[str, Array],
) -> SegmentOrientations:
    """Return the orientations of the segments whose columns are in the table.

    Args:
        convention: convention of the angles.
        time: (k,) [s].
        columns: columns by name, (k,) [rad], positions [m].

    Raises:
        RecordingError: some but not all columns of a segment of the trunk are there.
    """
    count = len(time)
    frames: dict[str | None, Array] = {None: np.broadcast_to(np.eye(3), (count, 3, 3))}
    change = convention.to_right_forward_up
    rotations: dict[str, Array] = {}
    known: set[str | None] = {None}  # segments with all their columns, down from space
    reasons: dict[str, str] = {}
    for relation in convention.relations:
        reason = _reason(relation, columns, reasons)
        segment = relation.segment
        if reason and segment not in TRUNK:
            reasons[segment] = reason
            continue
        there = [name for name in relation.columns if name in columns]
        if reason and there:
            raise RecordingError(
                f"the table has {', '.join(there)}, but {reason} (of the {segment})"
            )
        turned = frames[relation.parent]
        if not reason:
            turned = turned @ _product(relation.rotations, columns, count)
            if relation.parent in known and relation.columns:
                known.add(segment)
        frames[segment] = turned
        if segment in SEGMENTS and (segment not in TRUNK[:2] or segment in known):
            ours = turned @ _product(relation.neutral, columns, count)
            rotations[segment] = change @ ours @ change.T
    if "thorax" not in known:
        for segment in TRUNK[:2]:
            rotations.pop(segment, None)
    trunk = None
    if convention.position and "thorax" in known and set(convention.position) <= set(columns):
        place = np.stack([columns[name] for name in convention.position], axis=1)
        for segment, offset in convention.offsets.items():
            place = place + frames[segment] @ np.asarray(offset)
        trunk = FrameMotion(rotations["thorax"], place @ change.T)
    return SegmentOrientations(time, rotations, trunk, left_out=reasons)


def fits(convention: AngleConvention, names: set[str]) -> int:
    """Return how many of these columns the convention needs; 0 if it gives no arm from them."""
    used = [each for each in convention.relations if set(each.columns) <= names]
    if not any(each.segment.endswith("upper arm") and not each.refusal for each in used):
        return 0
    return len({column for each in used for column in each.columns})


def _reason(
    relation: SegmentRelation, columns: Mapping[str, Array], left: Mapping[str, str]
) -> str:
    if relation.refusal:
        return relation.refusal
    missing = [name for name in relation.columns if name not in columns]
    if missing:
        return f"there is no column {', '.join(missing)}"
    if relation.parent in left:
        return f"it turns relative to the {relation.parent}, which is missing"
    return ""


def _product(
    rotations: tuple[AxisRotation, ...], columns: Mapping[str, Array], count: int
) -> Array:
    product = np.broadcast_to(np.eye(3), (count, 3, 3))
    for rotation in rotations:
        angle = np.full(count, np.radians(rotation.offset))
        if rotation.column is not None and rotation.column in columns:
            angle = angle + rotation.sign * columns[rotation.column]
        product = product @ axis_rotation(rotation.axis, angle)
    return product
