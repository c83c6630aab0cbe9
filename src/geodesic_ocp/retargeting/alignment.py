"""Alignment of a robot's arm with a person's: shoulder, axes of base and hand, length, side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_rotation, as_vector, short_repr
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.max_reach import max_reach
from geodesic_ocp.model.model import Model

# Across the sagittal plane: x points to a person's side.
_MIRROR = np.diag([-1.0, 1.0, 1.0])
_HUMAN: dict[str, Side] = {"human right arm": "right", "human left arm": "left"}


@dataclass(frozen=True, eq=False, repr=False)
class Alignment:
    """Position of a person's shoulder on a robot, and correspondence of the axes of base and hand.

    A hand pose with rotation R and position p in the person's axes (x right, y forward, z up,
    relative to the shoulder) is mapped to base R hand and shoulder + scale base p in the robot's
    base frame.

    Attributes:
        shoulder: position of the person's shoulder in the robot's base frame, (3,) [m].
        base: rotation (3, 3) whose columns are the person's x, y and z in the robot's base axes.
        hand: rotation (3, 3) whose columns are the axes of the robot's hand in those of the
            person's: x to the right and y backward of the hanging hand with the palm to the body,
            z along the fingers.
        length: of the robot's arm: the largest distance of the hand from that position [m].
        side: of the body, "right" or "left"; recordings of the other side are mirrored. None:
            either side.

    Raises:
        ValueError: wrong shapes or values; the message names the field.
    """

    shoulder: ArrayLike
    base: ArrayLike
    hand: ArrayLike
    length: float
    side: Side | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shoulder", as_vector("shoulder", self.shoulder, 3))
        for name in ("base", "hand"):
            object.__setattr__(self, name, as_rotation(name, getattr(self, name)))
        object.__setattr__(self, "length", as_positive("length", self.length, "m"))
        if self.side is not None and self.side not in get_args(Side):
            raise ValueError(f"side must be 'right', 'left' or None, got {self.side!r}")

    def __repr__(self) -> str:
        return short_repr(self)

    def to_robot(
        self, rotation: Array, position: Array, *, scale: float, mirror: bool = False
    ) -> tuple[Array, Array]:
        """Poses of the robot's hand from poses of a person's hand.

        Args:
            rotation: (..., 3, 3) of the person's hand.
            position: (..., 3) [m], relative to the shoulder.
            scale: factor of positions, usually the ratio of the arms' lengths.
            mirror: whether to exchange left and right.

        Returns:
            Rotations (..., 3, 3) and positions (..., 3) [m] in the robot's base frame.
        """
        base, hand, shoulder = (np.asarray(each) for each in (self.base, self.hand, self.shoulder))
        if mirror:
            # The axes of the hand are mirrored as well, so that the result is a rotation.
            rotation, position = _MIRROR @ rotation @ _MIRROR, position @ _MIRROR
        return base @ rotation @ hand, shoulder + scale * position @ base.T

    def to_person(
        self, rotation: Array, position: Array, *, scale: float = 1.0, mirror: bool = False
    ) -> tuple[Array, Array]:
        """The inverse of `to_robot`: poses in the person's axes, relative to the shoulder."""
        base, hand, shoulder = (np.asarray(each) for each in (self.base, self.hand, self.shoulder))
        rotation, position = base.T @ rotation @ hand.T, (position - shoulder) @ base / scale
        if mirror:
            rotation, position = _MIRROR @ rotation @ _MIRROR, position @ _MIRROR
        return rotation, position


@dataclass(frozen=True)
class _Known:
    """A known robot's alignment: the joint at its shoulder, and axes.

    Attributes:
        joint: at the shoulder, with all joints at zero or at the limit nearest to zero.
        base, hand: columns of the rotations of `Alignment`.
        side: of the body.
    """

    joint: str
    base: tuple[tuple[int, int, int], ...]
    hand: tuple[tuple[int, int, int], ...]
    side: Side


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

_ALIGNMENTS = {
    "panda": _Known("panda_joint1", _SHOULDER, _GRIPPER, "right"),
    "xarm7": _Known("joint1", _SHOULDER, _GRIPPER, "right"),
    "ur5": _Known("shoulder_pan_joint", _SHOULDER, _GRIPPER, "right"),
    "talos-left-arm": _Known("arm_left_2_joint", _FORWARD, _TALOS_LEFT, "left"),
    "talos-right-arm": _Known("arm_right_2_joint", _FORWARD, _TALOS_RIGHT, "right"),
    "tiago-pro-left-arm": _Known("arm_left_1_joint", _FORWARD, _GRIPPER, "left"),
    "tiago-pro-right-arm": _Known("arm_right_1_joint", _FORWARD, _GRIPPER, "right"),
    # The palms face -x, the thumbs point to y (left) and to -y (right).
    "armar6-left": _Known("arm_t23_joint_r0", _SAME, _TURNED, "left"),
    "armar6-right": _Known("arm_t23_joint_r1", _SAME, _SAME, "right"),
}


def alignment(robot: Model, **changes: Any) -> Alignment:
    """The default alignment of a known robot or of a person's arm, with some fields changed.

    Known are the robots that `load_model` offers by name (panda, talos-left-arm, ...), by the
    name of the model. Single arms (panda, xarm7, ur5) are assumed to be mounted as a right
    shoulder, with the first axis to the right and x forward.

    Args:
        robot: the arm.
        changes: fields of `Alignment` to be changed.

    Raises:
        ValueError: the robot is not known, or a change is not a field of an alignment.

    >>> import geodesic_ocp as go
    >>> go.alignment(go.human_arm("left")).side
    'left'
    """
    name, _, _ = robot.name.partition(" with ")  # a payload
    known = _ALIGNMENTS.get(name)
    if name in _HUMAN:
        axes = np.eye(3)
        found = Alignment(np.zeros(3), axes, axes, robot.reach, _HUMAN[name])
    elif known is None or not robot.pin.existFrame(known.joint):
        raise ValueError(
            f"there is no default alignment for {robot.name!r}, only for {', '.join(_ALIGNMENTS)}; "
            "describe how its axes correspond to a person's with go.Alignment(shoulder, base, "
            "hand, length)"
        )
    else:
        home = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
        base, hand = (np.array(columns, dtype=float).T for columns in (known.base, known.hand))
        _, shoulder = robot.frame_pose(known.joint, home)
        found = Alignment(shoulder, base, hand, arm_length(robot, known.joint), known.side)
    try:
        return replace(found, **changes)
    except TypeError as error:
        raise ValueError(f"alignment: {error}") from None


def arm_length(model: Model, joint: str) -> float:
    """Largest distance [m] of the hand from a joint, within the limits.

    Raises:
        ValueError: there is no such joint.
    """
    origin = model.joint_of(joint)
    hand = frame_index(model.pin, model.hand)
    return max_reach(model.pin, hand, model.lower, model.upper, origin)
