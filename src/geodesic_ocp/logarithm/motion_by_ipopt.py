"""Motions of least action by Ipopt: the reference of the compiled core, and where it cannot run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import DiscreteMotion, SegmentBasis, second_order
from geodesic_ocp.ocp.motion_program import knots_of, state_cells, variables


def action_program(
    metric: Metric, basis: SegmentBasis, durations: Array, tension: float
) -> BlockProgram:
    """Return the discrete action int (tau' G^-1 tau + tension^2 q' G q') / 2 dt of motions of so
    many segments.
    """
    n = metric.dim
    (s, weights) = basis.rule
    times = np.append(0.0, np.cumsum(durations))
    size = (len(durations) * (2 + basis.bubbles) + 2) * n
    places = state_cells(basis, times, n, s)
    at_points = np.outer(durations, weights).ravel()
    squares = np.full((at_points.size, 1), tension**2)
    return BlockProgram(
        size, [Block(second_order(metric).terms, places, squares, weights=at_points)]
    )


def find_by_ipopt(
    metric: Metric,
    basis: SegmentBasis,
    durations: Array,
    knots: Array,
    coefficients: Array,
    is_free: NDArray[np.bool_],
    tension: float,
) -> DiscreteMotion | None:
    """Return the motion of least action, as `MotionKernels.find` on one level."""
    n = metric.dim
    width = 2 + basis.bubbles
    x = variables(knots, coefficients)
    free = variables(is_free.astype(float), np.ones_like(coefficients)) > 0.0
    lower, upper = (np.where(free, sign * np.inf, x) for sign in (-1.0, 1.0))
    options = {"tol": 1e-11, "fixed_variable_treatment": "make_parameter"}
    program = action_program(metric, basis, durations, tension)
    outcome = program.solve(x, (lower, upper), options)
    if not outcome.success:
        return None
    gradients = []
    hessians = []
    ends = np.r_[: 2 * n, width * n : (width + 2) * n]
    inner = np.arange(2 * n, width * n)
    for k in range(len(durations)):
        own = action_program(metric, basis, durations[k : k + 1], tension).functions
        here = outcome.x[k * width * n :][: (width + 2) * n]
        gradient = own["grad_f"](here, [])[1].full()[:, 0]
        upper = own["hess_lag"](here, [], 1.0, []).full()
        full = np.triu(upper) + np.triu(upper, 1).T
        solved = np.linalg.solve(full[np.ix_(inner, inner)], full[np.ix_(inner, ends)])
        gradients.append(gradient[ends] - solved.T @ gradient[inner])
        hessians.append(full[np.ix_(ends, ends)] - full[np.ix_(ends, inner)] @ solved)
    found = knots_of(outcome.x, basis, n)
    return DiscreteMotion(*found, outcome.objective, np.array(gradients), np.array(hessians))
