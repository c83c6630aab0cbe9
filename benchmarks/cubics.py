"""Riemannian cubics of an arm: how many are found, in what time, beside scipy's solve_bvp.

    python benchmarks/cubics.py --count 1000 --bvp 20

Also in tension, with a pose of the hand as the end, and splines whose times are optimal.

Pairs of configurations within the joint limits and end velocities of up to 3 rad/s, random in all
joints. Every cubic found is verified by SciPy: Hamilton's equations are integrated from its initial
state over the whole duration by DOP853, in Python.
"""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import suppress

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


def variants(arm: go.Model, metric: go.Metric, pairs: list[tuple[np.ndarray, ...]]) -> None:
    """Print times and numbers found of cubics in tension, to poses, and of splines in free time."""
    rng = np.random.default_rng(1)

    def in_tension(tension: float, q0, v0, q1, v1, duration) -> bool:
        go.cubic(metric, q0, v0, q1, v1, duration, tension=tension)
        return True

    def to_pose(has_rotation: bool, q0, v0, q1, v1, duration) -> bool:
        rotation, position = arm.hand_pose(q1)
        pose = {"position": position} | ({"rotation": rotation} if has_rotation else {})
        found = go.cubic(metric, q0, v0, None, np.zeros(arm.dof), duration, **pose)
        return found.boundary_residual < 1e-6

    def in_free_time(knots: int, q0, v0, q1, v1, duration) -> bool:
        s = np.linspace(0.0, 1.0, knots)
        points = q0 + s[:, None] * (q1 - q0)
        points[1:-1] += rng.uniform(-0.1, 0.1, (knots - 2, arm.dof))
        ends = {"v0": np.zeros(arm.dof), "v1": np.zeros(arm.dof)}
        found = go.spline(metric, 2.0 * s, points, **ends, time_bounds=(0.0, 2.0))
        return sum(map(len, found.optimal_times)) == knots - 2

    rows = [(f"tension {each:g}/s", in_tension, each) for each in (1.0, 10.0, 100.0)]
    rows += [
        ("to a position of the hand", to_pose, False),
        ("to a pose of the hand", to_pose, True),
    ]
    rows += [(f"spline, {each} times free", in_free_time, each + 2) for each in (1, 3)]
    for name, solve, argument in rows:
        seconds, found = [], 0
        for pair in pairs:
            start = time.perf_counter()
            with suppress(go.NotConverged):
                found += solve(argument, *pair)
            seconds.append(time.perf_counter() - start)
        percentiles = np.percentile(seconds, [50, 90]) * 1e3
        print(f"{name}: {found} of {len(pairs)}, ms: median {percentiles[0]:.1f}, ", end="")
        print(f"p90 {percentiles[1]:.1f}")


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
    parser.add_argument("--variants", type=int, default=100, help="pairs in tension, to poses, ...")
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
    if options.variants:
        variants(arm, metric, pairs[: options.variants])
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
