"""Geodesics to a pose of the hand, by shooting: against exp, Reach, and the paper's gradient."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose

START = np.array([0.4, 0.1, -0.6, 1.2, 0.2, 0.0, 0.1])
VELOCITY = np.array([0.5, -0.2, -0.3, 0.4, 0.3, -0.2, 0.2])


@pytest.fixture(scope="module")
def pose(arm_metric: go.KineticEnergy) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation of the hand at the end of a geodesic: it can be reached by one."""
    rotation, position = arm_metric.model.hand_pose(go.exp(arm_metric, START, VELOCITY))
    return position, rotation


@pytest.fixture(scope="module")
def result(arm: go.Model, pose: tuple[Any, Any]) -> ToPose:
    return go.logarithm.geodesic_to_pose(arm, START, *pose)


@pytest.mark.slow
def test_the_result_is_a_geodesic_to_the_pose(arm_metric: go.KineticEnergy, result: ToPose) -> None:
    assert result.success
    assert result.position_error < 1e-6
    assert result.rotation_error < 1e-6
    assert_allclose(go.exp(arm_metric, START, result.velocity), result.configuration, atol=1e-8)
    # Among the many geodesics of a redundant arm, it costs no more than the known one.
    assert result.energy < arm_metric.inner(START, VELOCITY, VELOCITY) / 2.0 + 1e-9
    assert result.path is not None
    assert result.path.energy == pytest.approx(result.energy, rel=1e-7)
    assert "success=True" in repr(result)


@pytest.mark.slow
def test_energy_equals_that_of_reach(arm: go.Model, pose: tuple[Any, Any], result: ToPose) -> None:
    """Shooting with a small weight of the energy, and the NLP over the path's nodes."""
    reach = go.solve(go.Reach(arm, START, *pose, limits=False))
    assert result.energy == pytest.approx(reach.stats.energy, rel=1e-5)
    assert_allclose(result.configuration, reach.path.nodes[-1], atol=1e-4)


@pytest.mark.slow
def test_the_gradient_of_the_paper_needs_more_steps(
    arm: go.Model, pose: tuple[Any, Any], result: ToPose
) -> None:
    gradient = go.logarithm.geodesic_to_pose(arm, START, *pose, method="transport")
    assert gradient.success
    assert gradient.position_error < 1e-6
    assert gradient.energy >= result.energy - 1e-9
    assert gradient.iterations > result.iterations


@pytest.mark.slow
def test_position_alone_costs_less(arm: go.Model, pose: tuple[Any, Any], result: ToPose) -> None:
    position, rotation = pose
    free = go.logarithm.geodesic_to_pose(arm, START, position)
    turned = go.logarithm.geodesic_to_pose(arm, START, rotation=rotation)
    assert free.position_error < 1e-6
    assert free.rotation_error == 0.0
    assert turned.rotation_error < 1e-6
    assert max(free.energy, turned.energy) < result.energy
    reach = go.solve(go.Reach(arm, START, position, limits=False))
    assert free.energy == pytest.approx(reach.stats.energy, rel=1e-5)


@pytest.mark.slow
def test_initial_guess_from_inverse_kinematics(
    arm: go.Model, pose: tuple[Any, Any], result: ToPose
) -> None:
    end = go.ocp.inverse_kinematics(arm, START, *pose)
    velocity = go.log(go.KineticEnergy(arm), START, end)
    found = go.logarithm.geodesic_to_pose(arm, START, *pose, velocity=velocity)
    assert found.energy == pytest.approx(result.energy, rel=1e-6)


@pytest.mark.slow
def test_out_of_reach_the_error_is_minimal(arm: go.Model) -> None:
    """The hand of the stretched arm, without limits, is as far out as the arm is long."""
    away, direction = 0.7, np.array([0.3, 0.8, -0.4]) / np.linalg.norm([0.3, 0.8, -0.4])
    found = go.logarithm.geodesic_to_pose(arm, START, away * direction, energy_weight=1e-4)
    free = arm.with_limits(np.full(7, -4.0), np.full(7, 4.0))
    assert found.success
    assert found.position_error == pytest.approx(away - free.reach, abs=1e-5)


def test_the_hand_is_at_the_pose_already(arm: go.Model) -> None:
    rotation, position = arm.hand_pose(START)
    found = go.logarithm.geodesic_to_pose(arm, START, position, rotation)
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
    ],
)
def test_wrong_arguments_are_named(arm: go.Model, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.logarithm.geodesic_to_pose(arm, START, **keywords)


@pytest.mark.slow
def test_not_converged_reports_the_pose_error(arm: go.Model) -> None:
    """The gradient vanishes where the pose error is orthogonal to the image of the Jacobian."""
    rotation, position = arm.hand_pose(START)
    turned = rotation @ np.diag([1.0, -1.0, -1.0])
    record = go.logarithm.geodesic_to_pose(
        arm, START, position, turned, method="transport", weights=(1.0, 10.0), throw=False
    )
    assert not record.success
    with pytest.raises(go.NotConverged, match="the pose error of the hand is") as raised:
        go.logarithm.geodesic_to_pose(
            arm, START, position, turned, method="transport", weights=(1.0, 10.0)
        )
    assert isinstance(raised.value.solution, ToPose)
