"""The two back ends of the symbolic mass matrix: agreement, operations and time of one evaluation.

Usage: python benchmarks/back_ends.py [--seconds S]

For the mass matrix G, the second derivatives of the Lagrangian v' G v / 2 with respect to q and v
(what the optimizer evaluates at every node), and the hand's pose FK. Operations are CasADi's
instructions, inputs and outputs included. Times on a shared machine vary; the back ends are timed
in alternation, and the ratio of the two is what counts.
"""

from __future__ import annotations

import argparse
import sys
import timeit
from collections.abc import Callable

import casadi as ca
import numpy as np
import pinocchio as pin

import geodesic_ocp as go
from geodesic_ocp.model.dynamics import BACKENDS, why_unavailable

ROUNDS = 7


def models() -> dict[str, Callable[[str], go.Model]]:
    """The arms, and a serial robot whose joint axes are in general position."""
    sample = pin.buildSampleModelManipulator()
    hand = sample.frames[sample.nframes - 1].name
    return {
        "human right arm": lambda backend: go.human_arm("right", backend=backend),
        "human left arm": lambda backend: go.human_arm("left", backend=backend),
        "six joints in series": lambda backend: go.Model(sample, hand, backend),
    }


def functions(model: go.Model) -> dict[str, ca.Function]:
    """G, the Lagrangian's Hessian and FK as functions of q and v, as the package uses them."""
    q, v = ca.SX.sym("q", model.dof), ca.SX.sym("v", model.dof)
    matrix = model.mass_matrix(q)
    hessian, _ = ca.hessian(go.KineticEnergy(model).inner(q, v, v) / 2, ca.vertcat(q, v))
    outputs = {
        "G": [matrix],
        "Hessian of the Lagrangian": [ca.densify(ca.cse(hessian))],
        "FK": list(model.hand_pose(q)),
    }
    return {name: ca.Function("f", [q, v], output) for name, output in outputs.items()}


def outputs(function: ca.Function, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.concatenate([part.full().ravel() for part in function.call([q, v])])


def microseconds(function: ca.Function, seconds: float) -> float:
    """Time of one evaluation, without the overhead of the call from Python."""
    many = function.map(1000)
    q, v = ca.DM.rand(function.numel_in(0), 1000), ca.DM.rand(function.numel_in(1), 1000)
    timer = timeit.Timer(lambda: many(q, v))
    repeats = max(1, int(seconds / timer.timeit(1)))
    return 1e6 * timer.timeit(repeats) / repeats / 1000


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=0.1, help="duration of each measurement")
    options = parser.parse_args()
    for name in BACKENDS:
        if missing := why_unavailable(name):
            print(f"{name} cannot be imported here: {missing}")
            return 1
    rng = np.random.default_rng(0)
    print(f"{'':48}{BACKENDS[0]:>25}{BACKENDS[1]:>25}{'time':>7}{'largest':>12}")
    print(f"{'':48}{'operations':>15}{'us':>10}{'operations':>15}{'us':>10}{'ratio':>7}", end="")
    print(f"{'difference':>12}")
    for name, build in models().items():
        both = [functions(build(backend)) for backend in BACKENDS]
        for quantity in both[0]:
            pair = [one[quantity] for one in both]
            rounds = [[microseconds(f, options.seconds) for f in pair] for _ in range(ROUNDS)]
            times = np.median(rounds, axis=0)
            differences = []
            for point in rng.uniform(-3.0, 3.0, (100, 2, pair[0].numel_in(0))):
                found, expected = (outputs(f, *point) for f in pair)
                differences.append(np.abs(found - expected).max() / np.abs(expected).max())
            counts = [
                f"{function.n_instructions():15d}{time:10.2f}"
                for function, time in zip(pair, times, strict=True)
            ]
            print(f"{name + ': ' + quantity:48}{''.join(counts)}{times[0] / times[1]:7.2f}", end="")
            print(f"{max(differences):12.1e}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
