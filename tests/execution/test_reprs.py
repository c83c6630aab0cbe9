"""Values of execution show themselves in a few lines, also for many joints and violations."""

from __future__ import annotations

import numpy as np
from short_reprs import check_reprs

import geodesic_ocp as go


def test_reprs_are_short() -> None:
    arm = go.combine(go.human_arm("right"), go.human_arm("left"))
    limits = go.joint_limits(arm, velocity=2.0, torque=50.0)
    grid = go.Grid(1, 3)
    zero, target = np.clip(0.0, arm.lower, arm.upper), (arm.lower + arm.upper) / 2.0
    line = go.Path(go.Euclidean(14), grid, zero + np.outer(grid.nodes, 0.2 * (target - zero)))
    paths = go.ArmPaths(arm, limits, np.array([0.0, 1.0]), [line])
    planned = go.plan_trajectory([paths], throw=False)
    trajectory = planned.sampled(50.0)
    broken = go.JointTrajectory(
        trajectory.time,
        10.0 * trajectory.positions,
        trajectory.velocities - 1.0,
        trajectory.accelerations + 500.0,
        trajectory.joint_names,
    )
    failed = go.check_trajectory(broken, arm, limits)
    assert len(failed.violations) > 14
    covered = check_reprs(
        [planned, trajectory, go.check_trajectory(trajectory, arm, limits), failed]
    )
    assert {
        go.ArmPaths,
        go.JointLimits,
        go.JointTrajectory,
        go.PlannedTrajectory,
        go.TrajectoryCheck,
    } <= covered
