"""Splines with optimal times, and cubics to a pose of the hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_metrics import HalfPlane, Sphere

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics import default_joint_inertia

ARM = go.human_arm()
HUMAN = go.KineticEnergy(ARM.with_armature(default_joint_inertia(ARM)))
TIMES = np.array([0.0, 0.5, 0.9, 1.6])
POINTS = np.array([[0.8, 0.2], [1.1, 0.7], [0.9, 1.0], [1.4, 1.2]])


@pytest.mark.slow
@given(st.sampled_from([Sphere(), HalfPlane()]), st.floats(0.0, 10.0), st.integers(0, 1000))
@settings(max_examples=4)
def test_jumps_of_the_hamiltonian_are_derivatives(
    metric: go.Metric, tension: float, seed: int
) -> None:
    points = POINTS + np.random.default_rng(seed).uniform(-0.2, 0.2, POINTS.shape)

    def action(times: Array) -> float:
        return go.spline(metric, times, points, v0=[1.0, 0.0], tension=tension).action

    jumps = go.spline(metric, TIMES, points, v0=[1.0, 0.0], tension=tension).hamiltonian_jumps
    for knot, jump in zip(np.eye(4)[1:3], jumps, strict=True):
        step = 1e-4 * knot
        slope = (action(TIMES + step) - action(TIMES - step)) / 2e-4
        assert jump == pytest.approx(slope, rel=1e-5, abs=1e-5 * action(TIMES))


@pytest.mark.parametrize("metric", [go.Euclidean(2), Sphere()], ids=lambda m: type(m).__name__)
def test_times_within_their_bounds_are_optimal(metric: go.Metric) -> None:
    found = go.spline(metric, TIMES, POINTS, time_bounds=(0.0, 1.6))
    inner = found.times[1:3]
    assert found.certificate.stationary_times == pytest.approx(tuple(inner))
    assert found.certificate.times_at_bounds == ()
    assert found.action < go.spline(metric, TIMES, POINTS).action
    for step in 1e-2 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]):
        times = [0.0, *(inner + step), 1.6]
        assert go.spline(metric, times, POINTS).action > found.action


def test_bounds_that_are_active_are_named() -> None:
    free = go.spline(Sphere(), TIMES, POINTS, time_bounds=(0.0, 1.6)).times
    upper = [(TIMES[1] + free[1]) / 2.0, 1.6] if free[1] > TIMES[1] else [1.6, 1.6]
    lower = [0.0, 0.0] if free[1] > TIMES[1] else [(TIMES[1] + free[1]) / 2.0, 0.0]
    found = go.spline(Sphere(), TIMES, POINTS, time_bounds=(lower, upper)).certificate
    assert found.times_at_bounds == pytest.approx([(TIMES[1] + free[1]) / 2.0])
    assert len(found.stationary_times) == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_cubics_to_poses_of_the_hand(seed: int) -> None:
    """Random reaches: the end velocity is zero, free or given; with and without rotation."""
    rng = np.random.default_rng(seed)
    q0, other = rng.uniform(ARM.lower, ARM.upper, (2, 7))
    rotation, position = ARM.hand_pose(q0 + rng.uniform(0.1, 0.6) * (other - q0))
    v0, v1 = rng.uniform(-1.0, 1.0, (2, 7))
    end = (np.zeros(7), None, v1)[seed % 3]
    pose = {"position": position} | ({"rotation": rotation} if seed % 2 else {})
    motion = go.cubic(HUMAN, q0, v0, None, end, 0.8, **pose)
    reached = ARM.hand_pose(motion(0.8))
    np.testing.assert_allclose(reached[1], position, atol=1e-8)
    if seed % 2:
        np.testing.assert_allclose(reached[0], rotation, atol=1e-8)
    assert motion.boundary_residual < 1e-6
    # Of the cubics to configurations with the pose nearby, it has the least action.
    beside = motion(0.8) + 0.05 * motion.hand.tangents(motion(0.8))[:, 0]
    beside = go.ocp.inverse_kinematics(ARM, beside, **pose, limits=False)
    assert go.cubic(HUMAN, q0, v0, beside, end, 0.8).action > motion.action
    if seed == 2:
        assert motion.certificate.locally_minimizing
        assert motion.certificate.boundary_residual < 1e-6


@pytest.mark.slow
def test_splines_may_end_at_a_pose_at_an_optimal_time() -> None:
    points = [[0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.4, 0.1, -0.5, 1.0, 0.1, 0.0, 0.0], None]
    position = ARM.hand_pose([0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1])[1]
    rest = {"v0": np.zeros(7), "v1": np.zeros(7), "position": position}
    found = go.spline(HUMAN, [0.0, 0.2, 0.8], points, **rest, time_bounds=(0.1, 0.7))
    assert tuple(map(len, found.optimal_times)) == (0, 1)
    assert found.boundary_residual < 1e-6
    np.testing.assert_allclose(ARM.hand_pose(found(0.8))[1], position, atol=1e-8)
    assert found.action < go.spline(HUMAN, [0.0, 0.2, 0.8], points, **rest).action


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position": None}, "give q1, or None and a position"),
        ({"q1": np.zeros(7)}, "give q1, or None and a position"),
        ({"v0": None}, "give v0, v1 or a tension"),
        ({"position": [0.0, 1.0]}, r"position must have shape \(3,\)"),
        ({"rotation": np.ones((3, 3))}, "rotation must be a rotation matrix"),
        ({"metric": Sphere(), "q0": [1.0, 1.0]}, "need a metric with a model"),
        ({"tension": -1.0}, r"tension must not be negative \[1/s\]"),
        ({"tension": 1e6}, "tension must be at most 2000 /s"),
    ],
)
def test_malformed_ends_are_named(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"metric": HUMAN, "q0": np.zeros(7), "v0": np.zeros(7), "q1": None}
    given |= {"v1": None, "duration": 1.0, "position": [0.2, 0.3, -0.1]}
    with pytest.raises(ValueError, match=message):
        go.cubic(**given | change)


def test_a_pose_out_of_reach_is_no_end() -> None:
    with pytest.raises(go.NotConverged, match="no configuration"):
        go.cubic(HUMAN, np.zeros(7), np.zeros(7), None, None, 1.0, position=[5.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "bounds", [(0.6, 1.6), (0.0, [0.7, 0.8]), (-1.0, 1.6), (0.0, [1.0, 1.0, 1.0]), 0.5]
)
def test_malformed_bounds_are_named(bounds: Any) -> None:
    with pytest.raises(ValueError, match="time_bounds must"):
        go.spline(Sphere(), TIMES, POINTS, time_bounds=bounds)


def test_splines_that_cannot_end_as_given_are_named() -> None:
    with pytest.raises(ValueError, match="no times between the ends"):
        go.spline(Sphere(), [0.0, 1.0], POINTS[:2], time_bounds=(0.0, 1.0))
    with pytest.raises(ValueError, match="the last configuration is None"):
        go.spline(HUMAN, [0.0, 1.0], np.zeros((2, 7)), position=[0.2, 0.3, -0.1])
    near = [[0.0], [0.05], [1.0]]
    with pytest.raises(go.NotConverged, match="as close as a tenth of the mean interval"):
        go.spline(go.Euclidean(1), [0.0, 0.5, 1.0], near, time_bounds=(0.0, 1.0))
