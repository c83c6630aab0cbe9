"""Riemannian cubics of an arm: how many are found, in what time, beside scipy's solve_bvp.

    python benchmarks/cubics.py --count 1000 --bvp 20

Pairs of configurations within the joint limits and end velocities of up to 3 rad/s, random in all
joints. Every cubic found is verified by SciPy: Hamilton's equations are integrated from its initial
state over the whole duration by DOP853, in Python.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.interpolate import BPoly

import geodesic_ocp as go
from geodesic_ocp.manifold import default_joint_inertia
from geodesic_ocp.manifold.motion_kernels import second_order

SPEED = 3.0  # [rad/s]


def random_pairs(arm: go.Model, count: int, seed: int) -> list[tuple[np.ndarray, ...]]:
    """Ends (q0, v0, q1, v1) and durations; no joint's mean velocity exceeds `SPEED`."""
    rng, pairs = np.random.default_rng(seed), []
    for _ in range(count):
        q0, q1 = rng.uniform(arm.lower, arm.upper, (2, arm.dof))
        duration = rng.uniform(0.2, 1.2)
        share = min(1.0, SPEED * duration / np.abs(q1 - q0).max()) * rng.uniform(0.2, 1.0)
        v0, v1 = rng.uniform(-SPEED, SPEED, (2, arm.dof))
        pairs.append((q0, v0, q0 + share * (q1 - q0), v1, duration))
    return pairs


def endpoint_error(metric: go.Metric, motion: go.logarithm.RiemannianSpline) -> float:
    """Distance of the end of SciPy's integration from that of the motion [rad and rad/s]."""
    rate = second_order(metric).rate
    found = solve_ivp(
        lambda _, y: rate(y, motion.tension**2).full()[:, 0],
        (0.0, motion.duration),
        motion.starts[0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    return float(np.abs(found.y[: motion.end.size, -1] - motion.end).max())


def by_bvp(metric: go.Metric, q0, v0, q1, v1, duration) -> tuple[float, bool]:
    """Seconds and success of scipy's solve_bvp on Hamilton's equations."""
    rate = second_order(metric).rate.map(20)
    whole = second_order(metric).rate

    def slopes(_, y: np.ndarray) -> np.ndarray:
        full = y.shape[1] // 20 * 20
        parts = [rate(y[:, i : i + 20], 0.0).full() for i in range(0, full, 20)]
        return np.hstack([*parts, *(whole(y[:, i], 0.0).full() for i in range(full, y.shape[1]))])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        n = len(q0)
        return np.concatenate([a[:n] - q0, a[n : 2 * n] - v0, b[:n] - q1, b[n : 2 * n] - v1])

    t = np.linspace(0.0, duration, 11)
    line = BPoly.from_derivatives([0.0, duration], [[q0, v0], [q1, v1]])
    tensor = metric.matrix(q0)
    q, v, a, j = (line.derivative(k)(t).T if k else line(t).T for k in range(4))
    guess = np.vstack([q, v, -tensor @ j, tensor @ a])
    start = time.perf_counter()
    found = solve_bvp(slopes, ends, t, guess, tol=1e-6, max_nodes=2000)
    return time.perf_counter() - start, bool(found.success)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--bvp", type=int, default=20, help="pairs that solve_bvp solves as well")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--check", action="store_true", help="exit 1 if a cubic is not found")
    options = parser.parse_args()
    arm = go.human_arm()
    metric = go.KineticEnergy(arm.with_armature(default_joint_inertia(arm)))
    pairs = random_pairs(arm, options.count, options.seed)
    for q0, v0, q1, v1, duration in pairs[:50]:  # compiled, and the optimized library loaded
        go.cubic(metric, q0, v0, q1, v1, duration)
    seconds, errors, missing = [], [], 0
    for q0, v0, q1, v1, duration in pairs:
        start = time.perf_counter()
        try:
            motion = go.cubic(metric, q0, v0, q1, v1, duration)
        except go.NotConverged:
            missing += 1
            continue
        finally:
            seconds.append(time.perf_counter() - start)
        errors.append(endpoint_error(metric, motion))
    percentiles = np.percentile(seconds, [50, 90, 99, 100]) * 1e3
    print(f"cubics of a human arm: {options.count - missing} of {options.count} found")
    print("ms: median {:.2f}, p90 {:.2f}, p99 {:.2f}, largest {:.1f}".format(*percentiles))
    largest = np.percentile(errors, [50, 99, 100])
    print("difference from SciPy: median {:.1e}, p99 {:.1e}, largest {:.1e}".format(*largest))
    if options.bvp:
        results = np.array([by_bvp(metric, *each) for each in pairs[: options.bvp]])
        print(
            f"scipy.integrate.solve_bvp: {results[:, 1].sum():.0f} of {options.bvp} found, "
            f"median {np.median(results[:, 0]) * 1e3:.0f} ms, "
            f"{np.median(results[:, 0] / np.array(seconds[: options.bvp])):.0f} times as long"
        )
    return int(options.check and (missing > 0 or max(errors) > 1e-5))


if __name__ == "__main__":
    sys.exit(main())
