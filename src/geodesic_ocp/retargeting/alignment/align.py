"""Alignments of known robots, and those of files."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.records import read_record
from geodesic_ocp.retargeting.alignment.arm_alignment import (
    BASE,
    FORMAT,
    HAND,
    VERSION,
    Alignment,
    arm_length,
    read_direction,
)
from geodesic_ocp.retargeting.alignment.axes import base_axes, hand_axes
from geodesic_ocp.retargeting.alignment.landmarks import landmarks


@dataclass(frozen=True)
class KnownAlignment:
    """A known robot's alignment: the joint at its shoulder, and axes.

    Attributes:
        joint: at the shoulder, with all joints at zero or at the limit nearest to zero.
        base, hand: columns of the rotations of `Alignment`.
        side: side of the body.
        elbow, wrist: joints.
    """

    joint: str
    base: tuple[tuple[int, int, int], ...]
    hand: tuple[tuple[int, int, int], ...]
    side: Side
    elbow: str
    wrist: str


# Columns: images of the person's right, forward, up.
_SAME = ((1, 0, 0), (0, 1, 0), (0, 0, 1))  # x right, y forward, z up
_FORWARD = ((0, -1, 0), (1, 0, 0), (0, 0, 1))  # x forward, y left, z up, as ROS has it (REP 103)
# A single arm is mounted like a shoulder: its first axis points to the right, its x axis forward.
# Upright on a table it reaches at most two thirds of the poses of a person's arm.
_SHOULDER = ((0, 0, 1), (1, 0, 0), (0, 1, 0))
# Columns: the robot hand's axes in the person's hand.
_GRIPPER = ((0, -1, 0), (1, 0, 0), (0, 0, 1))  # z out, opening along y: from the palm to its back
_TURNED = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))
_TALOS_LEFT = ((0, -1, 0), (-1, 0, 0), (0, 0, -1))  # z back to the wrist, at zero as a person's
_TALOS_RIGHT = ((0, 1, 0), (1, 0, 0), (0, 0, -1))

KNOWN = {
    "panda": KnownAlignment(
        "panda_joint1", _SHOULDER, _GRIPPER, "right", "panda_joint4", "panda_joint6"
    ),
    "xarm7": KnownAlignment("joint1", _SHOULDER, _GRIPPER, "right", "joint4", "joint6"),
    "ur5": KnownAlignment(
        "shoulder_pan_joint", _SHOULDER, _GRIPPER, "right", "elbow_joint", "wrist_1_joint"
    ),
    "talos-left-arm": KnownAlignment(
        "arm_left_2_joint", _FORWARD, _TALOS_LEFT, "left", "arm_left_4_joint", "arm_left_6_joint"
    ),
    "talos-right-arm": KnownAlignment(
        "arm_right_2_joint",
        _FORWARD,
        _TALOS_RIGHT,
        "right",
        "arm_right_4_joint",
        "arm_right_6_joint",
    ),
    "tiago-pro-left-arm": KnownAlignment(
        "arm_left_1_joint", _FORWARD, _GRIPPER, "left", "arm_left_4_joint", "arm_left_6_joint"
    ),
    "tiago-pro-right-arm": KnownAlignment(
        "arm_right_1_joint", _FORWARD, _GRIPPER, "right", "arm_right_4_joint", "arm_right_6_joint"
    ),
    # The palms face -x, the thumbs point to y (left) and to -y (right).
    "armar6-left": KnownAlignment(
        "arm_t23_joint_r0", _SAME, _TURNED, "left", "arm_t56_joint_r0", "arm_t78_joint_r0"
    ),
    "armar6-right": KnownAlignment(
        "arm_t23_joint_r1", _SAME, _SAME, "right", "arm_t56_joint_r1", "arm_t78_joint_r1"
    ),
}


_FIELDS = ("shoulder", "base", "hand", "length")
_OPTIONAL = ("side", "elbow", "wrist")
_OTHER = ("format", "version", "help", "notes")
_ACROSS = 0.02  # largest cosine of the angle between two axes; smaller ones are rounding


def read_alignment(file: str | PathLike[str]) -> Alignment:
    """Return the alignment in a JSON file that `Alignment.save` or `geodesic-ocp align` wrote.

    Raises:
        RecordingError: the file is missing, or of another format; a field is missing, unknown or
            malformed. Names the file and the field.
    """
    record = read_record(file, FORMAT, VERSION, "an alignment")
    try:
        for name in record:
            if name not in (*_FIELDS, *_OPTIONAL, *_OTHER):
                known = ", ".join((*_FIELDS, *_OPTIONAL))
                raise ValueError(f"{name!r} is not one of the fields {known}")
        for name in _FIELDS:
            if name not in record:
                raise ValueError(f"{name} is missing")
        right, forward = _axes("base", record["base"], BASE)
        across, fingers = _axes("hand", record["hand"], tuple(HAND))
        return Alignment(
            record["shoulder"],
            np.column_stack([right, forward, np.cross(right, forward)]),
            np.vstack([across, np.cross(fingers, across), fingers]),
            record["length"],
            **{name: record.get(name) for name in _OPTIONAL},
        )
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _axes(field: str, record: Any, names: tuple[str, ...]) -> list[Array]:
    """Return two unit vectors (3,) at right angles."""
    if not isinstance(record, dict) or set(record) != set(names):
        raise ValueError(f"{field} must have the entries {' and '.join(names)}, got {record!r}")
    first, second = (read_direction(f"{field}: {name}", record[name]) for name in names)
    if not abs(first @ second) <= _ACROSS:
        angle = np.degrees(np.arccos(np.clip(first @ second, -1.0, 1.0)))
        raise ValueError(
            f"{field}: {names[0]} and {names[1]} must be at right angles, got {angle:.3g} degrees"
        )
    second = second - first * (first @ second)
    return [first, second / np.linalg.norm(second)]


@dataclass(frozen=True, eq=False)
class Proposal:
    """An alignment found from the kinematics, and what it assumes.

    Attributes:
        alignment: the proposed one.
        assumptions: sentences about what was taken from where.
    """

    alignment: Alignment
    assumptions: tuple[str, ...]


def propose_alignment(robot: Model, *, side: Side | None = None) -> Alignment:
    """Return an alignment of a robot's arm with a person's, from the chain of its joints alone.

    The shoulder is where the axes of the first joints of the arm meet; joints of a torso before
    them do not count. The hand reaches away from the centre of the wrist, and a single arm is
    assumed to be mounted like a shoulder, with its first axis to the right and x forward.
    `geodesic-ocp align` shows all that was assumed, and writes a file to edit.

    >>> import geodesic_ocp as go
    >>> found = go.retargeting.propose_alignment(go.human_arm("right"))
    >>> found.elbow, found.wrist, abs(found.shoulder).round(6).tolist()
    ('REx_joint', 'RWx_joint', [0.0, 0.0, 0.0])

    Args:
        robot: the arm.
        side: side of the body; None: where the shoulder is, or right for a single arm.

    Raises:
        ValueError: fewer than two revolute joints, or an unknown side.
    """
    return proposal(robot, side).alignment


def proposal(robot: Model, side: Side | None = None) -> Proposal:
    """`propose_alignment` with its assumptions."""
    robot = as_model(robot)
    if side is not None and side not in get_args(Side):
        raise ValueError(f"side must be 'right', 'left' or None, got {side!r}")
    found = landmarks(robot)
    base = base_axes(robot, found, side)
    hand = hand_axes(robot, found, base.rotation, base.side)
    if found.crossing:
        where = f"where the axes of {', '.join(found.crossing)} meet"
    else:
        where = "at the first joint of the arm, as no axes meet near it"
    shoulder = f"the shoulder is {where}"
    if found.before:
        shoulder += f"; {', '.join(found.before)} before it, at zero, not counted"
    aligned = Alignment(
        _rounded(found.shoulder),
        base.rotation,
        hand.rotation,
        found.length,
        base.side,
        found.elbow,
        found.wrist,
    )
    return Proposal(aligned, (shoulder, base.reason, *hand.reasons))


def _rounded(point: Array) -> Array:
    """Return without rounding errors, as it is to be read in a file."""
    return np.round(point, 9) + 0.0


_HUMAN: dict[str, Side] = {"human right arm": "right", "human left arm": "left"}


def align(robot: Model, **changes: Any) -> Alignment:
    """Return the default alignment of a robot or of a person's arm, with some fields changed.

    Robots that `load_model` offers by name (panda, talos-left-arm, ...) are known by the name of
    the model; of them, single arms (panda, xarm7, ur5) are assumed to be mounted as a right
    shoulder, with the first axis to the right and x forward. That of any other robot is proposed
    from its kinematics (`propose_alignment`).

    Args:
        robot: the arm.
        changes: fields of `Alignment` to be changed.

    Warns:
        UserWarning: the robot is not known; says what was assumed.

    Raises:
        ValueError: nothing can be proposed, or a change is not a field of an alignment.

    >>> import geodesic_ocp as go
    >>> go.retargeting.align(go.human_arm("left")).side
    'left'
    """
    found = known_alignment(as_model(robot))
    if found is None:
        proposed = proposal(robot)
        warnings.warn(
            f"no alignment is known for {robot.name!r}, so it is taken from the kinematics: "
            f"{'; '.join(proposed.assumptions)}. See it with `geodesic-ocp align`, which also "
            "writes a file to edit",
            UserWarning,
            stacklevel=2,
        )
        found = proposed.alignment
    try:
        return replace(found, **changes)
    except TypeError as error:
        raise ValueError(f"alignment: {error}") from None


def known_alignment(robot: Model) -> Alignment | None:
    """Return the alignment of a known robot or of a person's arm, by the name of the model."""
    name, _, _ = robot.name.partition(" with ")  # a payload
    known = KNOWN.get(name)
    if name in _HUMAN:
        side, axes = _HUMAN[name], np.eye(3)
        joints = (f"{side[0].upper()}{each}_joint" for each in ("Ex", "Wx"))
        return Alignment(np.zeros(3), axes, axes, robot.reach, side, *joints)
    if known is None:
        return None
    usual = ROBOTS[name]
    if not all(robot.pin.existFrame(each) for each in (known.joint, usual.hand, usual.base)):
        return None
    home = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    base, hand = (np.array(columns, dtype=float).T for columns in (known.base, known.hand))
    # The model may have been loaded with another base, or another hand.
    base = robot.frame_pose(usual.base, home)[0] @ base
    hand = hand @ robot.frame_pose(usual.hand, home)[0].T @ robot.hand_pose(home)[0]
    _, shoulder = robot.frame_pose(known.joint, home)
    length = arm_length(robot, known.joint)
    return Alignment(shoulder, base, hand, length, known.side, known.elbow, known.wrist)
