"""The nonlinear program of a motion that fits markers.

Variables: root and joints of every frame, and what is common to all frames: lengths and offsets of
markers. Objective, divided by the duration:

    integral of sum_m rho(|r_m| / noise) + sum_i (q_i'' / a_i)^2 + (q_i''' / j_i)^2 dt, and priors

with the markers' residuals r_m and the loss rho(u) = c^2 u^2 / (c^2 + u^2) of Geman and McClure
(Bulletin of the International Statistical Institute 52, 1987), in which a marker that is far away
loses its weight, rho'(u) / 2u = 1 / (1 + u^2 / c^2)^2. First and second derivatives are exact:
those of one frame are generated once, and mapped over the frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import as_dm
from geodesic_ocp.ipopt import Ipopt, Outcome

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
    def loss(self) -> tuple[ca.Function, ca.Function, ca.Function, ca.Sparsity]:
        """Value, gradient and upper triangle of the Hessian's entries of a frame's loss.

        Functions of z, shared, the observed positions (3 m), weights (m) and the outlier size.
        """
        count = self.points.shape[1]
        observed, weights = ca.SX.sym("y", 3 * count), ca.SX.sym("w", count)
        outlier = ca.SX.sym("c")
        residuals = self.points - ca.reshape(observed, 3, count)
        squares = ca.sum1(residuals**2).T
        loss = ca.dot(weights, squares / (1 + squares / outlier**2)) / 2
        inputs = [self.z, self.shared, observed, weights, outlier]
        variables = ca.vertcat(self.z, self.shared)
        hessian, gradient = ca.hessian(loss, variables)
        upper = ca.triu(hessian)
        value = ca.Function("loss", inputs, [ca.cse(loss)])
        slope = ca.Function("slope", inputs, [ca.cse(loss), ca.cse(ca.densify(gradient))])
        curvature = ca.Function("curvature", inputs, [ca.cse(ca.densify(upper.nz[:]))])
        return value, slope, curvature, upper.sparsity()


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
        functions = self._functions
        derivatives = {name: functions[name] for name in ("grad_f", "hess_lag")}
        stiffest = float(abs(self.quadratic[0]).max())
        bounded = max(1, int(np.isfinite(self.lower).sum() + np.isfinite(self.upper).sum()))
        own = {
            "tol": max(tolerance, _ROUNDING * stiffest),
            "compl_inf_tol": _COMPLEMENTARITY / bounded,
            "mu_init": _BARRIER / bounded,
        }
        chosen = {**_IPOPT, **own, **(options or {})}
        solver = Ipopt(functions["nlp"], derivatives, chosen)
        start = np.clip(x, self.lower, self.upper)
        return solver(x0=start, p=outlier, lbx=self.lower, ubx=self.upper)

    @cached_property
    def _functions(self) -> dict[str, ca.Function]:
        frames, nz = len(self.observed), int(self.terms.z.numel())
        ns = int(self.terms.shared.numel())
        value, slope, curvature, pattern = self.terms.loss
        x, p, lam = ca.MX.sym("x", frames * nz + ns), ca.MX.sym("p"), ca.MX.sym("lam_f")
        inputs: list[Any] = [
            ca.reshape(x[: frames * nz], nz, frames),
            ca.repmat(x[frames * nz :], 1, frames),
            ca.DM(self.observed.reshape(frames, -1).T),
            ca.DM(self.weights.T),
            ca.repmat(p, 1, frames),
        ]
        matrix, linear = self.quadratic
        q_matrix, b = as_dm(matrix), ca.DM(linear)
        bent = q_matrix @ x
        smooth = ca.dot(x, bent) / 2 - ca.dot(b, x)
        f = ca.sum2(value.map(frames).call(inputs)[0]) + smooth
        own, slopes = slope.map(frames).call(inputs)
        gradient = ca.vertcat(ca.vec(slopes[:nz, :]), ca.sum2(slopes[nz:, :])) + bent - b
        names = ["x", "p"]
        hessian = self._hessian(curvature.map(frames).call(inputs)[0], pattern, lam)
        empty = ca.MX(0, 1)
        return {
            "nlp": ca.Function("nlp", [x, p], [f, empty], names, ["f", "g"]),
            "grad_f": ca.Function(
                "nlp_grad_f",
                [x, p],
                [ca.sum2(own) + smooth, gradient],
                names,
                ["f", "grad_f_x"],
            ),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, lam, ca.MX.sym("lam_g", 0)],
                [hessian],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }

    def _hessian(self, entries: ca.MX, pattern: ca.Sparsity, lam: ca.MX) -> ca.MX:
        """Upper triangle of the Hessian from the entries of the frames (nnz, K)."""
        frames, nz = len(self.observed), int(self.terms.z.numel())
        size = self.lower.size
        rows, columns = (np.array(each) for each in pattern.get_triplet())
        of_frame = nz * np.arange(frames)[:, None]
        shared = frames * nz - nz

        def places(index: Any) -> Any:
            return np.where(index < nz, of_frame + index, shared + index).ravel()

        upper = scipy.sparse.triu(self.quadratic[0]).tocoo()
        all_rows = np.concatenate([places(rows), upper.row])
        all_columns = np.concatenate([places(columns), upper.col])
        keys, inverse = np.unique(
            all_columns.astype(np.int64) * size + all_rows, return_inverse=True
        )
        sparsity = ca.Sparsity.triplet(size, size, (keys % size).tolist(), (keys // size).tolist())
        count = rows.size * frames
        adder = scipy.sparse.csc_matrix(
            (np.ones(count), (inverse.ravel()[:count], np.arange(count))), (keys.size, count)
        )
        constant = np.bincount(inverse.ravel()[count:], upper.data, keys.size)
        total = as_dm(adder) @ ca.vec(entries) + ca.DM(constant)
        return ca.MX(sparsity, ca.densify(lam * total))
