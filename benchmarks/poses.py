"""Random poses that a robot's hand can have, from random configurations: how many paths are found."""

from __future__ import annotations

import argparse
import sys
import time
import warnings

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.ocp.ik.inverse_kinematics import Clear
from geodesic_ocp.retargeting.targets import Conditions, Pose, goals
from geodesic_ocp.retargeting.transfer import transferred

ROBOTS = ("armar6-left", "armar6-right", "panda", "talos-left-arm", "xarm7")
REACHED = 1e-6  # [m] and [rad]
DURATION = 1e3  # [s]: so slow that no joint is too fast


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--formulation", default="constrained")
    parser.add_argument(
        "--check", action="store_true", help="fail if one in a hundred is not found"
    )
    options = parser.parse_args()
    for name in options.robots:
        found = run(name, options.count, options.seed, options.formulation)
        if options.check and found < 0.99 * options.count:
            sys.exit(f"{name}: only {found} of {options.count}")


def run(name: str, count: int, seed: int, formulation: str) -> int:
    """How many poses were met, within the limits everywhere on the path."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = go.load_model(name)
    limits = formulation == "constrained"
    conditions = Conditions(formulation, limits, False, Clear(), (1.0, 1.0), 1e-8, 1)
    rng = np.random.default_rng(seed)
    seconds, iterations, met, worst = [], [], 0, 0.0
    for number in range(count):
        start, end = rng.uniform(model.lower, model.upper, (2, model.dof))
        pose = Pose(*model.hand_pose(end))
        begin = time.perf_counter()
        found = goals(model, start, [pose], conditions)
        (transfer,) = transferred(model, start, found, [DURATION], conditions, throw=False)
        seconds.append(time.perf_counter() - begin)
        iterations.append(transfer.iterations)
        q = transfer.path(np.linspace(0.0, 1.0, 2001))
        outside = max(0.0, float(np.max([model.lower - q, q - model.upper])))
        errors = transfer.position_error, transfer.rotation_error
        if transfer.success and max(errors) <= REACHED and (outside == 0.0 or not limits):
            met, worst = met + 1, max(worst, *errors)
        else:
            reach = "" if transfer.within_reach else "inverse kinematics did not find it; "
            print(
                f"{name} {number}: {reach}{transfer.status}; missed by {errors[0]:.1e} m, "
                f"{errors[1]:.1e} rad; outside limits by {outside:.1e}"
            )
    print(
        f"{name}: {met} of {count} met to {worst:.1e} m or rad, median {np.median(seconds):.2f} s, "
        f"longest {max(seconds):.1f} s, {np.median(iterations):.0f} iterations",
        flush=True,
    )
    return met


if __name__ == "__main__":
    main()
