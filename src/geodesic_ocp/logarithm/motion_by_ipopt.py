"""Motions of least action by Ipopt: the reference of the compiled core, and where it cannot run."""

from __future__ import annotations

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import DiscreteMotion, SegmentBasis, second_order


def state_matrix(
    basis: SegmentBasis, durations: Array, dim: int, s: Array
) -> scipy.sparse.csr_array:
    """Return the matrix from a motion's variables to (q, q', q'') at fractions s of each segment.

    The variables are those of core/motion.h: the position and velocity of a knot, the coefficients
    of the segment after it, and so on.

    Args:
        basis: polynomials of each segment.
        durations: durations of the segments (k,) [s].
        dim: number n of coordinates.
        s: fractions (m,).

    Returns:
        A matrix of 3 n rows for each of the m points of each segment.
    """
    width, unit = 2 + basis.bubbles, scipy.sparse.eye_array(dim)
    parts: list[list[scipy.sparse.sparray | None]] = []
    order = [0, 1, *range(4, width + 2), 2, 3]  # of the functions by their variables
    for k, duration in enumerate(durations):
        scale = np.ones(width + 2)
        scale[[1, 3]] = duration
        values = [basis.values(s, d) * scale[:, None] / duration**d for d in range(3)]
        rows = np.stack(values, axis=-1)[order].transpose(1, 2, 0).reshape(-1, width + 2)
        local = scipy.sparse.csr_array((len(rows), width * len(durations) + 2)).tolil()
        local[:, k * width : k * width + width + 2] = rows
        parts.append([local])
    return scipy.sparse.csr_array(scipy.sparse.kron(scipy.sparse.block_array(parts), unit))


def find_by_ipopt(
    metric: Metric,
    basis: SegmentBasis,
    durations: Array,
    knots: Array,
    coefficients: Array,
    is_free: Array,
) -> DiscreteMotion | None:
    """Return the motion of least action, as `MotionKernels.find` on one level."""
    n, count, width = metric.dim, len(durations), 2 + basis.bubbles
    s, weights = basis.rule
    point = ca.SX.sym("z", 3 * n)
    cost = second_order(metric).functions["motion_cost"]
    terms = Terms(point, None, cost(point))
    places = state_matrix(basis, durations, n, s)
    block = Block(terms, places, weights=np.outer(durations, weights).ravel())
    x = np.zeros((count * width + 2, n))
    at_knots = np.add.outer(width * np.arange(count + 1), np.arange(2)).ravel()
    rest = np.setdiff1d(np.arange(len(x)), at_knots)
    x[at_knots] = knots.reshape(-1, n)
    x[rest] = coefficients.reshape(-1, n)
    free = np.ones(x.shape, dtype=bool)
    free[at_knots] = is_free.reshape(-1, n)
    program = BlockProgram(x.size, [block])
    bounds = tuple(np.where(free, sign * np.inf, x).ravel() for sign in (-1.0, 1.0))
    options = {"tol": 1e-11, "fixed_variable_treatment": "make_parameter"}
    outcome = program.solve(x.ravel(), bounds, options)  # type: ignore[arg-type]
    if not outcome.success:
        return None
    found = outcome.x.reshape(x.shape)
    gradients, hessians = [], []
    for k in range(count):
        matrix = state_matrix(basis, durations[k : k + 1], n, s)
        own = BlockProgram(matrix.shape[1], [Block(terms, matrix, weights=durations[k] * weights)])
        here = found[k * width : (k + 1) * width + 2].ravel()
        _, slopes = own.functions["grad_f"](here, [])
        upper = own.functions["hess_lag"](here, [], 1.0, []).full()
        full = np.triu(upper) + np.triu(upper, 1).T
        ends = np.r_[0 : 2 * n, width * n : (width + 2) * n]
        inner = np.setdiff1d(np.arange(full.shape[0]), ends)
        solved = np.linalg.solve(full[np.ix_(inner, inner)], full[np.ix_(inner, ends)])
        g = slopes.full()[:, 0]
        gradients.append(g[ends] - solved.T @ g[inner])
        hessians.append(full[np.ix_(ends, ends)] - full[np.ix_(ends, inner)] @ solved)
    return DiscreteMotion(
        found[at_knots].reshape(count + 1, 2 * n),
        found[rest].reshape(count, basis.bubbles, n),
        outcome.objective,
        np.array(gradients),
        np.array(hessians),
    )
