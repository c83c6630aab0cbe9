"""A planned motion beside inverse kinematics under the same limits, on a person's own arm."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory, plan_trajectory
from geodesic_ocp.retargeting.arm_alignment import align
from geodesic_ocp.retargeting.arm_result import compare_under_equal_limits
from geodesic_ocp.retargeting.paired_arm import PoseMapping

EDGES = np.array([3.0, 3.6, 4.2])
WAY = 0.5 * np.array([1.0, 0.4, -0.8, 1.0, 0.2, 0.1, 0.3])


@pytest.fixture(scope="module")
def corners(arm: go.Model) -> np.ndarray:
    middle = (arm.lower + arm.upper) / 2.0
    return np.array([middle, middle + WAY, middle + WAY * np.array([2, 0, 1, 1, 0, 0, 2])])


@pytest.fixture(scope="module")
def recorded(arm: go.Model, corners: np.ndarray) -> go.Motion:
    """From corner to corner on straight lines, from rest to rest."""
    time = np.linspace(EDGES[0], EDGES[-1], 121)
    s = np.interp(time, EDGES, [0.0, 1.0, 2.0])
    eased = np.floor(s) + (1.0 - np.cos(np.pi * (s - np.floor(s)))) / 2.0
    q = np.stack([np.interp(eased, range(3), column) for column in corners.T], axis=1)
    return go.Motion(time, q, arm.joint_names)


@pytest.fixture(scope="module")
def planned(arm: go.Model, corners: np.ndarray) -> PlannedTrajectory:
    """The same lines on the same arm with limits that are too low for the person's time."""
    metric, grid = go.KineticEnergy(arm), go.Grid(2, 4)
    paths = [
        go.Path(metric, grid, start + np.outer(grid.nodes, end - start))
        for start, end in pairwise(corners)
    ]
    limits = joint_limits(arm, velocity=0.6, acceleration=4.0)
    return plan_trajectory([ArmPaths(arm, limits, EDGES, paths)])


@pytest.mark.slow
def test_of_two_ways_to_follow_a_hand(
    arm: go.Model, recorded: go.Motion, planned: PlannedTrajectory
) -> None:
    same = align(arm)
    mapping = PoseMapping.between(arm, same, same, go.retargeting.RetargetingSettings())
    found = compare_under_equal_limits(planned, recorded, mapping)
    ours, theirs, faster = found.values()
    assert next(iter(found)) == "geodesic synergies"
    assert ours.duration > faster.duration
    assert faster.duration == pytest.approx(EDGES[-1] - EDGES[0], abs=0.011)
    assert theirs.duration == pytest.approx(ours.duration, abs=0.011)
    for each in found.values():
        assert each.outside == 0.0
        assert max(each.usage["velocity"], each.usage["acceleration"]) <= 1.0 + 1e-3
        # On the person's own path the elbow is where the person's is, but for corners and delays.
        assert each.elbow < 0.05
        assert each.position < 0.1
    # In the person's time, limits are too low to follow the hand.
    assert faster.largest_position > 2.0 * theirs.largest_position


@pytest.mark.slow
def test_orientation_may_be_left_free(
    arm: go.Model, recorded: go.Motion, planned: PlannedTrajectory
) -> None:
    same = align(arm)
    mapping = PoseMapping.between(arm, same, same, go.retargeting.RetargetingSettings())
    turned = compare_under_equal_limits(planned, recorded, mapping, rate=50.0)
    free = compare_under_equal_limits(planned, recorded, mapping, rate=50.0, turning=False)
    name = "inverse kinematics (QP)"
    assert free[name].rotation > turned[name].rotation
