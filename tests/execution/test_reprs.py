"""Values of execution show themselves in a few lines, also for many joints and violations."""

from __future__ import annotations

import numpy as np
import pytest
from short_reprs import OF_EXECUTION, check_reprs

import geodesic_ocp as go


@pytest.mark.slow
def test_reprs_are_short() -> None:
    one = go.human_arm("right")
    arm = go.model.combine(one, go.human_arm("left"))
    limits = go.execution.joint_limits(arm, velocity=2.0, torque=50.0)
    grid = go.Grid(1, 3)
    zero, target = np.clip(0.0, arm.lower, arm.upper), (arm.lower + arm.upper) / 2.0
    line = go.Path(go.Euclidean(14), grid, zero + np.outer(grid.nodes, 0.2 * (target - zero)))
    paths = go.execution.ArmPaths(arm, limits, np.array([0.0, 1.0]), [line])
    planned = go.execution.plan_trajectory([paths], throw=False)
    trajectory = planned.sampled(50.0)
    broken = go.trajectory.JointTrajectory(
        trajectory.time,
        10.0 * trajectory.positions,
        trajectory.velocities - 1.0,
        trajectory.accelerations + 500.0,
        trajectory.joint_names,
    )
    failed = go.execution.check_trajectory(broken, arm, limits)
    assert len(failed.violations) > 14
    half = go.trajectory.JointTrajectory(
        trajectory.time,
        trajectory.positions[:, :7],
        trajectory.velocities[:, :7],
        trajectory.accelerations[:, :7],
        one.joint_names,
    )
    values = [
        planned,
        trajectory,
        go.execution.check_trajectory(trajectory, arm, limits),
        failed,
        go.execution.keep_clear(arm),
        go.execution.link_pairs(arm),
        go.execution.trajectory_clearance(arm, trajectory),
        go.execution.motion_measures(
            one, half, one.hand_pose(half.positions), go.execution.joint_limits(one)
        ),
    ]
    assert check_reprs(values) >= OF_EXECUTION


def test_repr_of_a_replay_is_short() -> None:
    pytest.importorskip("mujoco")
    arm = go.human_arm("right", armature=0.05)
    time = np.arange(11) / 100.0
    rest = np.tile((arm.lower + arm.upper) / 2.0, (len(time), 1))
    standing = go.trajectory.JointTrajectory(time, rest, 0.0 * rest, 0.0 * rest, arm.joint_names)
    assert check_reprs([go.execution.replay(standing, arm)]) >= {go.execution.Replay}
