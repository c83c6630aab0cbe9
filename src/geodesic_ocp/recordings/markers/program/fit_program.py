"""The nonlinear program of a motion that fits markers.

Variables: root and joints of every frame, and what is common to all frames: lengths and offsets of
markers. Objective, divided by the duration:

    integral of sum_m rho(|r_m| / noise) + sum_i (q_i'' / a_i)^2 + (q_i''' / j_i)^2 dt, and priors

with the markers' residuals r_m and the loss rho(u) = c^2 u^2 / (c^2 + u^2) of Geman and McClure
(Bulletin of the International Statistical Institute 52, 1987), in which a marker that is far away
loses its weight, rho'(u) / 2u = 1 / (1 + u^2 / c^2)^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.ipopt import Outcome

_IPOPT = {"max_iter": 200, "mu_strategy": "monotone", "acceptable_iter": 0}
# How rounding limits the tolerance, relative to the largest curvature of the objective.
_ROUNDING = 1e-14
# Of the barrier, summed over all variables with bounds: at first, and complementarity at the end.
# Together the barriers of all frames pull at lengths and offsets.
_BARRIER, _COMPLEMENTARITY = 1e-2, 1e-2


@dataclass(frozen=True, eq=False)
class FrameTerms:
    """Predicted positions of markers in one frame.

    Attributes:
        z: root and joints of the frame, symbols (nz, 1).
        shared: what is common to all frames, symbols (ns, 1).
        points: positions of the markers (3, m) [m].
    """

    z: ca.SX
    shared: ca.SX
    points: ca.SX

    @cached_property
    def positions(self) -> ca.Function:
        """(z, shared) -> positions (3, m)."""
        return ca.Function("positions", [self.z, self.shared], [ca.cse(ca.densify(self.points))])

    @cached_property
    def slopes(self) -> ca.Function:
        """(z, shared) -> positions (3 m, 1) and their derivatives by z (3 m, nz)."""
        stacked = ca.vec(self.points)
        outputs = [stacked, ca.densify(ca.jacobian(stacked, self.z))]
        return ca.Function("slopes", [self.z, self.shared], [ca.cse(each) for each in outputs])

    @cached_property
    def loss(self) -> Terms:
        """The loss of a frame.

        Parameters are the observed positions (3 m), weights (m) and the outlier size.
        """
        count = self.points.shape[1]
        observed, weights = ca.SX.sym("y", 3 * count), ca.SX.sym("w", count)
        outlier = ca.SX.sym("c")
        residuals = self.points - ca.reshape(observed, 3, count)
        squares = ca.sum1(residuals**2).T
        loss = ca.dot(weights, squares / (1 + squares / outlier**2)) / 2
        numbers = ca.vertcat(observed, weights, outlier)
        return Terms(ca.vertcat(self.z, self.shared), numbers, loss)


@dataclass(frozen=True, eq=False)
class FitProgram:
    """The program for the observations of K frames.

    Attributes:
        terms: of one frame.
        observed: positions (K, m, 3) [m], any number where the weight is zero.
        weights: of the squared residuals in the objective (K, m) [1/m^2].
        quadratic: of the rest of the objective, x' Q x / 2 - b' x: Q and b, over the variables
            of all frames in order, and then the shared ones.
        lower, upper: bounds of the variables.
    """

    terms: FrameTerms
    observed: Array
    weights: Array
    quadratic: tuple[scipy.sparse.csc_matrix, Array]
    lower: Array
    upper: Array

    def solve(
        self, x: Array, outlier: float, tolerance: float, options: dict[str, Any] | None = None
    ) -> Outcome:
        """The solution from x, where a marker `outlier` [m] away keeps a quarter of its weight."""
        stiffest = float(abs(self.quadratic[0]).max())
        bounded = max(1, int(np.isfinite(self.lower).sum() + np.isfinite(self.upper).sum()))
        own = {
            "tol": max(tolerance, _ROUNDING * stiffest),
            "compl_inf_tol": _COMPLEMENTARITY / bounded,
            "mu_init": _BARRIER / bounded,
        }
        solver = self.program.solver({**_IPOPT, **own, **(options or {})})
        start = np.clip(x, self.lower, self.upper)
        return solver(x0=start, p=outlier, lbx=self.lower, ubx=self.upper)

    @cached_property
    def program(self) -> BlockProgram:
        """The frames' losses and the rest; the outlier size is its parameter."""
        frames, nz, outlier = len(self.observed), int(self.terms.z.numel()), ca.MX.sym("c")
        shared = np.arange(frames * nz, self.lower.size)
        own = np.arange(frames * nz).reshape(frames, nz)
        places = np.hstack([own, np.tile(shared, (frames, 1))])
        numbers = np.hstack([self.observed.reshape(frames, -1), self.weights])
        values = ca.horzcat(ca.DM(numbers), ca.repmat(outlier, frames, 1))
        block = Block(self.terms.loss, places, values)
        return BlockProgram(self.lower.size, [block], outlier, self.quadratic)
