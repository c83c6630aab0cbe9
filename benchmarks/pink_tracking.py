"""Inverse kinematics within limits by the package's own steps and by those of pink.

Usage: python benchmarks/pink_tracking.py [--rate HZ]

pink (extra comparison) knows nothing of this package's Jacobian, errors and least squares.
Printed are the largest difference of the joints, and the times, on a smooth motion of a person's
arm at which limits are active.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pink import Configuration, solve_ik
from pink.limits import Limit
from pink.tasks import FrameTask, LowAccelerationTask, PostureTask
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.execution.track_within_limits import Step, track_within_limits


class Bounds(Limit):
    """Least and largest displacements of all joints."""

    lower: np.ndarray
    upper: np.ndarray

    def compute_qp_inequalities(
        self, configuration: Any, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rows and upper bounds of what is finite."""
        del configuration, dt
        both = np.concatenate([self.upper, -self.lower])
        eye = np.eye(self.upper.size)
        finite = np.isfinite(both)
        return np.vstack([eye, -eye])[finite], both[finite]


def pink_solver(
    model: go.Model, rate: float, *, turning: bool = True, placing: bool = True
) -> Callable[[Step], np.ndarray]:
    """A function that solves steps [s] with pink's tasks, and its QP by DAQP.

    FrameTask is given the pose that the hand reaches within the step at the wanted velocity. Bounds
    of the speeds stand in a Limit. (Those of pink's own AccelerationLimit can contradict each other
    near the end of a joint's range, as they count the room for braking before the step, not after.)

    Args:
        model: a robot arm.
        rate: of the controller [Hz].
        turning, placing: whether it tracks rotations, and positions.
    """
    chain = model.pin.copy()  # pink adds attributes to it
    data = chain.createData()
    duration, rows = 1.0 / rate, [*range(3 * (not placing), 3), *range(3, 3 + 3 * turning)]
    hand = FrameTask(model.hand, position_cost=float(placing), orientation_cost=float(turning))
    posture, change = PostureTask(cost=1.0), LowAccelerationTask(cost=1.0)
    bounds = Bounds()

    def solve(step: Step) -> np.ndarray:
        way = np.zeros(6)
        way[rows] = duration * step.velocity
        configuration = Configuration(chain, data, step.q, copy_data=False)
        pose = configuration.get_transform_frame_to_world(model.hand)
        pose.rotation = Rotation.from_rotvec(way[3:]).as_matrix() @ pose.rotation
        pose.translation = pose.translation + way[:3]
        hand.set_target(pose)
        posture.cost, change.cost = np.sqrt(step.weights)
        posture.set_target(step.q + duration * step.posture)
        change.set_last_integration(step.before, duration)
        bounds.lower, bounds.upper = duration * step.lower, duration * step.upper
        return np.asarray(
            solve_ik(
                configuration,
                [hand, posture, change],
                duration,
                "daqp",
                damping=step.damping,
                limits=[bounds],
                safety_break=False,
            )
        )

    return solve


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=100.0, help="of the controller [Hz]")
    rate = parser.parse_args().rate
    arm = go.human_arm()
    limits = go.joint_limits(arm, velocity=0.5, acceleration=2.0)
    instants = np.linspace(0.0, 2.0, 101)
    phase = (1.0 - np.cos(np.pi * instants / 2.0))[:, None] / 2.0
    q = (arm.lower + arm.upper) / 2.0 + phase * 0.8 * np.cos(np.arange(arm.dof))
    found = []
    for name, solver in (("DAQP", None), ("pink", pink_solver(arm, rate))):
        begin = time.perf_counter()
        given = q[0], instants, arm.hand_pose(q), limits
        found.append(track_within_limits(arm, *given, rate=rate, solver=solver).positions)
        print(f"{name}: {time.perf_counter() - begin:.2f} s")
    print(f"largest difference: {np.abs(found[1] - found[0]).max():.1e} rad")


if __name__ == "__main__":
    main()
