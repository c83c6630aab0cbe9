"""Logarithmic maps as a first-time user of CasADi would find them: MX collocation and Ipopt.

After the example direct_collocation.py that comes with CasADi: Legendre points of degree 3 on
intervals of one length, the kinetic energy as the objective, the straight line as the guess.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

import geodesic_ocp as go


class PlainCollocation:
    """A nonlinear program that is built and solved for each pair."""

    def __init__(self, model: go.Model, intervals: int = 20, degree: int = 3) -> None:
        q, v = ca.SX.sym("q", model.dof), ca.SX.sym("v", model.dof)
        energy = ca.dot(v, ca.mtimes(model.mass_matrix(q), v)) / 2.0
        self._energy = ca.Function("energy", [q, v], [energy])
        self._intervals, self._degree, self._dof = intervals, degree, model.dof

    def __call__(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray | None:
        """Initial velocity, the slope of the first polynomial; None if Ipopt fails."""
        points = ca.collocation_points(self._degree, "legendre")
        slopes, ends, weights = ca.collocation_coeff(points)
        grid = np.linspace(0.0, 1.0, self._intervals + 1)
        unknowns, guess, conditions = [], [], []
        total, previous, first = ca.MX(0), ca.MX(q0), None
        for start, stop in pairwise(grid):
            h, inner = stop - start, [ca.MX.sym("q", self._dof) for _ in points]
            unknowns += inner
            guess += [q0 + (start + h * point) * (q1 - q0) for point in points]
            nodes = ca.horzcat(previous, *inner)
            velocities = ca.mtimes(nodes, slopes) / h
            for j in range(self._degree):
                total += h * weights[j] * self._energy(inner[j], velocities[:, j])
            first = (nodes, h) if first is None else first
            end = ca.mtimes(nodes, ends)
            if stop == grid[-1]:
                conditions.append(end - q1)
            else:
                previous = ca.MX.sym("q", self._dof)
                unknowns.append(previous)
                guess.append(q0 + stop * (q1 - q0))
                conditions.append(end - previous)
        program = {"x": ca.vertcat(*unknowns), "f": total, "g": ca.vertcat(*conditions)}
        options = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
        solver = ca.nlpsol("solver", "ipopt", program, options)
        result = solver(x0=np.concatenate(guess), lbg=0.0, ubg=0.0)
        if not solver.stats()["success"]:
            return None
        nodes = ca.Function("nodes", [program["x"]], [first[0]])(result["x"]).full()
        times = np.array([0.0, *points])
        return (
            np.array([np.polyder(np.polyfit(times, row, self._degree))[-1] for row in nodes])
            / (first[1])
        )
