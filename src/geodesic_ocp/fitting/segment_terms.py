"""The terms of one segment in the program of a fit: its errors, and what its prediction fulfils.

What predicts a segment is stationary for a running cost, a weighted sum of

    energy           T = v' G(q) v / 2
    acceleration     |D_t v|^2_G / 2 = tau' G^-1 tau / 2, with tau = d/dt (dT/dv) - dT/dq
    torque change    |tau'|^2 / 2
    jerk             |q'''|^2 / 2

with the fraction s of the duration as time. q(s) is a polynomial, as are two auxiliary functions,
w = D_t v and p = tau' with p = 0 at the ends, with which nothing has to be solved for and no
derivative is higher than in the cost: the integral of

    c_1 T + c_2 (w' tau - w' G w / 2) - c_3 (p'' tau + |p|^2 / 2) + c_4 |q'''|^2 / 2

is stationary with respect to all their coefficients that are not given (weak form, Gauss
quadrature). Geodesics have the energy alone and given configurations at the ends; the progress
along them over time is a cubic of the fraction u of the duration, 0 to 1, whose rates at the ends
are estimated: between 0 and 3 each, it never moves backwards. Other costs have given velocities as
well, and the fraction itself as progress; accelerations at the ends are optimal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Literal

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Terms
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import SegmentBasis
from geodesic_ocp.model.model import Model

Measure = Literal["joint", "position"]
Cost = Literal["energy", "acceleration", "torque change", "jerk"]
_TO_ENDS = Polynomial([0, 1, -1])  # vanishes at both ends


@dataclass(frozen=True, eq=False, repr=False)
class SegmentTerms(ShortRepr):
    """Squared errors of one segment, and the conditions that its prediction is stationary."""

    metric: Metric  # metric with the symbols `theta` as parameters
    theta: ca.SX  # (p, 1)
    model: Model  # model whose hand is compared where the measure is "position"
    measure: Measure  # what is compared with the observation
    degree: int  # degree of the polynomials
    weights: Mapping[Cost, ca.SX | float]  # of the costs, numbers or expressions in theta
    _shown = ("measure", "degree")

    @property
    def dim(self) -> int:
        """Number n of joints."""
        return self.metric.dim

    @property
    def is_geodesic(self) -> bool:
        """Whether the cost is the energy alone."""
        return set(self.weights) == {"energy"}

    @property
    def num_rates(self) -> int:
        """Number of rates of progress that are estimated."""
        return 2 if self.is_geodesic else 0

    @cached_property
    def basis(self) -> SegmentBasis:
        """Polynomials of q, and the quadrature."""
        return SegmentBasis(self.degree - 3, self.degree + 2)

    @cached_property
    def given(self) -> list[int]:
        """Indices of the polynomials of q whose coefficients are observed."""
        return [0, 2] if self.is_geodesic else [0, 1, 2, 3]

    @cached_property
    def functions(self) -> dict[str, tuple[list[Polynomial], int]]:
        """Polynomials of q, w and p, and the highest derivative of each in the cost."""
        legendre = [Legendre.basis(k, [0, 1]).convert(kind=Polynomial) for k in range(self.degree)]
        order = 3 if "jerk" in self.weights else 1 if self.is_geodesic else 2
        found = {"q": (self.basis.polynomials, order)}
        if "acceleration" in self.weights:
            found["w"] = (legendre[:-1], 0)
        if "torque change" in self.weights:
            found["p"] = ([_TO_ENDS * each for each in legendre[:-3]], 1)
        return found

    @cached_property
    def num_nodes(self) -> int:
        """Number of coefficients of all functions, for each joint."""
        return sum(len(polynomials) for polynomials, _ in self.functions.values())

    @property
    def num_x(self) -> int:
        """Number of variables: coefficients (num_nodes, n), and rates of progress."""
        return self.dim * self.num_nodes + self.num_rates

    @property
    def num_equations(self) -> int:
        """Number of equations, one for each coefficient that is not given."""
        return self.dim * (self.num_nodes - len(self.given))

    @cached_property
    def table(self) -> Array:
        """Derivatives of the functions at the points by coefficients, (points, r, nodes)."""
        s = self.basis.rule[0]
        rows = []
        first = 0
        for polynomials, order in self.functions.values():
            values = np.zeros((order + 1, s.size, self.num_nodes))
            for k, each in enumerate(polynomials, first):
                values[:, :, k] = [each.deriv(d)(s) if d else each(s) for d in range(order + 1)]
            rows.append(values)
            first += len(polynomials)
        return np.concatenate(rows).swapaxes(0, 1)

    @cached_property
    def sums(self) -> scipy.sparse.sparray:
        """Matrix from the derivatives of the cost at all points to those of its integral."""
        tests = np.delete(np.arange(self.num_nodes), self.given)
        weighted = self.basis.rule[1][:, None, None] * self.table[:, :, tests]
        matrix = weighted.reshape(-1, tests.size).T
        return scipy.sparse.csr_array(scipy.sparse.kron(matrix, scipy.sparse.eye_array(self.dim)))

    @cached_property
    def derivatives(self) -> Terms:
        """Derivatives of the cost by the functions and their derivatives, over scales.

        Parameters are the scales (n,) and units of the costs. Equations of w and p have no weights.
        """
        counts = {name: order + 1 for name, (_, order) in self.functions.items()}
        symbols = {
            name: [ca.SX.sym(name, self.dim) for _ in range(count)]
            for name, count in counts.items()
        }
        state = symbols["q"]
        scales = ca.SX.sym("scales", self.dim)
        units = [ca.SX.sym("unit") for _ in self.weights]
        pairs = zip(self.weights.items(), units, strict=True)
        factors = {name: weight * unit for (name, weight), unit in pairs}
        q, v, *higher = state
        energy = self.metric._energy(q, v)
        momentum = ca.gradient(energy, v)
        total = ca.SX(0)
        own = []
        if "energy" in factors:
            total += factors["energy"] * energy
        if higher:
            torque = ca.jtimes(momentum, v, higher[0]) + ca.jtimes(momentum, q, v)
            torque -= ca.gradient(energy, q)
        if "acceleration" in factors:
            (w,) = symbols["w"]
            total += factors["acceleration"] * (ca.dot(w, torque) - ca.substitute(energy, v, w))
            own.append(torque - ca.substitute(momentum, v, w))
        if "torque change" in factors:
            p, slope = symbols["p"]
            total -= factors["torque change"] * ca.dot(slope, torque)
            own += [p, torque]
        if "jerk" in factors:
            total += factors["jerk"] * ca.sumsqr(state[3]) / 2
        found = [*(ca.gradient(total, each) for each in state), *own]
        z = ca.vertcat(*chain(*symbols.values()), self.theta)
        over = ca.vertcat(*(ca.densify(each) / scales for each in found))
        return Terms(z, ca.vertcat(scales, *units), constraints=ca.cse(over))

    @cached_property
    def sample(self) -> Terms:
        """Half the squared error at a sample, in the coefficients of q and the rates of progress.

        Parameters are the fraction u and the observation: a configuration, or the hand's position.
        """
        size = self.dim * len(self.basis.polynomials)
        x = ca.SX.sym("x", size + self.num_rates)
        u = ca.SX.sym("u")
        progress = u
        if self.is_geodesic:
            start = x[size]
            end = x[size + 1]
            progress = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        values = [ca.polyval(each.coef[::-1], progress) for each in self.basis.polynomials]
        q = ca.reshape(x[:size], self.dim, len(values)) @ ca.vertcat(*values)
        predicted = q if self.measure == "joint" else self.model.hand_pose(q)[1]
        observed = ca.SX.sym("y", predicted.shape[0])
        return Terms(x, ca.vertcat(u, observed), ca.sumsqr(predicted - observed) / 2)

    def coefficients(self, metric: Metric, q: Array, ends: Array) -> Array:
        """Return coefficients (num_nodes, n) of a motion and of its w and p.

        Args:
            metric: with numbers as parameters.
            q: (points, n) at the points of the quadrature.
            ends: coefficients that are given.
        """
        result = np.zeros((self.num_nodes, self.dim))
        result[self.given] = ends
        count = len(self.basis.polynomials)
        rest = np.delete(np.arange(count), self.given)
        result[rest] = np.linalg.lstsq(
            self.table[:, 0, rest], q - self.table[:, 0, :count] @ result[:count]
        )[0]
        if self.is_geodesic:
            return result
        q, v, a = self.table[:, :3].swapaxes(0, 1) @ result
        w = np.array([c - metric.acceleration(x, u) for x, u, c in zip(q, v, a, strict=True)])
        torque = np.array([metric.matrix(x) @ u for x, u in zip(q, w, strict=True)])
        s = self.basis.rule[0]
        first = count
        if "w" in self.functions:
            last = first + len(self.functions["w"][0])
            row = self.functions["q"][1] + 1  # after q and its derivatives
            result[first:last] = np.linalg.lstsq(self.table[:, row, first:last], w)[0]
            first = last
        if "p" in self.functions:
            slopes = [
                Legendre.fit(s, each, self.degree - 2, [0, 1]).deriv()(s) for each in torque.T
            ]
            result[first:] = np.linalg.lstsq(self.table[:, -2, first:], np.transpose(slopes))[0]
        return result
