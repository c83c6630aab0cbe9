"""Whether the objective decreases at small displacements of a path.

Derivatives cannot tell where a cost, a condition or a metric is not smooth: -q |q| is stationary at
zero and flat to second order, floor(q) is so nearly everywhere, and neither has a minimum there.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.conditions import Conditions
from geodesic_ocp.trajectory.path import Path

_POINTS = 200  # of a quadrature, at least: a jump of the cost may move by that part of a path
_RANDOM = 16  # displacements beside those of one coordinate alone
_INCREASE = 1e-3  # of the objective by a displacement, as the Hessian predicts, relative
_FARTHEST = 1e-2  # displacement of a node, of the path's extent
_ROUNDING = 1e-9  # of the differences of objectives, relative


def fine_objective(path: Path, conditions: Conditions | None = None) -> float:
    """Return energy and running cost of a path by a quadrature much finer than that of its grid."""
    grid = path.grid
    quadrature = grid.gauss(max(2 * grid.degree, -(-_POINTS // grid.segments)))
    densities = path.speeds_at(quadrature) ** 2 / 2.0
    if conditions is not None and not conditions.cost.is_zero():
        c = conditions
        q, v = path.states_at(quadrature)
        function = ca.Function("cost", [c.q, c.v, c.p], [c.cost]).map(len(q))
        costs = evaluate(function, q.T, v.T, np.tile(c.p_values[:, None], len(q)))
        densities = densities + costs.reshape(densities.shape)
    return float(np.sum(quadrature.weights * densities))


def decreases_nearby(
    objective: Callable[[Array], float],
    gradient: Array,
    hessian: Array,
    basis: Array,
    s: Array,
) -> bool:
    """Return whether an objective decreases at some of the small displacements at which its second
    derivatives predict an increase: arcs of one coordinate alone to both sides, and random ones, in
    which directions of little increase prevail.

    Args:
        objective: of displacements of x (size,), relative to its size; NaN where a condition is
            violated.
        gradient, hessian: its derivatives (m,) and (m, m), positive definite.
        basis: orthonormal directions of x (size, m) by which they are taken.
        s: parameters (k,) of the nodes that are moved.
    """
    eigenvalues, vectors = np.linalg.eigh(hessian)
    slopes = gradient @ vectors
    coordinates = np.eye(len(basis) // s.size)
    arcs = np.kron(np.sin(np.pi * s)[:, None], coordinates).T @ basis @ vectors
    mixed = np.random.default_rng(0).normal(size=(_RANDOM, len(eigenvalues))) / eigenvalues
    every = np.vstack([arcs, -arcs, mixed])
    every = every[np.any(every != 0.0, axis=1)]  # arcs of fixed coordinates are zero
    moves = every @ vectors.T @ basis.T
    increases = np.sum(every**2 * eigenvalues, axis=1) / 2.0
    lengths = np.minimum(np.sqrt(_INCREASE / increases), _FARTHEST / np.abs(moves).max(axis=1))
    by_slopes = np.abs(every @ slopes)  # a path is stationary to a tolerance
    before = objective(np.zeros(len(basis)))
    for move, length, slope in zip(moves, lengths, by_slopes, strict=True):
        if objective(length * move) < before - length * slope - _ROUNDING * abs(before):
            return True
    return False
