"""Random reaches within joint limits: how many converge, their processor times, and how well limits
hold between nodes.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

import geodesic_ocp as go

TOLERANCE = 1e-6  # [rad] and [m]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--models", nargs="+", default=["human", "panda"])
    parser.add_argument(
        "--check", action="store_true", help="fail if more than one in fifty is not found"
    )
    options = parser.parse_args()
    for name in options.models:
        found = run(name, options.count, options.seed)
        if options.check and found < 0.98 * options.count:
            sys.exit(f"{name}: only {found} of {options.count} converged")


def run(name: str, count: int, seed: int) -> int:
    """Reaches from a random configuration to the hand's position in another; number converged."""
    model = go.human_arm() if name == "human" else go.load_model(name)
    rng = np.random.default_rng(seed)
    seconds, worst = [], 0.0
    for number in range(count):
        start, end = rng.uniform(model.lower, model.upper, (2, model.dof))
        reach = go.Reach(model, start, model.hand_pose(end)[1])
        begin = time.process_time()
        try:
            solution = go.solve(reach, tolerance=TOLERANCE)
        except go.NotConverged as error:
            print(f"{name} {number}: {error}")
            continue
        seconds.append(time.process_time() - begin)
        q = solution.path(np.linspace(0.0, 1.0, 2001))
        worst = max(worst, float(np.max([model.lower - q, q - model.upper])))
    median, most = 1e3 * np.quantile(seconds, [0.5, 0.95])
    print(
        f"{name}: {len(seconds)} of {count} converged, median {median:.0f} ms, 95 % {most:.0f} ms; "
        f"limits violated by at most {max(worst, 0.0):.1e} at 2001 points"
    )
    return len(seconds)


if __name__ == "__main__":
    main()
