"""Configurations with a hand pose, or with the nearest one if it is out of reach."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.inverse_kinematics import nearest_configuration
from geodesic_ocp.ocp.pose_search import PoseSearch

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
TARGET = (0.1, 0.45, 0.1)  # [m]


def planar() -> go.Model:
    """Two links of one metre in the plane, with joint limits."""
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
    """With elbow flexion of at least half a radian, the hand reaches 2 cos(1/4) m."""
    arm = planar()
    search = PoseSearch.checked("test", arm, (0.1, 1.0), (0.0, 3.0, 0.0), None)
    q = nearest_configuration(search, (1.0, 1.0))
    reached = arm.hand_pose(q)[1]
    assert_allclose(reached, [0.0, 2.0 * np.cos(0.25), 0.0], atol=1e-4)
    assert q[1] == pytest.approx(0.5, abs=1e-6)


def test_weights_choose_between_position_and_rotation() -> None:
    arm = planar()
    rotation = np.diag([-1.0, -1.0, 1.0])
    position = (2.0 * np.cos(0.25), 0.0, 0.0)
    search = PoseSearch.checked("test", arm, (0.1, 1.0), position, rotation)
    of_position, of_rotation = (
        nearest_configuration(search, weights) for weights in ((1e3, 1e-3), (1e-3, 1e3))
    )
    assert_allclose(arm.hand_pose(of_position)[1], position, atol=1e-3)
    assert_allclose(arm.hand_pose(of_rotation)[0], rotation, atol=1e-3)


def test_configurations_have_the_pose_and_are_within_limits(
    arm: go.Model, rng: np.random.Generator
) -> None:
    for _ in range(5):
        target = rng.uniform(arm.lower, arm.upper)
        rotation, position = arm.hand_pose(target)
        q = go.ocp.inverse_kinematics(arm, START, position, rotation)
        assert_allclose(arm.hand_pose(q)[0], rotation, rtol=0, atol=1e-6)
        assert_allclose(arm.hand_pose(q)[1], position, rtol=0, atol=1e-6)
        assert np.all(q >= arm.lower)
        assert np.all(q <= arm.upper)
    with pytest.raises(ValueError, match="inverse_kinematics needs a position, a rotation or both"):
        go.ocp.inverse_kinematics(arm, START)


@pytest.mark.slow
def test_configurations_are_clear_of_obstacles(arm: go.Model) -> None:
    there = go.ocp.inverse_kinematics(arm, START, TARGET)
    assert_allclose(arm.hand_pose(there)[1], TARGET, rtol=0, atol=1e-6)
    elbow = arm.frame_pose("right forearm", there)[1]
    ball = go.Ball(tuple(elbow), 0.05)
    clear = go.ocp.inverse_kinematics(arm, START, TARGET, obstacles=[ball], margin=0.01)
    assert_allclose(arm.hand_pose(clear)[1], TARGET, rtol=0, atol=1e-6)
    assert min(go.distances.signed_distances(arm, clear, [ball]).values()) > 0.01 - 1e-7


def test_pose_out_of_reach_is_reported_before_the_solve() -> None:
    arm = planar()
    with pytest.raises(
        go.NotConverged, match=r"no configuration of .* the smallest error reached is"
    ) as info:
        go.solve(go.Reach(arm, (0.1, 1.0), position=[0.0, 4.0, 0.0]))
    error = float(str(info.value).split("reached is ")[1].split()[0])
    assert error == pytest.approx(4.0 - arm.reach, abs=5e-3)  # three digits
