"""SkeletonConvention: which joints of a skeleton carry which segments of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geodesic_ocp.arrays import as_choice, as_number, as_positive, settle
from geodesic_ocp.recordings.conventions.segment_orientations import ARM, SEGMENTS, SIDES, TRUNK
from geodesic_ocp.records import as_stated
from geodesic_ocp.trajectory.files.text_lines import LENGTHS

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
RESTS = ("zero", "first frame")
UNITS = LENGTHS | {"in": 0.0254}  # [m]


@dataclass(frozen=True)
class SkeletonConvention:
    """Names, axes and rest pose of a family of skeletons.

    >>> import geodesic_ocp.recordings.conventions.skeleton_convention as skeletons
    >>> mine = skeletons.SkeletonConvention(
    ...     "mine",
    ...     {"thorax": "Torso", "right upper arm": "RUpper", "right forearm": ("RLower", "RElbow")},
    ...     up="+z",
    ...     forward="-y",
    ... )
    >>> mine.joints["thorax"]
    ('Torso',)

    Attributes:
        name: name of the convention, for messages.
        joints: joints by segment ("pelvis", "abdomen", "thorax", "right upper arm", "right
            forearm", "right hand" and the same on the left): the name of the joint or bone that
            carries it, or the names that it may have, the best first. Names are compared without
            regard to case, spaces, hyphens, underscores and a namespace in front of a colon.
        up: axis of the file, such as "+y", that points upwards in the rest pose; by default it is
            found from the rest pose.
        forward: axis that points forward there; found from the rest pose by default.
        space_up: vertical axis of the space in which the person moves; `up` by default.
        rest: the pose in which the person stands upright with straight arms: "zero" (all joint
            angles are zero) or "first frame".
        twist: angle by which the axes of an arm segment are turned about its long axis in the
            rest pose, against those of `neutral_frames` [deg].
        unit: unit of lengths in the file: "m", "cm", "mm", "in", or metres per unit; None if the
            file or its format says it, or if it is not known.

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
        settle(self, joints=names)
        for what in ("up", "forward", "space_up"):
            if getattr(self, what) is not None:
                as_choice(what, getattr(self, what), AXES)
        if (self.up is None) != (self.forward is None):
            raise ValueError("up and forward are given together, or not at all")
        if self.up is not None and self.forward is not None and self.up[1] == self.forward[1]:
            raise ValueError(f"up and forward must be two axes, got {self.up} and {self.forward}")
        if self.rest not in RESTS:
            raise ValueError(f"rest must be {' or '.join(map(repr, RESTS))}, got {self.rest!r}")
        for segment, angle in self.twist.items():
            as_number(f"twist of the {segment}", angle)
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


def metres_per_unit(
    unit: str | float | None, convention: SkeletonConvention | None = None
) -> float | None:
    """Return metres per unit of length, or of the convention's unit if none is given.

    Raises:
        ValueError: an unknown name, or a number that is not positive.
    """
    if unit is None:
        unit = convention.unit if convention is not None else None
    if isinstance(unit, str):
        if unit not in UNITS:
            raise ValueError(
                f"unit must be 'm', 'cm', 'mm', 'in' or a number of metres, got {unit!r}"
            )
        return UNITS[unit]
    return None if unit is None else as_positive("unit", unit, "m")


def _family(name: str, *joints: str | tuple[str, ...], **axes: Any) -> SkeletonConvention:
    """Return a convention of skeletons whose joints have these names.

    Args:
        name: name of the convention.
        joints: names of the joints that carry pelvis, abdomen, thorax, upper arm, forearm and hand,
            in this order; those of the arms with {side}, {Side}, {s} or {S} in them.
        axes: up and forward.
    """
    parts = zip((*TRUNK, *ARM), joints, strict=True)
    named = {segment: _names(segment, given) for segment, given in parts}
    found = {segment: named[segment] for segment in TRUNK}
    for side in SIDES:
        letters = {"side": side, "Side": side.title(), "s": side[0], "S": side[0].upper()}
        for part in ARM:
            found[f"{side} {part}"] = tuple(each.format(**letters) for each in named[part])
    return SkeletonConvention(name, found, **axes)


# Between pelvis and thorax many skeletons have two or more joints, of which the abdomen's is one:
# that only decides how their rotation is shared between the lower and the upper joint of the trunk.
_CMU = _family(
    # The bones of the database's .asf files. The radius has the flexion of the elbow, the bone
    # after it ("wrist") the pronation, the hand the flexion and the abduction of the wrist.
    "CMU Graphics Lab (ASF)",
    "root",
    ("upperback", "lowerback"),
    "thorax",
    "{s}humerus",
    ("{s}wrist", "{s}radius"),
    "{s}hand",
)
_HUMAN_IK = _family(
    # Names of MotionBuilder's HumanIK, with Mixamo's and 3ds Max's namespaces in front or not; also
    # those of the CMU database's BVH files, of Perception Neuron's and of the SOMA skeleton, which
    # has Spine1, Spine2 and Chest. "RightShoulder" is the clavicle here.
    "MotionBuilder, Mixamo, Perception Neuron, SOMA",
    "Hips",
    ("Spine2", "Spine1", "Spine", "LowerBack"),
    ("Chest", "Spine3", "Spine2", "Spine1", "Spine"),
    "{Side}Arm",
    "{Side}ForeArm",
    ("{Side}FingerBase", "{Side}Hand"),
)
_BIOVISION = _family(
    # Biovision's own names, and those of BVH files from Xsens MVN with Chest to Chest4.
    # "RightShoulder" is the upper arm here, "RightCollar" the clavicle.
    "Biovision, Xsens MVN (BVH)",
    ("Hips", "Hip"),
    ("Chest2", "Chest", "Abdomen", "Spine"),
    ("Chest4", "Chest3", "Chest2", "Chest", "Torso", "Spine"),
    ("{Side}Shoulder", "{Side}UpArm"),
    ("{Side}Elbow", "{Side}LowArm"),
    ("{Side}Wrist", "{Side}Hand"),
)
_MVN = _family(
    # Segments of the Xsens MVN user manual; "RightShoulder" is the clavicle here.
    "Xsens MVN (segments)",
    "Pelvis",
    ("L3", "L5"),
    "T8",
    "{Side}UpperArm",
    "{Side}ForeArm",
    "{Side}Hand",
)
_BIPED = _family(
    "3ds Max Biped",
    "Bip01 Pelvis",
    ("Bip01 Spine2", "Bip01 Spine1", "Bip01 Spine"),
    ("Bip01 Spine3", "Bip01 Spine2", "Bip01 Spine1", "Bip01 Spine"),
    "Bip01 {S} UpperArm",
    "Bip01 {S} Forearm",
    "Bip01 {S} Hand",
)
_POSER = _family("Poser and DAZ", "hip", "abdomen", "chest", "{s}Shldr", "{s}ForeArm", "{s}Hand")
#: The body joints of SMPL (Loper et al. 2015, "SMPL: a skinned multi-person linear model", ACM
#: Transactions on Graphics 34(6)): the rest pose is a T pose with y up, facing z.
SMPL = _family(
    "SMPL",
    "pelvis",
    ("spine2", "spine1"),
    "spine3",
    "{side}_shoulder",
    "{side}_elbow",
    "{side}_wrist",
    up="+y",
    forward="+z",
)
#: Conventions that files are compared with, in this order; see `SkeletonConvention` for others.
SKELETON_CONVENTIONS = (_CMU, _HUMAN_IK, _BIOVISION, _MVN, _BIPED, _POSER, SMPL)


def as_skeleton_convention(
    given: SkeletonConvention | str | Path | None,
) -> SkeletonConvention | None:
    """Return the convention itself, or the one in a JSON or TOML file with the attributes as its
    keys.

        {"name": "mine", "up": "+z", "forward": "+y",
         "joints": {"thorax": "Torso", "right upper arm": ["RUpper", "RArm"]}}

    With "extends", the attributes of a known convention are those that the file leaves out:

        {"extends": "SMPL", "space_up": "+y"}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a convention nor a path.
    """
    known = SKELETON_CONVENTIONS
    return as_stated(SkeletonConvention, given, "convention", "a convention", known)
