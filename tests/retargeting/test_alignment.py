"""Alignments: maps of hand poses to a robot and back, mirroring, and known robots."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from installed_robots import needs_robots
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder, locate
from geodesic_ocp.retargeting.arm_alignment import arm_length

DOWN, FORWARD, RIGHT = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0, 0])


@pytest.fixture
def some(rng: np.random.Generator) -> go.retargeting.Alignment:
    base, hand = Rotation.random(2, random_state=3).as_matrix()
    return go.retargeting.Alignment(rng.normal(size=3), base, hand, 1.2)


def test_maps_to_robot_and_person_are_inverse(
    some: go.retargeting.Alignment, rng: np.random.Generator
) -> None:
    rotations = Rotation.random(5, random_state=1).as_matrix()
    positions = rng.normal(size=(5, 3))
    for mirror in (True, False):
        mapped = some.to_robot(rotations, positions, scale=1.3, mirror=mirror)
        back = some.to_person(*mapped, scale=1.3, mirror=mirror)
        assert_allclose(back[0], rotations, atol=1e-12)
        assert_allclose(back[1], positions, atol=1e-12)
    one = some.to_robot(rotations[2], positions[2], scale=1.3)
    assert_allclose(one[1], mapped[1][2], atol=1e-12)


def test_positions_are_scaled_from_the_shoulder(some: go.retargeting.Alignment) -> None:
    axes = np.eye(3)
    _, at_shoulder = some.to_robot(axes, np.zeros(3), scale=2.0)
    _, mapped = some.to_robot(axes, np.array([0.1, 0.2, -0.3]), scale=2.0)
    assert_allclose(at_shoulder, some.shoulder)
    assert np.linalg.norm(mapped - at_shoulder) == pytest.approx(
        2.0 * np.linalg.norm([0.1, 0.2, 0.3])
    )


def test_mirrored_right_arm_is_the_left_arm() -> None:
    """Mirrored configurations of the right arm have the poses of the left arm, frame by frame."""
    right, left = go.human_arm("right", 1.8), go.human_arm("left", 1.8)
    here = go.retargeting.align(right)
    rng = np.random.default_rng(4)
    for q in rng.uniform(right.lower, right.upper, (5, 7)):
        # Joints about y and z rotate in the opposite direction on the other side.
        signs = np.array([1.0 if name[2] == "x" else -1.0 for name in right.joint_names])
        mirrored = here.to_robot(*right.hand_pose(q), scale=1.0, mirror=True)
        of_left = left.hand_pose(signs * q)
        assert_allclose(mirrored[0], of_left[0], atol=1e-9)
        assert_allclose(mirrored[1], of_left[1], atol=1e-9)


def test_alignment_of_a_human_arm_scales_with_height() -> None:
    small, tall = go.human_arm("left", 1.5), go.human_arm("left", 2.0)
    found = go.retargeting.align(tall.with_payload(1.0))
    assert found.side == "left"
    assert found.length / go.retargeting.align(small).length == pytest.approx(2.0 / 1.5, rel=1e-6)
    assert_allclose(found.base, np.eye(3))


def test_elbow_and_wrist_of_a_human_arm() -> None:
    for side, letter in (("right", "R"), ("left", "L")):
        found = go.retargeting.align(go.human_arm(side))
        assert (found.elbow, found.wrist) == (f"{letter}Ex_joint", f"{letter}Wx_joint")


def test_changed_fields_and_unknown_robots() -> None:
    arm = go.human_arm()
    assert go.retargeting.align(arm, side=None).side is None
    with pytest.raises(ValueError, match=r"alignment: .*'colour'"):
        go.retargeting.align(arm, colour="red")
    unknown = pin.buildSampleModelManipulator()
    model = go.Model(unknown, unknown.frames[-1].name)
    with pytest.warns(UserWarning, match=r"no alignment is known for .*geodesic-ocp align"):
        assert go.retargeting.align(model, side="left").side == "left"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shoulder": (0, 0)}, "shoulder"),
        ({"base": np.ones((3, 3))}, "base must be a rotation"),
        ({"hand": -np.eye(3)}, "hand must be a rotation"),
        ({"length": 0.0}, "length must be positive"),
        ({"side": "up"}, "side must be"),
        ({"elbow": 4}, "elbow must be the name of a joint"),
        ({"wrist": ""}, "wrist must be the name of a joint"),
    ],
)
def test_wrong_fields_are_named(change: dict[str, Any], message: str) -> None:
    fields: dict[str, Any] = {
        "shoulder": np.zeros(3),
        "base": np.eye(3),
        "hand": np.eye(3),
        "length": 1.0,
    }
    with pytest.raises(ValueError, match=message):
        go.retargeting.Alignment(**{**fields, **change})


def test_arm_length_is_measured_from_the_given_joint() -> None:
    """With two links of one metre, the hand is always one metre from the elbow."""
    chain = pin.Model()
    at = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    shoulder = chain.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
    elbow = chain.addJoint(shoulder, pin.JointModelRZ(), at, "elbow")
    for joint, name in ((shoulder, "shoulder"), (elbow, "elbow")):
        chain.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        chain.addFrame(pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.JOINT))
    chain.addFrame(pin.Frame("hand", elbow, at, pin.FrameType.OP_FRAME))
    chain.lowerPositionLimit, chain.upperPositionLimit = np.array([[-3.0, 0.2], [3.0, 2.0]])
    model = go.Model(chain, "hand")
    assert arm_length(model, "elbow") == pytest.approx(1.0, rel=1e-9)
    assert arm_length(model, "shoulder") == pytest.approx(2.0 * np.cos(0.1), rel=1e-6)


def hanging(name: str, package: str) -> tuple[go.retargeting.Alignment, np.ndarray, np.ndarray]:
    """The robot's alignment, and the pose on it of the hand of a person's hanging arm."""
    if folder(package) is None:
        pytest.skip(f"{package} is not installed: make robots")
    robot = go.load_model(name)
    aligned = go.retargeting.align(robot)
    person = go.human_arm(aligned.side or "right")
    scale = aligned.length / person.reach
    pose = aligned.to_robot(*person.hand_pose(np.zeros(7)), scale=scale)
    return aligned, *pose


@pytest.mark.filterwarnings("ignore:.*comma in rpy")
@pytest.mark.parametrize(
    ("name", "package", "fingers", "palm"),
    [  # in the hand's frame: where the fingers point, and the palm's normal up to its sign
        ("panda", "example-robot-data", (0, 0, 1), (0, 1, 0)),
        ("xarm7", "example-robot-data", (0, 0, 1), (0, 1, 0)),
        ("talos-left-arm", "example-robot-data", (0, 0, -1), (0, 1, 0)),
        ("talos-right-arm", "example-robot-data", (0, 0, -1), (0, 1, 0)),
        ("armar6-left", "armar", (0, 0, 1), (-1, 0, 0)),
        ("armar6-right", "armar", (0, 0, 1), (-1, 0, 0)),
    ],
)
def test_hanging_hands_of_robots(
    name: str, package: str, fingers: tuple[int, ...], palm: tuple[int, ...]
) -> None:
    """Fingers point down, the palm to the side, and the hand is below the shoulder."""
    aligned, rotation, position = hanging(name, package)
    base = np.asarray(aligned.base)
    assert_allclose(base.T @ rotation @ fingers, DOWN, atol=1e-9)
    assert abs(RIGHT @ base.T @ rotation @ palm) == pytest.approx(1.0, abs=1e-9)
    below = base.T @ (position - np.asarray(aligned.shoulder))
    assert -below[2] == pytest.approx(aligned.length, rel=1e-2)


@pytest.mark.filterwarnings("ignore:.*comma in rpy")
@pytest.mark.parametrize(("side", "thumb"), [("left", (0, 1, 0)), ("right", (0, -1, 0))])
def test_palms_and_thumbs_of_armar(side: str, thumb: tuple[int, ...]) -> None:
    """As its meshes show: palms face -x, to the body, and thumbs point forward."""
    aligned, rotation, _ = hanging(f"armar6-{side}", "armar")
    assert aligned.side == side
    to_body = np.array([1.0 if side == "left" else -1.0, 0.0, 0.0])
    assert_allclose(rotation @ (-1, 0, 0), to_body, atol=1e-9)
    assert_allclose(rotation @ thumb, FORWARD, atol=1e-9)


def test_axes_of_the_human_hand_are_as_documented() -> None:
    """With the arm hanging: x to the right, y backward, z along the fingers."""
    rotation, _ = go.human_arm().hand_pose(np.zeros(7))
    assert_allclose(rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-12)


@needs_robots
def test_half_a_turn_exchanges_the_fingers_of_parallel_grippers() -> None:
    known = {name: robot for name, robot in ROBOTS.items() if robot.parallel_gripper}
    assert "panda" in known
    for name, robot in known.items():
        chain = pin.buildModelFromUrdf(str(locate(name)))
        data, side = chain.createData(), re.split("hand|base", robot.hand)[0]
        pin.framesForwardKinematics(chain, data, pin.neutral(chain))
        hand = data.oMf[chain.getFrameId(robot.hand)]
        fingers = {
            tuple(hand.actInv(data.oMf[k]).translation.round(6) + 0.0)
            for k, frame in enumerate(chain.frames)
            if frame.name.startswith(side) and "finger" in frame.name
        }
        assert fingers
        assert {(0.0 - x, 0.0 - y, z) for x, y, z in fingers} == fingers
        assert go.retargeting.align(go.load_model(name)).parallel_gripper
