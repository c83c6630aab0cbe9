"""SkeletonConvention: which joints of a skeleton carry which segments of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS
from geodesic_ocp.recordings.units import LENGTHS

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
RESTS = ("zero", "first frame")
UNITS = LENGTHS | {"in": 0.0254}  # [m]


@dataclass(frozen=True)
class SkeletonConvention:
    """Names, axes and rest pose of a family of skeletons.

    >>> import geodesic_ocp.recordings.skeletons.skeleton_convention as skeletons
    >>> mine = skeletons.SkeletonConvention(
    ...     "mine",
    ...     {"thorax": "Torso", "right upper arm": "RUpper", "right forearm": ("RLower", "RElbow")},
    ...     up="+z",
    ...     forward="-y",
    ... )
    >>> mine.joints["thorax"]
    ('Torso',)

    Attributes:
        name: of the convention, for messages.
        joints: by segment ("pelvis", "abdomen", "thorax", "right upper arm", "right forearm",
            "right hand" and the same on the left), the name of the joint or bone that carries it,
            or the names that it may have, the best first. Names are compared without regard to
            case, spaces, hyphens, underscores and a namespace in front of a colon.
        up: axis of the file, such as "+y", that points upwards in the rest pose; by default it is
            found from the rest pose.
        forward: axis that points forward there; found from the rest pose by default.
        space_up: vertical axis of the space in which the person moves; `up` by default.
        rest: the pose in which the person stands upright with straight arms: "zero" (all joint
            angles are zero) or "first frame".
        twist: by segment of the arms, how far its axes are turned about its long axis in the rest
            pose, against those of `neutral_frames` [deg].
        unit: of lengths in the file: "m", "cm", "mm", "in", or metres per unit; None if the file
            or its format says it, or if it is not known.

    Raises:
        ValueError: a segment, axis, rest pose or unit of another name.
    """

    name: str
    joints: Mapping[str, str | tuple[str, ...]]
    up: str | None = None
    forward: str | None = None
    space_up: str | None = None
    rest: str = "zero"
    twist: Mapping[str, float] = field(default_factory=dict)
    unit: str | float | None = None

    def __post_init__(self) -> None:
        arms = [segment for segment in SEGMENTS if " " in segment]
        _check_segments("joints", self.joints, SEGMENTS)
        _check_segments("twist", self.twist, arms)
        names = {segment: _names(segment, given) for segment, given in self.joints.items()}
        object.__setattr__(self, "joints", names)
        for what in ("up", "forward", "space_up"):
            axis = getattr(self, what)
            if axis is not None and axis not in AXES:
                raise ValueError(f"{what} must be one of {', '.join(AXES)}, got {axis!r}")
        if (self.up is None) != (self.forward is None):
            raise ValueError("up and forward are given together, or not at all")
        if self.up is not None and self.forward is not None and self.up[1] == self.forward[1]:
            raise ValueError(f"up and forward must be two axes, got {self.up} and {self.forward}")
        if self.rest not in RESTS:
            raise ValueError(f"rest must be {' or '.join(map(repr, RESTS))}, got {self.rest!r}")
        for segment, angle in self.twist.items():
            as_number(f"twist of the {segment}", angle)
        if self.unit is not None:
            metres_per_unit(self.unit)

    def __repr__(self) -> str:
        return f"SkeletonConvention({self.name!r}, {len(self.joints)} segments)"


def _check_segments(what: str, given: object, allowed: Sequence[str]) -> None:
    if not isinstance(given, Mapping) or not set(given) <= set(allowed):
        raise ValueError(f"{what} must be given by segment ({', '.join(allowed)}), got {given!r}")


def _names(segment: str, given: object) -> tuple[str, ...]:
    listed = [given] if isinstance(given, str) else given
    if not isinstance(listed, (tuple, list)) or not all(
        isinstance(name, str) and name for name in listed
    ):
        raise ValueError(f"joints of the {segment} must be names, got {given!r}")
    return tuple(listed)


def metres_per_unit(unit: str | float) -> float:
    """Metres per unit of length, from its name or as it is given.

    Raises:
        ValueError: an unknown name, or a number that is not positive.
    """
    if isinstance(unit, str):
        if unit not in UNITS:
            raise ValueError(
                f"unit must be 'm', 'cm', 'mm', 'in' or a number of metres, got {unit!r}"
            )
        return UNITS[unit]
    return as_positive("unit", unit, "m")
