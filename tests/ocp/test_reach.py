"""Reaches to poses of the hand; joint limits and speed limits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from known_metrics import Sphere
from numpy.testing import assert_allclose
from scipy.linalg import null_space

import geodesic_ocp as go

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
GOAL = np.array([1.1, -0.2, -0.9, 1.4, -0.3, 0.1, 0.4])


@pytest.mark.parametrize(
    "given",
    [
        ("position", "rotation"),
        *(pytest.param((one,), marks=pytest.mark.slow) for one in ("position", "rotation")),
    ],
)
def test_pose_is_reached_by_a_path_of_least_energy(arm: go.Model, given: tuple[str, ...]) -> None:
    """The final momentum is orthogonal to the configurations with that pose (transversality)."""
    pose = dict(zip(("rotation", "position"), arm.hand_pose(GOAL), strict=True))
    problem = go.Reach(arm, START, **{name: pose[name] for name in given}, limits=False)
    solution = go.solve(problem, tolerance=1e-9)
    end, velocity = solution.path(1.0), solution.path(1.0, 1)
    rotation, position = arm.hand_pose(end)
    jacobian = arm.hand_jacobian(end)
    rows = []
    if "position" in given:
        assert_allclose(position, pose["position"], rtol=0, atol=1e-8)
        rows.append(jacobian[:3])
    if "rotation" in given:
        assert_allclose(rotation, pose["rotation"], rtol=0, atol=1e-7)
        rows.append(jacobian[3:])
    free = null_space(np.vstack(rows))
    assert free.shape[1] == 7 - 3 * len(given)
    metric = problem.metric
    momentum = metric.matrix(end) @ velocity
    assert np.abs(free.T @ momentum).max() < 1e-4 * np.linalg.norm(momentum)
    # No longer than the geodesic to the configuration from which the pose was taken.
    assert solution.path.length <= go.distance(metric, START, GOAL) + 1e-6
    assert solution.certificate.locally_shortest


@pytest.mark.slow
def test_joint_limits_hold_if_requested(arm: go.Model) -> None:
    target = arm.hand_pose([1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0])[1]
    raised = [-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0]
    within = go.solve(go.Reach(arm, raised, position=target), tolerance=1e-5)
    # From the solution within limits, as there are other local solutions.
    free = go.solve(go.Reach(arm, raised, position=target, limits=False), guess=within)
    s = np.linspace(0.0, 1.0, 501)
    assert np.any(free.path(s) > arm.upper + 0.1) or np.any(free.path(s) < arm.lower - 0.1)
    assert np.all(within.path(s) > arm.lower - 2e-5)
    assert np.all(within.path(s) < arm.upper + 2e-5)
    assert within.path.length > free.path.length


@pytest.mark.slow
def test_speed_limits_hold(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    free = go.geodesic(metric, START, GOAL)
    fastest = np.abs(free(np.linspace(0.0, 1.0, 201), 1)).max(axis=0)
    bound = np.maximum(0.8 * fastest, 1.02 * np.abs(GOAL - START))
    problem = go.PointToPoint(metric, START, GOAL, speed=tuple(bound))
    solution = go.solve(problem, tolerance=1e-3)
    speeds = np.abs(solution.path(np.linspace(0.0, 1.0, 501), 1))
    assert np.all(speeds <= bound + 1e-3)
    assert solution.path.energy > free.energy
    with pytest.raises(ValueError, match="speed must be positive"):
        go.PointToPoint(metric, START, GOAL, speed=0.0)
    with pytest.raises(ValueError, match=r"speed must have shape \(7,\)"):
        go.PointToPoint(metric, START, GOAL, speed=(1.0, 2.0))


def test_joint_limits_of_a_point_to_point_problem(arm: go.Model) -> None:
    ends = [-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0], [1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0]
    metric = go.KineticEnergy(arm)
    limited = go.PointToPoint(metric, *ends, limits=True)
    solution = go.solve(limited)
    assert np.all(solution.path.nodes >= arm.lower)
    assert np.all(solution.path.nodes <= arm.upper)
    assert solution.path.length > go.distance(metric, *ends)
    outside = list(ends[1])
    outside[5] = 1.0
    with pytest.raises(ValueError, match=r"joint RWx_joint is fixed at 1 .* outside its bounds"):
        go.solve(go.PointToPoint(metric, ends[0], outside, limits=True))
    with pytest.raises(ValueError, match="limits: Sphere has no model with limits"):
        go.PointToPoint(Sphere(), (1.0, 0.0), (1.2, 0.3), limits=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "Reach needs a position, a rotation or both"),
        ({"position": [0.1, 0.2]}, r"position must have shape \(3,\)"),
        ({"rotation": 2.0 * np.eye(3)}, "rotation must be a rotation"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation must be a rotation"),
        ({"position": [0.1, 0.2, 0.3], "start": [0.0]}, r"start must have shape \(7,\)"),
    ],
)
def test_wrong_arguments_are_named(arm: go.Model, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.Reach(arm, **({"start": START} | arguments))


def test_reach_without_position_can_be_replaced() -> None:
    """Without a position there are no free directions, also after `replace`."""
    arm = go.human_arm()
    reach = go.Reach(arm, np.zeros(7), rotation=np.eye(3), limits=False)
    assert dataclasses.replace(reach, limits=True).limits
    with pytest.raises(ValueError, match="free: directions"):
        go.Reach(arm, np.zeros(7), rotation=np.eye(3), free=(1.0, 0.0, 0.0))


def test_a_hand_position_out_of_reach_gives_the_last_iterate(arm: go.Model) -> None:
    solution = go.solve(go.Reach(arm, np.zeros(7), (5.0, 0.0, 0.0)), throw=False)
    assert not solution.stats.success
    assert "no configuration" in solution.stats.status


def test_malformed_guess_and_options(arm: go.Model) -> None:
    reach = go.Reach(arm, np.zeros(7), (0.2, 0.3, -0.2))
    path = go.Path.through(go.Euclidean(2), [[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(ValueError, match="guess has 2 coordinates, the problem 7"):
        go.solve(reach, guess=path)
    with pytest.raises(ValueError, match="ipopt must be options"):
        go.solve(reach, ipopt=3)  # type: ignore[arg-type]
