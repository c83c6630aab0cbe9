"""Alignments from the kinematics alone: known robots, humanoids, and an arm nobody knows."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from six_joints import six_joints

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.retargeting.arm_alignment import (
    known_alignment,
    proposal,
    propose_alignment,
)
from geodesic_ocp.retargeting.reachability import reachability

needs_robots = pytest.mark.skipif(
    folder("example-robot-data") is None or folder("armar") is None, reason="needs robots"
)
FORWARD_LEFT_UP = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# A gripper with two fingers can be turned by half a revolution: the built-in alignments of these
# arms have the other one of the two.
TURNED = ("xarm7", "ur5")
# The axes of the shoulder's joints meet 0.18 m from the first joint, which the built-in alignment
# has as the shoulder.
SHIFTED = ("tiago-pro", "tiago-pro-left-arm", "tiago-pro-right-arm")


@needs_robots
@pytest.mark.filterwarnings("ignore:.*comma in rpy")
@pytest.mark.parametrize("name", ROBOTS)
def test_proposals_agree_with_built_in_alignments(name: str) -> None:
    robot = go.load_model(name)
    known, found = known_alignment(robot), propose_alignment(robot)
    assert known is not None
    assert (found.side, found.elbow, found.wrist) == (known.side, known.elbow, known.wrist)
    assert_allclose(found.base, known.base, atol=1e-9)
    half_turn = np.diag([-1.0, -1.0, 1.0]) if name in TURNED else np.eye(3)
    assert_allclose(half_turn @ found.hand, known.hand, atol=1e-9)
    distance = np.linalg.norm(np.asarray(found.shoulder) - np.asarray(known.shoulder))
    assert distance < (0.2 if name in SHIFTED else 1e-3)
    assert abs(found.length - known.length) <= distance + 1e-3 * known.length


@pytest.mark.slow
@needs_robots
@pytest.mark.filterwarnings("ignore:.*centauro")
@pytest.mark.parametrize(
    ("name", "hand", "elbow", "wrist", "side", "fingers"),
    [
        ("baxter", "left_gripper", "left_e1", "left_w1", "left", (0, 0, 1)),
        (
            "pr2",
            "r_gripper_tool_frame",
            "r_elbow_flex_joint",
            "r_wrist_flex_joint",
            "right",
            (1, 0, 0),
        ),
        ("romeo_small", "l_gripper", "LElbowYaw", "LWristYaw", "left", (1, 0, 0)),
        (
            "g1_29dof_rev_1_0",
            "right_rubber_hand",
            "right_elbow_joint",
            "right_wrist_pitch_joint",
            "right",
            (1, 0, 0),
        ),
        (
            "alex_nub_hands",
            "LeftGripperYawLink",
            "LeftElbowPitch",
            "LeftWristRoll",
            "left",
            (0, 0, -1),
        ),
        (
            "tiago_dual",
            "arm_right_tool_link",
            "arm_right_4_joint",
            "arm_right_6_joint",
            "right",
            (1, 0, 0),
        ),
        ("centauro", "ball2_tip", "j_arm2_4", "j_arm2_6", "right", (0, 0, -1)),
        ("simple_humanoid", "l_wrist", "LARM_ELBOW", "LARM_WRIST_P", "left", (0, 0, -1)),
    ],
)
@pytest.mark.filterwarnings("ignore:simple_humanoid. .* such large moments")  # its placeholders
def test_arms_of_bodies(
    name: str, hand: str, elbow: str, wrist: str, side: str, fingers: tuple[int, ...]
) -> None:
    """Joints of torsos and lifts do not count, and bodies stand upright with x forward."""
    found = propose_alignment(go.load_model(name, hand=hand))
    assert (found.elbow, found.wrist, found.side) == (elbow, wrist, side)
    assert_allclose(found.base, FORWARD_LEFT_UP, atol=1e-9)
    assert_allclose(np.asarray(found.hand)[2], fingers, atol=1e-9)
    across = float(np.asarray(found.shoulder)[1])
    assert across > 0.09 if side == "left" else across < -0.09


@pytest.mark.parametrize("side", ["right", "left"])
def test_human_arms_have_their_own_alignment(side: str) -> None:
    arm = go.human_arm(side)
    known, found = go.retargeting.align(arm), propose_alignment(arm, side="right")
    assert_allclose(found.shoulder, known.shoulder, atol=1e-9)
    assert_allclose(found.base, known.base, atol=1e-9)
    assert_allclose(found.hand, known.hand, atol=1e-9)
    assert found.length == pytest.approx(known.length, rel=1e-6)
    assert (found.elbow, found.wrist) == (known.elbow, known.wrist)


def test_an_unknown_arm_is_mounted_like_a_shoulder_and_says_so() -> None:
    robot = go.load_model(six_joints(), hand="flange")
    with pytest.warns(UserWarning, match="no alignment is known for 'six-joints'") as caught:
        found = go.retargeting.align(robot)
    text = str(caught[0].message)
    for part in ("where the axes of pan, lift meet", "first axis points to the right", "flange"):
        assert part in text
    assert "geodesic-ocp align" in text
    assert_allclose(found.shoulder, [0.0, 0.0, 0.35], atol=1e-9)
    assert_allclose(found.base, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-9)
    assert_allclose(np.asarray(found.hand)[2], [0, 0, 1], atol=1e-9)
    assert_allclose(np.abs(np.asarray(found.hand)[0]), [0, 1, 0], atol=1e-9)
    assert found.length == pytest.approx(0.4 + 0.2 + 0.18 + 0.05 + 0.08, abs=1e-6)
    assert (found.elbow, found.wrist, found.side) == ("bend", "pitch", "right")
    mirrored = propose_alignment(robot, side="left")
    assert_allclose(np.asarray(mirrored.base)[:, 0], [0, 0, -1], atol=1e-9)


def test_a_lift_before_the_arm_does_not_spoil_its_shoulder() -> None:
    robot = go.load_model(six_joints(lift=True), hand="flange")
    found, assumptions = proposal(robot)
    assert_allclose(found.shoulder, [0.0, 0.0, 0.35], atol=1e-9)
    assert found.length == pytest.approx(0.91, abs=1e-6)
    assert "column before it" in assumptions[0]
    base = assumptions[0].partition("--base ")[2].partition(")")[0]
    arm = go.load_model(six_joints(lift=True), hand="flange", base=base)
    assert arm.joint_names == tuple(each for each in robot.joint_names if each != "column")
    assert_allclose(np.asarray(found.base)[:, 2], [0, 0, 1], atol=1e-9)


def test_an_arm_without_a_wrist_has_an_elbow() -> None:
    found = propose_alignment(go.load_model(six_joints(), hand="roll_link"))
    assert (found.elbow, found.wrist) == ("bend", None)
    assert found.length == pytest.approx(0.6)


def test_proposals_turn_with_the_hand_frame() -> None:
    """Another frame on the same link: the same directions in space."""
    text = six_joints().replace("</robot>", (
        '<link name="tilted"/><joint name="adapter" type="fixed"><parent link="flange"/>'
        '<child link="tilted"/><origin rpy="0 1.5707963267948966 0"/></joint></robot>'
    ))  # fmt: skip
    one, other = (propose_alignment(go.load_model(text, hand=h)) for h in ("flange", "tilted"))
    turn = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    assert_allclose(np.asarray(one.hand) @ turn, other.hand, atol=1e-6)


def test_other_hands_and_bases_of_known_robots_keep_their_directions() -> None:
    if folder("example-robot-data") is None:
        pytest.skip("needs robots: make robots")
    usual, flange = go.load_model("panda"), go.load_model("panda", hand="panda_link8")
    q = np.array([0.1, -0.4, 0.3, -1.8, 0.2, 1.5, 0.6])
    one, other = go.retargeting.align(usual), go.retargeting.align(flange)
    assert_allclose(
        usual.hand_pose(q)[0] @ np.asarray(one.hand).T,
        flange.hand_pose(q)[0] @ np.asarray(other.hand).T,
        atol=1e-9,
    )


@needs_robots
@pytest.mark.parametrize("name", ["panda", "talos-right-arm", "ur5"])
def test_proposals_reach_as_much_as_built_in_alignments(name: str) -> None:
    """Of random poses of a person's arm in front of the body."""
    robot, arm = go.load_model(name), go.human_arm("right")
    rng = np.random.default_rng(3)
    low, high = np.array(
        [[-0.3, -0.3, -1.2, 0.3, -0.8, -0.2, -0.6], [1.3, 0.6, 0.0, 1.9, 0.8, 0.2, 0.6]]
    )
    poses = go.retargeting.align(arm).to_person(*arm.hand_pose(rng.uniform(low, high, (30, 7))))
    counts = []
    for aligned in (known_alignment(robot), propose_alignment(robot)):
        assert aligned is not None
        mapped = aligned.to_robot(*poses, scale=aligned.length / arm.reach)
        counts.append(30 - len(reachability(robot, aligned, *mapped).unreachable))
    assert counts[1] >= counts[0] - 2
    assert counts[1] >= 20


def test_arms_without_two_revolute_joints_and_wrong_sides_are_refused() -> None:
    robot = go.load_model(six_joints(), hand="pan_link")
    with pytest.raises(ValueError, match="has 1 revolute joints before its hand 'pan_link'"):
        go.retargeting.align(robot)
    with pytest.raises(ValueError, match="side must be 'right', 'left' or None, got 'up'"):
        propose_alignment(go.human_arm(), side="up")  # type: ignore[arg-type]
