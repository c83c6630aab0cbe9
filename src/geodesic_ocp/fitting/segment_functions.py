"""Terms of one segment of which the nonlinear program of a fit is made.

A path is a polynomial through its values at Gauss-Lobatto nodes. It is a geodesic where the
Euler-Lagrange equation of its energy holds at the inner nodes (orthogonal collocation),

    d/ds (dT/dv) - dT/dq = 0,  T = v' G(q) v / 2.

The progress along it over time is a cubic of the fraction u of the duration, 0 to 1, whose rates at
the ends are estimated: between 0 and 3 each, it never moves backwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, cast, get_args

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Terms
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.grid import Grid

Measure = Literal["joint", "position"]


def as_measure(measure: str) -> Measure:
    """The argument, if it is one of the measures; ValueError otherwise."""
    if measure not in get_args(Measure):
        raise ValueError(f"measure must be one of {', '.join(get_args(Measure))}, got {measure!r}")
    return cast(Measure, measure)


@dataclass(frozen=True, eq=False, repr=False)
class SegmentFunctions(ShortRepr):
    """Squared errors and geodesic equations of one segment.

    Attributes:
        metric: with the symbols `theta` as parameters.
        theta: (p, 1).
        model: whose hand is compared where the measure is "position".
        measure: what is compared with the observation.
        grid: of the nodes.
    """

    metric: Metric
    theta: ca.SX
    model: Model
    measure: Measure
    grid: Grid
    _shown = ("measure", "grid")

    @property
    def dim(self) -> int:
        """Number n of joints."""
        return self.metric.dim

    @property
    def num_nodes(self) -> int:
        """Number of values of a path, n (degree + 1)."""
        return self.dim * self.grid.size

    @property
    def num_equations(self) -> int:
        """Number of equations of a path, n (degree - 1)."""
        return self.dim * (self.grid.size - 2)

    @cached_property
    def rows_at_nodes(self) -> Array:
        """Values and first two derivatives by s at the inner nodes (degree - 1, 3, nodes)."""
        slopes = self.grid.differentiation[0]
        every = np.stack([np.eye(self.grid.size), slopes, slopes @ slopes], axis=1)
        return np.asarray(every[1:-1])

    @cached_property
    def equation(self) -> Terms:
        """The Euler-Lagrange equation's left side over scales (n,), in (q, v, a) and theta."""
        q, v, a, scales = (ca.SX.sym(name, self.dim) for name in ("q", "v", "a", "scales"))
        energy = self.metric._energy(q, v)
        momentum = ca.gradient(energy, v)
        force = ca.jtimes(momentum, v, a) + ca.jtimes(momentum, q, v) - ca.gradient(energy, q)
        state = ca.vertcat(q, v, a, self.theta)
        return Terms(state, scales, constraints=ca.cse(ca.densify(force)) / scales)

    @cached_property
    def sample(self) -> Terms:
        """Half the squared error at a sample, in the path's values and the rates at its ends.

        Parameters are the fraction u and the observation: a configuration, or the hand's position.
        """
        n = self.dim
        x, u = ca.SX.sym("x", self.num_nodes + 2), ca.SX.sym("u")
        start, end = x[self.num_nodes], x[self.num_nodes + 1]
        progress = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        q = ca.reshape(x[: self.num_nodes], n, self.grid.size) @ self._interpolation(progress)
        predicted = q if self.measure == "joint" else self.model.hand_pose(q)[1]
        observed = ca.SX.sym("y", predicted.shape[0])
        return Terms(x, ca.vertcat(u, observed), ca.sumsqr(predicted - observed) / 2)

    def _interpolation(self, s: ca.SX) -> ca.SX:
        """Values (nodes, 1) at s of the Lagrange polynomials of the nodes."""
        degree, z = self.grid.degree, 2 * s - 1
        inverse = np.linalg.inv(legendre.legvander(2.0 * self.grid.nodes - 1.0, degree))
        values = [ca.SX(1), z]
        for k in range(1, degree):  # the recurrence of Legendre's polynomials
            values.append(((2 * k + 1) * z * values[k] - k * values[k - 1]) / (k + 1))
        return ca.SX(inverse.T) @ ca.vertcat(*values)
