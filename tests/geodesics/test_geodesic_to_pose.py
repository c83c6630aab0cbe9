"""Geodesics to a pose of the hand, by shooting: against exp, Reach, and the paper's gradient."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.ik.inverse_kinematics import Clear
from geodesic_ocp.ocp.ik.nearest import nearest_configuration

START = np.array([0.4, 0.1, -0.6, 1.2, 0.2, 0.0, 0.1])
VELOCITY = np.array([0.5, -0.2, -0.3, 0.4, 0.3, -0.2, 0.2])


@pytest.fixture(scope="module")
def arm() -> go.Model:
    return go.human_arm()


@pytest.fixture(scope="module")
def pose(arm: go.Model) -> tuple[np.ndarray, np.ndarray]:
    """That of a geodesic's end: there is one to it."""
    rotation, position = arm.hand_pose(go.exp(go.KineticEnergy(arm), START, VELOCITY))
    return position, rotation


def test_it_ends_at_the_pose_and_is_a_geodesic(arm: go.Model, pose: tuple[Any, Any]) -> None:
    metric = go.KineticEnergy(arm)
    found = go.geodesic_to_pose(arm, START, *pose)
    assert found.success
    assert found.position_error < 1e-6
    assert found.rotation_error < 1e-6
    assert_allclose(go.exp(metric, START, found.velocity), found.configuration, atol=1e-8)
    # Of the many geodesics of a redundant arm it is none that costs more than the known one.
    assert found.energy < metric.inner(START, VELOCITY, VELOCITY) / 2.0 + 1e-9
    assert found.path is not None
    assert found.path.energy == pytest.approx(found.energy, rel=1e-7)


def test_its_energy_is_that_of_the_collocated_reach(arm: go.Model, pose: tuple[Any, Any]) -> None:
    """Two ways to the same: shooting with a small weight, and the NLP over the path's nodes."""
    shot = go.geodesic_to_pose(arm, START, *pose)
    reach = go.solve(go.Reach(arm, START, *pose, limits=False))
    assert shot.energy == pytest.approx(reach.stats.energy, rel=1e-5)
    assert_allclose(shot.configuration, reach.path.nodes[-1], atol=1e-4)


def test_the_gradient_of_the_paper_comes_there_in_more_steps(
    arm: go.Model, pose: tuple[Any, Any]
) -> None:
    newton = go.geodesic_to_pose(arm, START, *pose)
    gradient = go.geodesic_to_pose(arm, START, *pose, method="transport")
    assert gradient.success
    assert gradient.position_error < 1e-6
    assert gradient.energy >= newton.energy - 1e-9
    assert gradient.iterations > newton.iterations


@pytest.mark.slow
def test_position_alone_costs_less(arm: go.Model, pose: tuple[Any, Any]) -> None:
    position, _ = pose
    whole = go.geodesic_to_pose(arm, START, *pose)
    free = go.geodesic_to_pose(arm, START, position)
    turned = go.geodesic_to_pose(arm, START, rotation=pose[1])
    assert free.position_error < 1e-6
    assert free.rotation_error == 0.0
    assert turned.rotation_error < 1e-6
    assert max(free.energy, turned.energy) < whole.energy
    reach = go.solve(go.Reach(arm, START, position, limits=False))
    assert free.energy == pytest.approx(reach.stats.energy, rel=1e-5)


def test_from_inverse_kinematics(arm: go.Model, pose: tuple[Any, Any]) -> None:
    towards = go.inverse_kinematics(arm, START, *pose)
    found = go.geodesic_to_pose(arm, START, *pose, towards=towards)
    assert found.energy == pytest.approx(go.geodesic_to_pose(arm, START, *pose).energy, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("away", [0.7, 1.0])
def test_out_of_reach_it_comes_as_near_as_it_can(arm: go.Model, away: float) -> None:
    """The hand of the stretched arm, without limits, is as far out as the arm is long."""
    direction = np.array([0.3, 0.8, -0.4]) / np.linalg.norm([0.3, 0.8, -0.4])
    found = go.geodesic_to_pose(arm, START, away * direction, energy_weight=1e-4)
    free = arm.with_limits(np.full(7, -4.0), np.full(7, 4.0))
    assert found.success
    assert found.position_error == pytest.approx(away - free.reach, abs=1e-5)


def test_the_hand_is_there_already(arm: go.Model) -> None:
    rotation, position = arm.hand_pose(START)
    found = go.geodesic_to_pose(arm, START, position, rotation)
    assert found.energy < 1e-12
    assert_allclose(found.configuration, START, atol=1e-6)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({}, "needs a position, a rotation or both"),
        ({"position": (1, 2)}, "position"),
        ({"position": np.ones(3), "method": "magic"}, "method must be one of newton, transport"),
        ({"position": np.ones(3), "weights": (0.0, 1.0)}, r"weights\[0\] must be positive"),
        ({"position": np.ones(3), "energy_weight": -1.0}, "energy_weight must be positive"),
        (
            {"position": np.ones(3), "velocity": np.ones(7), "towards": np.ones(7)},
            "velocity or towards",
        ),
    ],
)
def test_wrong_arguments_are_named(arm: go.Model, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.geodesic_to_pose(arm, START, **keywords)


@pytest.mark.slow
def test_not_converged_says_how_far(arm: go.Model) -> None:
    """The gradient gets stuck where the miss is at a right angle to all that the hand can do."""
    rotation, position = arm.hand_pose(START)
    turned = rotation @ np.diag([1.0, -1.0, -1.0])
    record = go.geodesic_to_pose(
        arm, START, position, turned, method="transport", weights=(1.0, 10.0), throw=False
    )
    assert not record.success
    with pytest.raises(go.NotConverged, match="the pose error of the hand is") as raised:
        go.geodesic_to_pose(arm, START, position, turned, method="transport", weights=(1.0, 10.0))
    assert isinstance(raised.value.solution, go.ToPose)


def test_shoot_draws_exp(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    path = go.geodesic_from_velocity(metric, START, VELOCITY)
    assert_allclose(path(1.0), go.exp(metric, START, VELOCITY), atol=1e-9)
    assert_allclose(path(0.0, 1), VELOCITY, atol=1e-5)
    with pytest.raises(ValueError, match="v0 must not be zero"):
        go.geodesic_from_velocity(metric, START, np.zeros(7))


def planar() -> go.Model:
    """Two links of one metre, in the plane, with limits of the elbow."""
    chain = pin.Model()
    at = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3))
    one = chain.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "one")
    two = chain.addJoint(one, pin.JointModelRZ(), at, "two")
    chain.appendBodyToJoint(one, inertia, pin.SE3.Identity())
    chain.appendBodyToJoint(two, inertia, pin.SE3.Identity())
    chain.addFrame(pin.Frame("hand", two, at, pin.FrameType.OP_FRAME))
    chain.lowerPositionLimit, chain.upperPositionLimit = np.array([[-2.0, 0.5], [2.0, 2.5]])
    return go.Model(chain, "hand")


def test_the_nearest_posture_is_on_the_border_of_reach() -> None:
    """With the elbow bent by half a radian at least, the hand comes to 2 cos(1/4) m."""
    arm = planar()
    q = nearest_configuration(arm, (0.1, 1.0), (0.0, 3.0, 0.0), None, (1.0, 1.0), True, Clear())
    reached = arm.hand_pose(q)[1]
    assert_allclose(reached, [0.0, 2.0 * np.cos(0.25), 0.0], atol=1e-4)
    assert q[1] == pytest.approx(0.5, abs=1e-6)


def test_weights_choose_between_place_and_direction() -> None:
    arm = planar()
    turn = np.diag([-1.0, -1.0, 1.0])
    place = (2.0 * np.cos(0.25), 0.0, 0.0)
    of_place, of_turn = (
        nearest_configuration(arm, (0.1, 1.0), place, turn, weights, True, Clear())
        for weights in ((1e3, 1e-3), (1e-3, 1e3))
    )
    assert_allclose(arm.hand_pose(of_place)[1], place, atol=1e-3)
    assert_allclose(arm.hand_pose(of_turn)[0], turn, atol=1e-3)
