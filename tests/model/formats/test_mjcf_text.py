"""Models as MJCF: MuJoCo gives the same dynamics and kinematics as Pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF, urdf
from installed_robots import known_robot
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats.mjcf_text import mjcf_text
from geodesic_ocp.model.formats.robots import ROBOTS

mujoco = pytest.importorskip("mujoco")


def both_arms() -> go.Model:
    arms = go.human_arm("left"), go.human_arm("right").with_payload(2.0, [0.0, 0.0, 0.1])
    return go.model.combine(*arms, placements=[(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)])


MODELS: dict[str, Callable[[], go.Model]] = {
    **{name: lambda name=name: known_robot(name).with_bodies() for name in (*ROBOTS, "tiago")},
    "both arms, one with a load": both_arms,
    "URDF": lambda: go.load_model(urdf(), hand="grip"),
    "MJCF": lambda: go.load_model(MJCF, hand="tip", base="trunk"),
    "with armature": lambda: go.human_arm("right", armature=0.3),
}


@pytest.mark.parametrize("name", MODELS)
def test_mujoco_agrees_with_pinocchio(name: str, rng: np.random.Generator) -> None:
    """Inverse dynamics with gravity in any direction, the mass matrix in it, and the hand's pose.

    With a massless link, MuJoCo's has 1e-12 kg: 1e-9 is far above what it adds.
    """
    model = MODELS[name]()
    gravity = rng.normal(size=3) * 6.0
    native = mujoco.MjModel.from_xml_string(mjcf_text(model))
    assert_allclose(native.opt.gravity, model.pin.gravity.linear, rtol=0, atol=0)
    native.opt.gravity[:] = gravity
    native.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    state = mujoco.MjData(native)
    rows = [native.joint(joint).dofadr[0] for joint in model.joint_names]
    reference = model.pin.copy()
    reference.gravity = pin.Motion(gravity, np.zeros(3))
    data = reference.createData()
    for q, v, a in rng.uniform(-1.0, 1.0, (4, 3, model.dof)):
        state.qpos[rows], state.qvel[rows], state.qacc[rows] = q, v, a
        mujoco.mj_inverse(native, state)
        expected = pin.rnea(reference, data, q, v, a)
        scale = max(1.0, np.abs(expected).max())
        assert_allclose(state.qfrc_inverse[rows], expected, rtol=0, atol=1e-9 * scale)
        weight = pin.rnea(reference, data, q, 0.0 * v, 0.0 * a)
        ours = model.mass_matrix(q) @ a + model.coriolis_force(q, v) + weight
        assert_allclose(state.qfrc_inverse[rows], ours, rtol=0, atol=1e-9 * scale)
        rotation, position = model.hand_pose(q)
        site = state.site(model.hand)
        assert_allclose(site.xpos, position, rtol=0, atol=1e-9)
        assert_allclose(site.xmat.reshape(3, 3), rotation, rtol=0, atol=1e-9)


def test_limits_and_motors_are_those_of_the_model() -> None:
    model = go.load_model(urdf(), hand="grip")
    native = mujoco.MjModel.from_xml_string(mjcf_text(model))
    for joint, lower, upper in zip(model.joint_names, model.lower, model.upper, strict=True):
        assert native.actuator(joint).ctrlrange.tolist() == [-1.0, 1.0]  # the effort in the file
        limited = joint not in model.continuous
        assert bool(native.joint(joint).limited[0]) is limited
        if limited:
            assert_allclose(native.joint(joint).range, [lower, upper], rtol=0, atol=1e-15)
    unlimited = mujoco.MjModel.from_xml_string(mjcf_text(go.human_arm()))
    assert not unlimited.actuator_ctrllimited.any()


def test_it_is_read_again_as_the_same_model(rng: np.random.Generator) -> None:
    model = go.load_model(urdf(), hand="grip").with_armature(0.2)
    again = go.load_model(mjcf_text(model), hand="grip")
    assert again.joint_names == model.joint_names
    assert_allclose(again.armature, model.armature, rtol=0, atol=0)
    assert_allclose(again.lower, model.lower, rtol=0, atol=1e-12)
    assert_allclose(again.pin.upperEffortLimit, model.pin.upperEffortLimit, rtol=0, atol=0)
    q = rng.uniform(0.2, 1.0, 4)
    assert_allclose(again.mass_matrix(q), model.mass_matrix(q), rtol=0, atol=1e-10)


def test_bodies_become_geoms_of_their_links() -> None:
    arm = go.human_arm("right").with_bodies(
        go.Capsule((0, 0, 0), (0, 0, -0.2), 0.04, "right forearm"),
        go.Ball((0.0, 0.0, -0.1), 0.05, "right hand"),
    )
    native = mujoco.MjModel.from_xml_string(mjcf_text(arm))
    assert [native.geom(k).name for k in range(2)] == ["right forearm:1", "right hand:1"]
    kinds = mujoco.mjtGeom
    assert native.geom_type.tolist() == [kinds.mjGEOM_CAPSULE, kinds.mjGEOM_SPHERE]
    assert native.geom_size[:, 0].tolist() == [0.04, 0.05]


def test_what_mjcf_does_not_have_is_named() -> None:
    native = pin.Model()
    joint = native.addJoint(0, pin.JointModelHZ(0.1), pin.SE3.Identity(), "screw")
    native.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    native.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.BODY))
    with pytest.raises(ValueError, match="joint 'screw' is a screw"):
        mjcf_text(go.Model(native, "tip"))
