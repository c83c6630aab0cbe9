"""Alignments of known robots: the joint at the shoulder, and axes of base and hand."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.model.anthropometry import Side


@dataclass(frozen=True)
class KnownAlignment:
    """A known robot's alignment: the joint at its shoulder, and axes.

    Attributes:
        joint: at the shoulder, with all joints at zero or at the limit nearest to zero.
        base, hand: columns of the rotations of `Alignment`.
        side: of the body.
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
