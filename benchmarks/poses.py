"""Random attainable poses of robots' hands: how many paths to them are found."""

from __future__ import annotations

import argparse
import sys
import time
import warnings

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.retargeting.arm_result import Transfer
from geodesic_ocp.retargeting.candidates import first_candidates
from geodesic_ocp.retargeting.free_geodesics import to_pose
from geodesic_ocp.retargeting.paired_arm import Pose, nearest_configurations, with_narrowed_limits
from geodesic_ocp.retargeting.settings import Formulation
from geodesic_ocp.retargeting.synergy_paths import plan_synergies
from geodesic_ocp.retargeting.waypoints import ArmWaypoints

ROBOTS = ("armar6-left", "armar6-right", "panda", "talos-left-arm", "xarm7")
REACHED = 1e-6  # [m] and [rad]
TOLERANCE = 1e-6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--formulation", default="constrained")
    parser.add_argument(
        "--check", action="store_true", help="fail if more than one in a hundred is not reached"
    )
    options = parser.parse_args()
    for name in options.robots:
        found = run(name, options.count, options.seed, options.formulation)
        if options.check and found < 0.99 * options.count:
            sys.exit(f"{name}: only {found} of {options.count} were reached")


def run(name: str, count: int, seed: int, formulation: Formulation) -> int:
    """Number of poses reached, by paths that are within the limits everywhere."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = go.load_model(name)
    settings = go.retargeting.RetargetingSettings(formulation=formulation, speed_limits=False)
    arm = with_narrowed_limits(model, TOLERANCE) if settings.within_limits else model
    rng = np.random.default_rng(seed)
    seconds, iterations, num_reached, worst = [], [], 0, 0.0
    for number in range(count):
        start, end = rng.uniform(model.lower, model.upper, (2, model.dof))
        pose = Pose(*model.hand_pose(end))
        begin = time.perf_counter()
        if settings.constrained:
            transfer = by_the_program(arm, settings, start, pose, (start + end) / 2.0)
        else:
            placed = settings.within_limits, settings.pose_weights
            near = nearest_configurations(model, start, pose, *placed, settled=0.2)[0]
            transfer = to_pose(model, start, pose, near, settings)
        seconds.append(time.perf_counter() - begin)
        iterations.append(transfer.iterations)
        q = transfer.path(np.linspace(0.0, 1.0, 2001))
        outside = max(0.0, float(np.max([model.lower - q, q - model.upper])))
        errors = transfer.position_error, transfer.rotation_error
        if (
            transfer.success
            and max(errors) <= REACHED
            and (outside == 0.0 or not settings.within_limits)
        ):
            num_reached, worst = num_reached + 1, max(worst, *errors)
        else:
            reach = "" if transfer.within_reach else "inverse kinematics did not find it; "
            print(
                f"{name} {number}: {reach}{transfer.status}; pose error {errors[0]:.1e} m, "
                f"{errors[1]:.1e} rad; outside the limits by {outside:.1e}"
            )
    print(
        f"{name}: {num_reached} of {count} reached to {worst:.1e} m or rad, "
        f"median {np.median(seconds):.2f} s, longest {max(seconds):.1f} s, "
        f"{np.median(iterations):.0f} iterations",
        flush=True,
    )
    return num_reached


def by_the_program(
    arm: go.Model,
    settings: go.retargeting.RetargetingSettings,
    start: np.ndarray,
    pose: Pose,
    middle: np.ndarray,
) -> Transfer:
    """The program over all synergies, of one synergy."""
    waypoints = ArmWaypoints(
        arm=arm,
        limited=settings.within_limits,
        alignment=go.retargeting.align(arm),
        begins=np.zeros(1),
        ends=np.ones(1),
        poses=(Pose(*arm.hand_pose(start)), pose),
        target_at=lambda numbers: (Pose(*arm.hand_pose(middle)),) * len(numbers),
        start=start,
        limits=go.execution.JointLimits(*np.full((4, arm.dof), np.inf)),
        offsets=None,
        weights=settings.pose_weights,
    )
    first, last = first_candidates(waypoints)
    planned = plan_synergies(
        [waypoints], [(first, last)], likeness=0.0, tolerance=TOLERANCE, throw=False
    )
    ((path,),) = planned.paths
    return Transfer(
        path,
        pose,
        last.within_reach,
        *pose.error(arm, path.nodes[-1]),
        iterations=planned.iterations,
        success=planned.success,
        status=planned.status,
    )


if __name__ == "__main__":
    main()
