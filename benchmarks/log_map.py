"""Logarithmic maps of the human arm: time and accuracy against SciPy's boundary-value solver.

Usage: python benchmarks/log_map.py [--pairs N] [--check]

Random pairs of configurations in the middle of the joints' ranges. The endpoint error of both
solvers is that of the same integration of the geodesic equation from the initial velocity found.
Times on a shared machine vary; the ratio of the two in one run is what counts. --check exits with 1
if the package is slower.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable

import casadi as ca
import numpy as np
from scipy.integrate import solve_bvp

import geodesic_ocp as go

Solver = Callable[[np.ndarray, np.ndarray], "np.ndarray | None"]


def collocation(metric: go.Metric) -> Solver:
    def solve(q0: np.ndarray, q1: np.ndarray) -> np.ndarray | None:
        try:
            return go.log(metric, q0, q1)
        except go.NotConverged:
            return None

    return solve


def boundary_value_solver(metric: go.Metric) -> Solver:
    """SciPy on the package's own right-hand side with exact derivatives, from the straight line."""
    n, mesh = metric.dim, np.linspace(0.0, 1.0, 11)
    equation = metric.geodesic_equation
    symbols = ca.SX.sym("y", 2 * n)
    slope = ca.densify(ca.cse(ca.jacobian(equation(symbols), symbols)))
    jacobian = ca.Function("jacobian", [symbols], [slope])

    def rates(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return equation.map(s.size)(y).full()

    def derivatives(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return jacobian.map(s.size)(y).full().reshape(2 * n, s.size, 2 * n).transpose(0, 2, 1)

    def solve(q0: np.ndarray, q1: np.ndarray) -> np.ndarray | None:
        def ends(start: np.ndarray, stop: np.ndarray) -> np.ndarray:
            return np.concatenate([start[:n] - q0, stop[:n] - q1])

        line = q0[:, None] + mesh * (q1 - q0)[:, None]
        guess = np.vstack([line, np.tile(q1 - q0, (mesh.size, 1)).T])
        with np.errstate(all="ignore"):
            found = solve_bvp(
                rates, ends, mesh, guess, fun_jac=derivatives, tol=1e-6, max_nodes=5000
            )
        return found.y[n:, 0] if found.success else None

    return solve


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=50)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    arm = go.human_arm()
    metric = go.KineticEnergy(arm)
    rng = np.random.default_rng(0)
    middle, half = (arm.upper + arm.lower) / 2, (arm.upper - arm.lower) / 2
    pairs = middle + 0.6 * half * rng.uniform(-1.0, 1.0, (options.pairs, 2, arm.dof))

    solvers = {
        "geodesic_ocp.log": collocation(metric),
        "scipy solve_bvp": boundary_value_solver(metric),
    }
    medians = {}
    for solver in solvers.values():
        solver(*pairs[0])  # builds the functions
    print(f"{options.pairs} log maps of the {arm.name}")
    print(f"{'':18}{'median':>9}{'90 %':>9}{'failed':>8}{'largest endpoint error':>26}")
    for name, solver in solvers.items():
        times, errors, failed = [], [], 0
        for q0, q1 in pairs:
            start = time.perf_counter()
            v0 = solver(q0, q1)
            times.append(1000.0 * (time.perf_counter() - start))
            if v0 is None:
                failed += 1
            else:
                errors.append(np.abs(go.exp(metric, q0, v0, tolerance=1e-11) - q1).max())
        medians[name] = float(np.median(times))
        slow = np.percentile(times, 90)
        print(f"{name:18}{medians[name]:6.1f} ms{slow:6.0f} ms{failed:8d}{max(errors):22.1e} rad")
    ours, scipys = medians.values()
    print(f"solve_bvp takes {scipys / ours:.1f} times as long")
    return int(options.check and ours > scipys)


if __name__ == "__main__":
    sys.exit(main())
