"""Inverse kinematics within limits by the package's own steps and by those of pink.

Usage: python benchmarks/pink_tracking.py [--rate HZ]

pink (extra comparison) knows nothing of this package's Jacobian, errors and least squares.
Printed are the largest difference of the joints, and the times, on a smooth motion of a person's
arm at which limits are active.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from pink import Configuration, solve_ik
from pink.limits import Limit
from pink.tasks import FrameTask, LowAccelerationTask, PostureTask
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.execution.track_within_limits import StepSolver, track_within_limits


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
    model: go.Model,
    rate: float,
    *,
    turning: bool = True,
    placing: bool = True,
    posture_weight: float = 1e-2,
    smoothing: float = 1e-3,
) -> StepSolver:
    """A function that solves steps [s] with pink's tasks, and its QP by DAQP.

    FrameTask is given the pose that the hand reaches within the step at the wanted velocity. Bounds
    of the speeds stand in a Limit. (Those of pink's own AccelerationLimit can contradict each other
    near the end of a joint's range, as they count the room for braking before the step, not after.)

    Args:
        model: a robot arm.
        rate: of the controller [Hz].
        turning, placing, posture_weight, smoothing: as of `track_within_limits`.
    """
    chain = model.pin.copy()  # pink adds attributes to it
    data = chain.createData()
    duration, rows = 1.0 / rate, [*range(3 * (not placing), 3), *range(3, 3 + 3 * turning)]
    hand = FrameTask(model.hand, position_cost=float(placing), orientation_cost=float(turning))
    posture = PostureTask(cost=posture_weight)
    change = LowAccelerationTask(cost=float(np.sqrt(smoothing * rate)))
    bounds = Bounds()

    def solve(
        q: np.ndarray,
        wanted: np.ndarray,
        towards: np.ndarray,
        before: np.ndarray,
        damping: float,
        limits: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        way = np.zeros(6)
        way[rows] = duration * wanted
        configuration = Configuration(chain, data, q, copy_data=False)
        pose = configuration.get_transform_frame_to_world(model.hand)
        pose.rotation = Rotation.from_rotvec(way[3:]).as_matrix() @ pose.rotation
        pose.translation = pose.translation + way[:3]
        hand.set_target(pose)
        posture.set_target(q + duration * towards)
        change.set_last_integration(before, duration)
        bounds.lower, bounds.upper = (duration * each for each in limits)
        return np.asarray(
            solve_ik(
                configuration,
                [hand, posture, change],
                duration,
                "daqp",
                damping=damping,
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
    limits = go.execution.joint_limits(arm, velocity=0.5, acceleration=2.0)
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
