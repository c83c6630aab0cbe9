"""Both back ends of the rigid-body algorithms, side by side: do they agree, and what do they cost?

    python benchmarks/back_ends.py [--count N] [--logs N] [--speed]

Ten models: arms of persons, robots with revolute, continuous, prismatic and mimic joints, and a
tree of helical joints. At random configurations the mass matrix and the Christoffel symbols are
compared, and at random pairs the logarithmic map. With --speed, operations, compile times and the
time of a logarithmic map follow. Exit code 1 if the back ends differ by more than 1e-12.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import casadi as ca
import numpy as np
import pinocchio as pin

import geodesic_ocp as go
from geodesic_ocp.compiled import cache, library
from geodesic_ocp.model.casadi_interface import library as interface
from geodesic_ocp.model.dynamics import BACKENDS, backend_version, why_unavailable

LARGEST = 1e-12  # relative difference
ROUNDS = 5  # of both back ends in turn, for times


def models() -> dict[str, Callable[[str], go.Model]]:
    """Functions that build the ten models with a back end."""
    sample = pin.buildSampleModelManipulator()
    tip = sample.frames[sample.nframes - 1].name
    robots = ("panda", "ur5", "xarm7", "talos-right-arm", "armar6-right")
    loaded = {
        name: lambda backend, name=name: go.load_model(name, backend=backend) for name in robots
    }
    return {
        "human right arm": lambda backend: go.human_arm("right", backend=backend),
        "person, both arms": lambda backend: go.human_upper_body(backend=backend),
        "six joints in series": lambda backend: go.Model(sample, tip, backend),
        "screws and slides": lambda backend: go.Model(tree(), "tool", backend),
        "pr2": lambda backend: go.load_model("pr2", hand="r_gripper_tool_frame", backend=backend),
        **loaded,
    }


def tree() -> pin.Model:
    """Two branches of helical, prismatic and continuous joints, of any axis."""
    rng = np.random.default_rng(3)
    slanted = np.array([0.6, 0.0, 0.8])
    joints = (
        pin.JointModelHelicalUnaligned(slanted, 0.05),
        pin.JointModelRUBZ(),
        pin.JointModelHX(0.1),
        pin.JointModelPY(),
        pin.JointModelRUBX(),
        pin.JointModelPrismaticUnaligned(slanted),
    )
    model = pin.Model()
    for index, joint in enumerate(joints):
        place = pin.SE3(pin.rpy.rpyToMatrix(rng.uniform(-1.0, 1.0, 3)), rng.uniform(-0.4, 0.4, 3))
        added = model.addJoint(0 if index == 3 else index, joint, place, f"joint {index + 1}")
        body = pin.Inertia(
            1.0 + rng.random(), rng.uniform(-0.2, 0.2, 3), np.diag([0.03, 0.04, 0.05])
        )
        model.appendBodyToJoint(added, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", 3, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def configurations(model: go.Model, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random configurations (count, n) within the joint limits, and within +-1.5 rad or m."""
    low, high = np.clip(model.lower, -1.5, 1.0), np.clip(model.upper, -1.0, 1.5)
    return rng.uniform(low, high, (count, model.dof))


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two arrays (k, ...), relative to the largest entry of each row.

    Rows of nan are maps that were not found; infinite if only one back end found them.
    """
    one, other = one.reshape(len(one), -1), other.reshape(len(other), -1)
    missing = np.isnan(one).any(axis=1)
    if not np.array_equal(missing, np.isnan(other).any(axis=1)):
        return np.inf
    changes = np.abs(one - other).max(axis=1) / np.abs(other).max(axis=1)
    return float(changes[~missing].max())


def differences(pair: list[go.Model], count: int, num_logs: int) -> list[float]:
    """Largest relative differences of G, Christoffel symbols and logarithmic maps."""
    rng = np.random.default_rng(0)
    metrics = [go.KineticEnergy(model) for model in pair]
    at = configurations(pair[0], count, rng)
    ends = configurations(pair[0], 2 * num_logs, rng).reshape(2, num_logs, -1)
    quantities = (
        [model.mass_matrix(at) for model in pair],
        [np.array([metric.christoffel(q) for q in at]) for metric in metrics],
        [logs(metric, ends) for metric in metrics],
    )
    return [difference(*values) for values in quantities]


def logs(metric: go.Metric, ends: np.ndarray) -> np.ndarray:
    """Logarithmic maps of pairs (2, k, n); nan where none is found."""
    with warnings.catch_warnings(action="ignore"):
        return go.log(metric, *ends, throw=False)


def operations(model: go.Model) -> int:
    """Number of CasADi's instructions for the mass matrix."""
    q = ca.SX.sym("q", model.dof)
    return ca.Function("G", [q], [model.mass_matrix(q)]).n_instructions()


def compile_time(model: go.Model, compiler: str) -> float:
    """Time of a first logarithmic map [s] with a compiler and an empty cache."""
    with tempfile.TemporaryDirectory() as temporary:
        # Pinocchio's interface is kept in the same cache.
        (Path(temporary) / interface.folder().name).symlink_to(interface.folder())
        chosen = {library.ENVIRONMENT_VARIABLE: compiler, cache.ENVIRONMENT_VARIABLE: temporary}
        with patch.dict(os.environ, chosen):
            started = time.perf_counter()
            go.log(go.KineticEnergy(model), np.full(model.dof, 0.1), np.full(model.dof, 0.3))
            return time.perf_counter() - started


def log_times(pair: list[go.Model], count: int) -> np.ndarray:
    """Times of a logarithmic map [s] by either back end: medians of rounds in turn."""
    ends = configurations(pair[0], 2 * count, np.random.default_rng(1)).reshape(2, count, -1)
    times = np.zeros((ROUNDS + 1, len(pair)))
    for row in times:
        for column, model in enumerate(pair):
            metric = go.KineticEnergy(model)
            started = time.perf_counter()
            logs(metric, ends)
            row[column] = (time.perf_counter() - started) / count
    return np.median(times[1:], axis=0)  # the first round compiles


def compare(count: int, num_logs: int) -> bool:
    """Print the differences of the back ends; returns whether all are small enough."""
    print(f"largest relative differences at {count} configurations, {num_logs} logarithmic maps")
    print(f"{'':24}{'G':>10}{'Christoffel':>13}{'log':>10}")
    worst = 0.0
    for name, build in models().items():
        found = differences([build(backend) for backend in BACKENDS], count, num_logs)
        worst = max(worst, *found)
        print(f"{name:24}{found[0]:10.1e}{found[1]:13.1e}{found[2]:10.1e}", flush=True)
    print(f"largest: {worst:.1e}, allowed: {LARGEST:.0e}")
    return worst <= LARGEST


def costs(num_logs: int) -> None:
    """Print operations, compile times and times of logarithmic maps, a row for each model."""
    print("\noperations of G and of the geodesic equation, first log with tcc and the system's")
    print(f"compiler [s], later ones [ms]; {' / '.join(BACKENDS)}, and ratios of the latter")
    for name, build in models().items():
        pair = [build(backend) for backend in BACKENDS]
        metrics = [go.KineticEnergy(model) for model in pair]
        rows = (
            [operations(model) for model in pair],
            [metric.geodesic_equation.n_instructions() for metric in metrics],
            [compile_time(model, "tcc") for model in pair],
            [compile_time(model, "system") for model in pair],
            1e3 * log_times(pair, num_logs),
        )
        shown = (f"{own:.4g} / {other:.4g}" for own, other in rows)
        print(
            f"{name:24}{''.join(f'{text:>16}' for text in shown)}{rows[-1][1] / rows[-1][0]:6.2f}"
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, help="configurations of a model")
    parser.add_argument("--logs", type=int, default=100, help="logarithmic maps of a model")
    parser.add_argument("--speed", action="store_true", help="measure operations and times, too")
    options = parser.parse_args()
    for name in BACKENDS:
        if missing := why_unavailable(name):
            print(f"{name} cannot be used here: {missing}")
            return 1
        print(f"{name}: {backend_version(name)}")
    agree = compare(options.count, options.logs)
    if options.speed:
        costs(options.logs)
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
