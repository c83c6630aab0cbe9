"""First and second derivatives of the least errors of recordings by the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.fitting.metric_program import MetricProgram

_ACTIVE = 1e-6  # distance from a bound that is active


@dataclass(frozen=True, eq=False, repr=False)
class LeastErrors(ShortRepr):
    """Derivatives of e_r(theta), half the least mean squared error of recording r.

    The least error over all paths that are geodesics of the metric with these parameters, in units
    of the deviation; the parameters in units of their initial values.

    Attributes:
        values: (recordings,).
        gradients: (recordings, p).
        hessians: (recordings, p, p).
    """

    values: Array
    gradients: Array
    hessians: Array

    def of_parameters(self, chosen: np.ndarray) -> LeastErrors:
        """The derivatives by some of the parameters, by index."""
        hessians = self.hessians[:, chosen][:, :, chosen]
        return LeastErrors(self.values, self.gradients[:, chosen], hessians)


def least_errors(program: MetricProgram, z: Array, multipliers: Array) -> LeastErrors:
    """The derivatives at a solution, by the implicit function theorem segment by segment.

    Args:
        program: solved with equal weights of all recordings.
        z: its variables at the solution.
        multipliers: of its equations.
    """
    ones = np.ones(len(program.parts))
    functions = program.parts[0].functions
    p, num_x, m = program.size, program.num_x, functions.num_equations
    derivatives = program.program.functions
    jacobian = derivatives["jac_g"](z, ones)[1].sparse().tocsc()
    upper = derivatives["hess_lag"](z, ones, 1.0, multipliers).sparse().tocsc()
    lower_bound, upper_bound = program.bounds
    free = (z > lower_bound + _ACTIVE) & (z < upper_bound - _ACTIVE)
    count = len(program.parts)
    gradients, hessians = np.zeros((count, p)), np.zeros((count, p, p))
    owners = np.repeat(np.arange(count), program.counts)
    for number in range(count):
        own = np.where(np.repeat(owners, m) == number, multipliers, 0.0)
        corner = np.triu(derivatives["hess_lag"](z, ones, 0.0, own)[:p, :p].full())
        hessians[number] = corner + np.triu(corner, 1).T
    jacobian_by_theta = jacobian[:, :p].toarray()
    for segment, owner in enumerate(owners):
        rows = slice(segment * m, (segment + 1) * m)
        columns = (
            p
            + segment * num_x
            + np.flatnonzero(free[p + segment * num_x : p + (segment + 1) * num_x])
        )
        by_theta = jacobian_by_theta[rows]
        of_segment = upper[:, columns]  # columns first: they are stored together
        by_x = jacobian[:, columns][rows].toarray()
        block = of_segment[columns].toarray()
        block = np.triu(block) + np.triu(block, 1).T
        mixed = of_segment[:p].toarray()
        kkt = np.block([[block, by_x.T], [by_x, np.zeros((m, m))]])
        right = np.vstack([mixed.T, by_theta])
        hessians[owner] -= right.T @ np.linalg.lstsq(kkt, right, rcond=1e-13)[0]
        gradients[owner] += by_theta.T @ multipliers[rows]
    return LeastErrors(program.mean_squares(z) / 2.0, gradients, hessians)
