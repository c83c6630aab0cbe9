"""Model: its properties, variants and errors."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go


def test_model_keeps_a_copy(arm: go.Model) -> None:
    native = arm.pin.copy()
    model = go.Model(native, "hand")
    before = model.mass_matrix(np.zeros(7))
    native.inertias[7] = pin.Inertia.Random()
    assert np.array_equal(model.mass_matrix(np.zeros(7)), before)
    assert np.array_equal(go.Model(model.pin, "hand").mass_matrix(np.zeros(7)), before)


def test_models_are_shown_in_a_line_or_as_a_table(arm: go.Model) -> None:
    shown = f"Model('human right arm', dof=7, hand='hand', backend={arm.backend!r})"
    assert repr(arm) == shown
    assert repr(go.KineticEnergy(arm)) == f"KineticEnergy(model={shown})"
    assert re.search(r"\| RSx_joint +\| +rad +\| +-1.22 +\| +3.32 +\|", arm._repr_markdown_())


def test_unknown_hand_lists_the_frames(arm: go.Model) -> None:
    with pytest.raises(ValueError, match=r"no frame 'foot'.*hand"):
        go.Model(arm.pin, "foot")


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(6), r"q must have shape \(7,\), got \(6,\)"),
        ([0, 0, 0, 0, 0, 0, np.nan], "q must be finite"),
        ("configuration", "q must be 7 real numbers"),
    ],
)
def test_wrong_configurations_are_named(arm: go.Model, q: object, message: str) -> None:
    for function in (arm.mass_matrix, arm.hand_pose, arm.hand_jacobian):
        with pytest.raises(ValueError, match=message):
            function(q)


def test_hand_pose_of_many(arm: go.Model, rng: np.random.Generator) -> None:
    many = rng.uniform(-1.0, 1.0, (5, 7))
    rotations, positions = arm.hand_pose(many)
    for q, rotation, position in zip(many, rotations, positions, strict=True):
        assert np.array_equal(arm.hand_pose(q)[0], rotation)
        assert np.array_equal(arm.hand_pose(q)[1], position)
    with pytest.raises(ValueError, match=r"shape \(k, 7\)"):
        arm.hand_pose(many[:, :3])


def wheel_and_lever() -> pin.Model:
    """Continuous joints about a slanted and a straight axis and one with limits."""
    links = ["base", "rim", "hub", "end"]
    joints = [("wheel", "continuous", "0.6 0 0.8"), ("spin", "continuous", "0 1 0")]
    joints.append(("lever", "revolute", "1 0 0"))
    inertial = (
        '<inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/>'
        '<inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.15"/></inertial>'
    )
    text = "".join(f'<link name="{link}">{inertial}</link>' for link in links)
    for (name, kind, axis), parent, child in zip(joints, links, links[1:], strict=False):
        text += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><axis xyz="{axis}"/>'
            '<limit lower="-1" upper="2" effort="1" velocity="1"/></joint>'
        )
    native = pin.buildModelFromXML(f'<robot name="wheel">{text}</robot>')
    native.armature = np.array([0.1, 0.2, 0.3])
    native.gravity = pin.Motion(np.array([1.0, 2.0, 3.0]), np.zeros(3))
    return native


def test_continuous_joints_become_angles_within_two_revolutions(rng: np.random.Generator) -> None:
    native = wheel_and_lever()
    model = go.Model(native, "end")
    assert (native.nq, native.nv, model.pin.nq, model.pin.nv) == (5, 3, 3, 3)
    assert model.joint_names == ("wheel", "spin", "lever")
    assert model.continuous == ("wheel", "spin")
    assert model.lower.tolist() == [-2 * np.pi, -2 * np.pi, -1.0]
    assert model.upper.tolist() == [2 * np.pi, 2 * np.pi, 2.0]
    q = rng.uniform(-3.0, 3.0, 3)
    full = np.array([np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1]), q[2]])
    data, frame = native.createData(), native.getFrameId("end")
    pin.framesForwardKinematics(native, data, full)
    pin.computePotentialEnergy(native, data, full)
    upper = np.triu(pin.crba(native, data, full))
    expected = upper + np.triu(upper, 1).T
    assert_allclose(model.mass_matrix(q), expected, rtol=0, atol=1e-12)
    assert_allclose(model.hand_pose(q)[1], data.oMf[frame].translation, rtol=0, atol=1e-13)
    assert model.potential_energy(q) == pytest.approx(data.potential_energy, rel=1e-12)
    again = model.with_payload(1.0)
    assert again.continuous == model.continuous


def test_limits_can_be_changed(arm: go.Model) -> None:
    wider = arm.with_limits(upper={"RWx_joint": 1.0})
    assert wider.upper[5] == 1.0
    assert np.array_equal(np.delete(wider.upper, 5), np.delete(arm.upper, 5))
    assert np.array_equal(wider.lower, arm.lower)
    both = arm.with_limits(np.full(7, -1.0), np.full(7, np.inf))
    assert both.lower.tolist() == [-1.0] * 7
    assert both.upper.tolist() == [np.inf] * 7
    with pytest.raises(ValueError, match="'Rx' is not one of the joints RSx_joint"):
        arm.with_limits({"Rx": 0.0})
    with pytest.raises(ValueError, match="lower must be 7 numbers"):
        arm.with_limits([0.0])
    with pytest.raises(ValueError, match="RSy_joint: the lower limit 1 lies above the upper 0"):
        arm.with_limits({"RSy_joint": 1.0})


def test_mass_and_reach_of_the_arm(arm: go.Model) -> None:
    assert arm.mass == pytest.approx(70.0 * (0.027 + 0.016 + 0.006), rel=1e-12)
    # The stretched arm, with the tool centre beside the wrist axis.
    assert arm.reach == pytest.approx(1.75 * (0.188 + 0.145 + np.hypot(0.015, 0.037)), rel=2e-3)
    assert arm.reach <= 1.75 * (0.188 + 0.145 + np.hypot(0.015, 0.037))


def test_payload_adds_its_kinetic_energy(backend: str, rng: np.random.Generator) -> None:
    """G + m J'J at its centre of mass, plus its rotational inertia."""
    empty = go.human_arm("right", backend=backend)
    position, moments = np.array([0.02, -0.03, 0.1]), rng.normal(size=(3, 3))
    inertia = 0.01 * moments @ moments.T
    loaded = empty.with_payload(1.5, position, inertia)
    assert loaded.name == "human right arm with 1.5 kg"
    assert loaded.backend == backend
    for q in rng.uniform(-1.0, 1.0, (5, 7)):
        rotation, hand = empty.hand_pose(q)
        linear, angular = np.split(empty.hand_jacobian(q), 2)
        centre = linear - np.cross(rotation @ position, angular.T).T
        turning = rotation @ inertia @ rotation.T
        expected = empty.mass_matrix(q) + 1.5 * centre.T @ centre + angular.T @ turning @ angular
        assert loaded.mass_matrix(q) == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert np.array_equal(loaded.hand_pose(q)[1], hand)
    point = empty.with_payload(1.5)
    assert point.mass_matrix(q) == pytest.approx(empty.mass_matrix(q) + 1.5 * linear.T @ linear)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), r"mass must be positive \[kg\], got 0.0"),
        ((1.0, (0.0, 0.1)), r"position must have shape \(3,\)"),
        ((1.0, (0.0, 0.0, 0.0), np.eye(2)), "inertia must be 3 x 3"),
        ((1.0, (0.0, 0.0, 0.0), np.diag([1.0, 1.0, -1.0])), "negative principal moment"),
        ((1.0, (0.0, 0.0, 0.0), np.tri(3)), "inertia must be symmetric"),
    ],
)
def test_wrong_payloads_are_rejected(arguments: tuple, message: str, arm: go.Model) -> None:
    with pytest.raises(ValueError, match=message):
        arm.with_payload(*arguments)


def test_wrong_limits_and_hands_are_rejected(arm: go.Model) -> None:
    for limits in ((np.full(7, np.inf), np.full(7, np.inf)), (None, np.full(7, -np.inf))):
        with pytest.raises(ValueError, match="RSx_joint: the lower limit"):
            arm.with_limits(*limits)
    with pytest.raises(ValueError, match="upper must be 7 numbers"):
        arm.with_limits(upper={"RSx_joint": "x"})
    with pytest.raises(ValueError, match="no frame 3"):
        arm.with_hand(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="does not move: a payload has no effect"):
        arm.with_hand("universe").with_payload(1.0)
    with pytest.raises(ValueError, match="inertia must be 3 x 3 finite numbers, got 'a'"):
        arm.with_payload(1.0, inertia="a")
    with pytest.raises(ValueError, match="continuous: 'elbow' is not a joint"):
        go.Model(arm.pin, "hand", continuous=("elbow",))
    twice = go.Model(arm.pin, "hand", continuous=("RSx_joint", "RSx_joint"))
    assert twice.continuous == ("RSx_joint",)


def test_an_unlimited_prismatic_joint_has_infinite_reach() -> None:
    native = pin.Model()
    slide = native.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    native.addFrame(pin.Frame("end", slide, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    assert go.Model(native, "end").reach == np.inf
    assert go.Model(native, "end").with_limits([-1.0], [2.0]).reach == pytest.approx(2.0)


def test_a_metric_or_model_in_the_wrong_place_is_named(
    arm: go.Model, arm_metric: go.KineticEnergy
) -> None:
    q = np.zeros(7)
    with pytest.raises(ValueError, match=r"metric must be .*use go.KineticEnergy\(model\)"):
        go.distance(arm, q, q)  # type: ignore[arg-type]
    message = "model must be a Model, got .*; use its attribute model"
    for call in (
        lambda: go.Reach(arm_metric, q, [0.1, 0.4, 0.0]),  # type: ignore[arg-type]
        lambda: go.ocp.inverse_kinematics(arm_metric, q, [0.1, 0.4, 0.0]),  # type: ignore[arg-type]
        lambda: go.logarithm.geodesic_to_pose(arm_metric, q, [0.1, 0.4, 0.0]),  # type: ignore[arg-type]
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_a_frame_with_the_name_of_a_joint_remains_what_the_name_means() -> None:
    meshes = pytest.importorskip("geodesic_ocp.drawing.meshes").meshes
    body = pin.Inertia(1.0, np.array([0.2, 0.0, 0.0]), 0.1 * np.eye(3))
    chain = pin.Model()
    first = chain.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "tool")
    chain.appendBodyToJoint(first, body, pin.SE3.Identity())
    elbow = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0]))
    second = chain.addJoint(first, pin.JointModelRY(), elbow, "second")
    chain.appendBodyToJoint(second, body, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    chain.addFrame(pin.Frame("tool", second, tip, pin.FrameType.OP_FRAME))
    model = go.Model(chain, "tool")
    assert_allclose(model.hand_pose(np.zeros(2))[1], [0.7, 0.0, 0.0], atol=1e-15)
    for link in {mesh.link for mesh in meshes(model)}:
        assert [str(frame.name) for frame in model.pin.frames].count(link) == 1
