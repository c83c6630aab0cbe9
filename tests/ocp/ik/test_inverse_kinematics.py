"""The configuration whose hand pose is nearest to one out of reach."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.ik.collision_avoidance import CollisionAvoidance
from geodesic_ocp.ocp.ik.inverse_kinematics import nearest_configuration


def planar() -> go.Model:
    """Two links of one metre in the plane, with limits of the elbow."""
    chain = pin.Model()
    offset = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3))
    one = chain.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "one")
    two = chain.addJoint(one, pin.JointModelRZ(), offset, "two")
    chain.appendBodyToJoint(one, inertia, pin.SE3.Identity())
    chain.appendBodyToJoint(two, inertia, pin.SE3.Identity())
    chain.addFrame(pin.Frame("hand", two, offset, pin.FrameType.OP_FRAME))
    chain.lowerPositionLimit, chain.upperPositionLimit = np.array([[-2.0, 0.5], [2.0, 2.5]])
    return go.Model(chain, "hand")


def test_nearest_configuration_lies_on_the_boundary_of_the_workspace() -> None:
    """With the elbow bent by at least half a radian, the hand reaches 2 cos(1/4) m."""
    arm = planar()
    q = nearest_configuration(
        arm, (0.1, 1.0), (0.0, 3.0, 0.0), None, (1.0, 1.0), True, CollisionAvoidance()
    )
    reached = arm.hand_pose(q)[1]
    assert_allclose(reached, [0.0, 2.0 * np.cos(0.25), 0.0], atol=1e-4)
    assert q[1] == pytest.approx(0.5, abs=1e-6)


def test_weights_choose_between_position_and_rotation() -> None:
    arm = planar()
    rotation = np.diag([-1.0, -1.0, 1.0])
    position = (2.0 * np.cos(0.25), 0.0, 0.0)
    of_position, of_rotation = (
        nearest_configuration(
            arm, (0.1, 1.0), position, rotation, weights, True, CollisionAvoidance()
        )
        for weights in ((1e3, 1e-3), (1e-3, 1e3))
    )
    assert_allclose(arm.hand_pose(of_position)[1], position, atol=1e-3)
    assert_allclose(arm.hand_pose(of_rotation)[0], rotation, atol=1e-3)
