"""Paths to poses are those that `solve` finds, without building anything anew."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.nlp.definition import shared_shape
from geodesic_ocp.retargeting.least_energy import FoundPath, least_energy_path
from geodesic_ocp.retargeting.targets import Pose

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
TOLERANCE = 1e-4
S = np.linspace(0.0, 1.0, 1001)


def reach(arm: go.Model, end: np.ndarray, speed: np.ndarray | None = None) -> FoundPath:
    rotation, position = arm.hand_pose(end)
    return least_energy_path(
        *(arm, START, Pose(rotation, position), end),
        limits=True,
        speed=speed,
        tolerance=TOLERANCE,
    )


@pytest.mark.parametrize("is_limited", [False, True])
def test_energy_is_that_of_a_refined_solution(arm: go.Model, is_limited: bool) -> None:
    """Without and with an active joint limit, also between the nodes."""
    end = START + np.array([0.5, 0.4, -0.5, 0.6, 0.5, -0.2, -0.4])
    if is_limited:
        free = reach(arm, end).path(S)
        highest = free.max(axis=0)
        k = int(np.argmax(highest - np.maximum(START, free[-1])))
        arm = arm.with_limits(upper={arm.joint_names[k]: 0.3 * START[k] + 0.7 * highest[k]})
        assert highest[k] > arm.upper[k] + 1e-3
    found = reach(arm, end)
    assert found.success
    rotation, position = arm.hand_pose(end)
    assert_allclose(arm.hand_pose(found.path.nodes[-1])[0], rotation, atol=1e-7)
    assert_allclose(arm.hand_pose(found.path.nodes[-1])[1], position, atol=1e-7)
    q = found.path(S)
    assert np.max([arm.lower - q, q - arm.upper]) <= TOLERANCE
    problem = go.Reach(arm, START, position, rotation)
    solution = go.solve(problem, guess=found.path, tolerance=TOLERANCE)
    assert found.energy == pytest.approx(solution.stats.objective, rel=2.0 * TOLERANCE)


def test_speed_limits_hold_between_the_nodes(arm: go.Model) -> None:
    end = START + np.array([0.5, 0.4, -0.5, 0.6, 0.5, -0.2, -0.4])
    unlimited = reach(arm, end)
    speed = np.full(7, 1.05 * np.abs(end - START).max())
    assert np.abs(unlimited.path(S, 1)).max() > speed[0]
    found = reach(arm, end, speed)
    assert found.success
    assert np.abs(found.path(S, 1)).max() <= speed[0] + TOLERANCE
    assert found.energy > unlimited.energy


def test_same_functions_serve_all_poses_and_widths(arm: go.Model) -> None:
    end = START + np.array([0.5, 0.4, -0.5, 0.6, 0.5, -0.2, -0.4])
    speed = np.full(7, 1.05 * np.abs(end - START).max())
    reach(arm, end, speed)
    before = shared_shape.cache_info().misses
    reach(arm, end, 1.01 * speed)
    assert shared_shape.cache_info().misses == before
