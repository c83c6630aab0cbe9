"""AngleConvention: how the joint angles in the columns of a table turn the segments."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from geodesic_ocp.arrays import Array, as_number, as_vector, settle
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation, direction
from geodesic_ocp.recordings.conventions.segment_orientations import (
    SEGMENTS,
    TRUNK,
    SegmentOrientations,
)
from geodesic_ocp.trajectory.motion import FrameMotion

_TURNS_BACK = (-1.0, -1.0, 1.0)  # of an axis mirrored at the plane x-y


@dataclass(frozen=True)
class AxisRotation:
    """One rotation about an axis, by the angle sign * column + offset.

    Attributes:
        axis: "x", "y", "z", "-x", ... or three numbers, in axes that earlier rotations have turned.
        column: column of the table; None for a constant rotation.
        sign: factor of the column's angle.
        offset: [deg].
        optional: whether a table without the column has the angle 0 there.
    """

    axis: str | tuple[float, float, float]
    column: str | None = None
    sign: float = 1.0
    offset: float = 0.0
    optional: bool = False

    def __post_init__(self) -> None:
        axis = direction(self.axis)
        if not isinstance(self.axis, str):
            settle(self, axis=tuple(axis.tolist()))
        if self.column is not None and (not isinstance(self.column, str) or not self.column):
            raise ValueError(f"column must be a name or None, got {self.column!r}")
        as_number("sign", self.sign)
        as_number("offset", self.offset)


@dataclass(frozen=True)
class SegmentRelation:
    """The orientation of a segment relative to its parent.

    Attributes:
        segment: one of `SEGMENTS`, or another name for a step between two of them.
        parent: a segment of an earlier relation, or None for the surrounding space.
        rotations: one after the other, each about axes that those before it have turned.
        neutral: constant rotations after those, from the convention's axes of this segment to axes
            that are parallel to all others in the neutral pose: upright, arms hanging, palms
            towards the body. They do not pass on to other segments.
        refusal: why the angles of this segment are not converted, if they are not.
    """

    segment: str
    parent: str | None = None
    rotations: tuple[AxisRotation, ...] = ()
    neutral: tuple[AxisRotation, ...] = ()
    refusal: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.segment, str) or not self.segment:
            raise ValueError(f"segment must be a name, got {self.segment!r}")
        if not isinstance(self.refusal, str):
            raise ValueError(f"refusal must be a sentence, got {self.refusal!r}")
        settle(self, rotations=tuple(self.rotations))
        settle(self, neutral=tuple(self.neutral))
        if any(each.column is not None for each in self.neutral):
            raise ValueError(f"neutral rotations of the {self.segment} must have no column")

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that the table must have."""
        turns = self.rotations
        return tuple(dict.fromkeys(r.column for r in turns if r.column and not r.optional))

    def __repr__(self) -> str:
        return f"SegmentRelation({self.segment!r} from {self.parent!r}: {', '.join(self.columns)})"


@dataclass(frozen=True)
class AngleConvention:
    """Angle conventions: the rotations that columns of joint angles stand for.

    >>> from geodesic_ocp.recordings.conventions.angle_convention import (
    ...     AngleConvention, AxisRotation, SegmentRelation)
    >>> mine = AngleConvention("mine", (
    ...     SegmentRelation("thorax"),
    ...     SegmentRelation("right upper arm", "thorax", (
    ...         AxisRotation("z", "flexion"), AxisRotation("-x", "abduction"),
    ...         AxisRotation("y", "internal_rotation"))),
    ... ))
    >>> mine
    AngleConvention('mine': thorax, right upper arm)

    Attributes:
        name: name of the convention.
        relations: parents before their children. Trunk segments ("pelvis", "abdomen", "thorax")
            whose columns the table lacks are upright, and are only what the arms refer to.
        source: where the convention is published.
        forward: axis of the neutral pose that points forward; those of ISB by default.
        up: axis that points up.
        position: columns of the position of the trunk's first segment in space [m], or none.
        offsets: offsets by segment, vectors in its axes that add up from there to the point midway
            between the shoulders [m].

    Raises:
        ValueError: a parent without a relation before it, a segment twice, or forward and up that
            are not two different axes.
    """

    name: str
    relations: tuple[SegmentRelation, ...]
    source: str = ""
    forward: str = "x"
    up: str = "y"
    position: tuple[str, ...] = ()
    offsets: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for text in ("name", "source"):
            if not isinstance(getattr(self, text), str):
                raise ValueError(f"{text} must be a text, got {getattr(self, text)!r}")
        position: object = self.position
        if not isinstance(position, (tuple, list)) or len(position) not in (0, 3):
            raise ValueError(f"position must have three columns or none, got {self.position!r}")
        if not isinstance(self.offsets, Mapping):
            raise ValueError(f"offsets must be given by segment, got {self.offsets!r}")
        settle(self, relations=tuple(self.relations))
        settle(self, position=tuple(self.position))
        earlier: list[str | None] = [None]
        for relation in self.relations:
            if relation.parent not in earlier:
                raise ValueError(
                    f"the parent {relation.parent!r} of the {relation.segment} must be None or the "
                    f"segment of an earlier relation"
                )
            if relation.segment in earlier:
                raise ValueError(f"there are two relations of the {relation.segment}")
            earlier.append(relation.segment)
        for segment, offset in self.offsets.items():
            if segment not in earlier:
                raise ValueError(f"offsets: there is no relation of the {segment}")
            as_vector(f"offset in the {segment}", offset, 3)
        if abs(direction(self.forward) @ direction(self.up)) > 0.0:
            raise ValueError(
                f"forward and up must be different axes, got {self.forward!r} and {self.up!r}"
            )

    @property
    def to_right_forward_up(self) -> Array:
        """Rotation (3, 3) from the convention's axes to x right, y forward, z up."""
        forward = direction(self.forward)
        up = direction(self.up)
        return np.stack([np.cross(forward, up), forward, up])

    def __repr__(self) -> str:
        segments = ", ".join(relation.segment for relation in self.relations)
        return f"AngleConvention({self.name!r}: {segments})"


def mirrored(relation: SegmentRelation) -> SegmentRelation:
    """Return the relation of the left side with the same angles as on the right: mirrored at x-y.

    Rotations about z (right) keep their sign, those about x (forward) and y (up) change it. Of the
    names, "right" becomes "left" and the end "_r" of a column "_l".
    """

    def turned(rotation: AxisRotation) -> AxisRotation:
        x, y, z = (direction(rotation.axis) * _TURNS_BACK).tolist()
        column = re.sub("_r$", "_l", rotation.column or "") or None
        return replace(rotation, axis=(x, y, z), column=column)

    parent = relation.parent
    return replace(
        relation,
        segment=relation.segment.replace("right", "left"),
        parent=None if parent is None else parent.replace("right", "left"),
        rotations=tuple(turned(each) for each in relation.rotations),
        neutral=tuple(turned(each) for each in relation.neutral),
    )


def segments_of_angles(
    convention: AngleConvention,
    time: Array,
    columns: Mapping[str, Array],
) -> SegmentOrientations:
    """Return the orientations of the segments whose columns are in the table.

    Args:
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
