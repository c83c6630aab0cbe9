"""Newton's method on the discrete energy, interpreted: what the compiled core does, in NumPy."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtrs

from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm.discrete_energy import DiscreteEnergy
from geodesic_ocp.logarithm.levels import Levels

# Shares of the Hessian's terms beside G, from the largest, until it is positive definite.
_SHARES = ((0.6, 0.4), (0.3, 0.15), (0.0, 0.0))
_HALVINGS, _SHORTER, _ARMIJO, _ROUNDING = 12, 0.4, 1e-4, 1e-13

# Relative decrease of the energy by a step that is rounding: a stationary path, if no minimum.
_STATIONARY = 1e-20

CONVERGED, MANY_STEPS, NOT_POSITIVE, NO_DECREASE, NOT_FINITE = range(5)


class Minimum(NamedTuple):
    """A path at which Newton's method stopped, before its last step.

    Attributes:
        status: CONVERGED, or why it is no minimum.
        x: (nodes, n).
        step: the last one, not yet taken, of the inner nodes.
        hessian, factor: of all nodes, the upper triangle; of the inner ones, U with U' U.
        derivatives: at the quadrature points.
        share: of the Hessian's terms beside G in the factor.
        steps: number of Newton steps.
    """

    status: int
    x: Array
    step: Array
    hessian: Array
    factor: Array
    derivatives: Array
    share: float
    steps: int


def minimize(
    energy: DiscreteEnergy, levels: Levels, level: int, x: Array, share: float, is_final: bool
) -> Minimum:
    """Minimize over the inner nodes, see core/newton.h."""
    n = x.shape[1]
    value, out = energy.derivatives(x)
    empty = np.zeros(x.size - 2 * n)
    hessian = np.zeros((0, 0))
    factor: Array | None = None
    for number in range(levels.max_steps(level)):
        gradient = energy.gradient(out)
        share = 0.25 if share == 0.0 else min(1.0, 2.0 * share)
        while True:
            hessian = energy.hessian(out, share)
            factor = _cholesky(hessian[n:-n, n:-n], n * levels.grids[level].degree, n)
            if factor is not None or share == 0.0:
                break
            share = next(lower for above, lower in _SHARES if share > above)
        if factor is None:
            return Minimum(NOT_POSITIVE, x, empty, hessian, empty, out, share, number)
        half = -dtrtrs(factor, gradient[1:-1].ravel(), trans=1)[0]
        decrement = float(half @ half)
        step = dtrtrs(factor, half)[0]
        if not (decrement >= 0.0 and np.isfinite(value)):
            return Minimum(NOT_FINITE, x, empty, hessian, factor, out, share, number)
        is_minimum = share == 1.0 or not is_final
        limit = levels.decrease(level) if is_minimum else _STATIONARY
        if decrement <= limit * value:
            return Minimum(CONVERGED, x, step, hessian, factor, out, share, number + 1)
        length = 1.0
        for halving in range(_HALVINGS):
            trial = x.copy()
            trial[1:-1] += length * step.reshape(-1, n)
            if halving:
                tried = energy.energy(trial)
            else:
                tried, new = energy.derivatives(trial)
            if tried <= value - _ARMIJO * length * decrement + _ROUNDING * value:
                break
            length *= _SHORTER
        else:
            return Minimum(NO_DECREASE, x, empty, hessian, factor, out, share, number + 1)
        x = trial
        value, out = (tried, new) if halving == 0 else energy.derivatives(x)
    return Minimum(MANY_STEPS, x, empty, hessian, empty, out, share, levels.max_steps(level))


def _cholesky(matrix: Array, width: int, shared: int) -> Array | None:
    """U with U' U = matrix, segment by segment, see core/dense.h; None if it is indefinite."""
    factor = np.array(matrix, order="F")
    start, size = 0, len(matrix)
    while start < size:
        stop = min(size, start + width - (shared if start == 0 else 0))
        block, failure = dpotrf(factor[start:stop, start:stop], clean=False)
        if failure:
            return None
        factor[start:stop, start:stop] = block
        columns = slice(stop, stop + shared)
        if stop < size:
            coupling = dtrtrs(block, factor[start:stop, columns], trans=1)[0]
            factor[start:stop, columns] = coupling
            factor[columns, columns] -= coupling.T @ coupling
        start = stop
    return factor


def initial_velocity(
    functions: dict[str, ca.Function],
    energy: DiscreteEnergy,
    found: Minimum,
    x: Array,
    finer: tuple[DiscreteEnergy, Array] | None,
) -> tuple[Array, Array]:
    """v0 (n,) and its derivative by the goal (n, n), see core/logarithm.h.

    Args:
        functions: of the metric.
        energy, found: the minimum; x: the path after its last step.
        finer: energy on the next level, and its interpolation matrix (its nodes, nodes).
    """
    n, size = x.shape[1], x.size
    upper = found.hessian
    fields = dtrtrs(found.factor, dtrtrs(found.factor, upper[:n, n:-n].T, trans=1)[0])[0]
    if finer is not None:
        finer_energy, refine = finer
        gradient = refine.T @ finer_energy.slopes(refine @ x)
    else:
        gradient = energy.gradient(found.derivatives)
        gradient[0] += upper[:n, n:-n] @ found.step
        gradient[1:-1] = 0.0
    momentum = fields.T @ gradient[1:-1].ravel() - gradient[0]
    by_goal = fields.T @ upper[n : size - n, size - n :] - upper[:n, size - n :]
    tensor = functions["metric_tensor"](x[0]).full()
    velocity = np.linalg.solve(tensor, np.column_stack([momentum, by_goal]))
    return velocity[:, 0], velocity[:, 1:]
