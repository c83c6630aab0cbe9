"""Several geodesics between two configurations, and logarithmic maps of robots.

Usage: python benchmarks/geodesics.py [--pairs N] [--seeds N]

How many are found, how many fail, and computing times: for two uniform rods and half a revolution,
which three geodesics join, over several seeds; for random pairs of configurations of the human arm,
from ten starts each; and for logarithmic maps of the robots that are installed.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "problems"))
from two_link_challenge import TwoLinkChallenge

# Half of the central fraction of the joints' ranges from which configurations are drawn.
_HUMAN, _ROBOT = 0.3, 0.35


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=8)
    parser.add_argument("--seeds", type=int, default=10)
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # about repairs of robot files

    challenge = TwoLinkChallenge()
    start, found = time.perf_counter(), []
    for seed in range(options.seeds):
        found.append(go.geodesics(challenge.metric, challenge.start, challenge.goal, seed=seed))
    seconds = (time.perf_counter() - start) / options.seeds
    print(f"two links, 20 starts: {[len(each) for each in found]} geodesics, {seconds:.1f} s each")
    for path in max(found, key=len):
        print(f"  {path.length:.6f} {path.certificate}")

    arm = go.human_arm()
    metric, times, several = go.KineticEnergy(arm), [], 0
    certificates = []
    for q0, q1 in pairs(arm, _HUMAN, options.pairs):
        start = time.perf_counter()
        paths = go.geodesics(metric, q0, q1, num_starts=10)
        times.append(time.perf_counter() - start)
        several += len(paths) > 1
        start = time.perf_counter()
        assert paths[0].certificate.endpoint_error < 1e-8
        certificates.append(time.perf_counter() - start)
    print(
        f"human arm, 10 starts, {options.pairs} pairs: median {np.median(times):.2f} s, longest "
        f"{max(times):.1f} s, several geodesics for {several}; "
        f"certificate {np.median(certificates):.3f} s"
    )

    for name in ROBOTS:
        if folder(ROBOTS[name].package) is None:
            continue
        robot = go.load_model(name)
        metric, times, failed = go.KineticEnergy(robot), [], 0
        for q0, q1 in pairs(robot, _ROBOT, options.pairs):
            start = time.perf_counter()
            try:
                go.log(metric, q0, q1)
            except go.NotConverged:
                failed += 1
            times.append(time.perf_counter() - start)
        # The first call builds the functions.
        print(f"{name:20} log: median {np.median(times[1:]):.3f} s, {failed} failed")


def pairs(model: go.Model, fraction: float, count: int) -> np.ndarray:
    """Random pairs (count, 2, n) of configurations about mid-range, within one revolution."""
    lower, upper = np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)
    middle, half = (lower + upper) / 2.0, fraction * (upper - lower)
    rng = np.random.default_rng(1)
    return rng.uniform(middle - half, middle + half, (count, 2, model.dof))


if __name__ == "__main__":
    main()
