"""All synergies of a motion as one nonlinear program.

Minimized is the action of all paths, sum_k (energy of path k) / (its duration), which is the
integral of the kinetic energy at constant speeds, plus the time that the joints' speed limits add,
plus terms of posture and likeness (`Terms`). Variables are the positions at the nodes of all paths,
so that the configurations where they meet are shared, and the relative time added to each interval
between two instants at which a movement of any arm begins or ends. The hand's poses at the
waypoints are equalities, or squared errors where they are out of reach; joint limits are bounds;
mean speeds within limits are linear inequalities. Distances that are too small enter as
inequalities with slack variables, whose sum has a large weight (an exact penalty; Fletcher 1987),
as the pose at a waypoint may not allow them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.ipopt import Ipopt, Outcome
from geodesic_ocp.retargeting.program.arm_part import ArmPart
from geodesic_ocp.retargeting.program.distances.distance_rows import DistanceRows
from geodesic_ocp.retargeting.program.sparse import Index, blocks_on_diagonal, placed
from geodesic_ocp.retargeting.program.terms import Terms

_IPOPT: Mapping[str, Any] = {
    "tol": 1e-7,
    "gamma_theta": 0.9,
    "max_soc": 0,
    "mu_init": 1e-2,
    "max_iter": 1000,
}
_TOO_NEAR = 300.0  # weight of a distance below its bound [1/m]
_NEAR: Mapping[str, Any] = {
    **_IPOPT,
    **{"mu_init": 1e-5, "bound_push": 1e-7, "bound_frac": 1e-7},
    **{"slack_bound_push": 1e-7, "slack_bound_frac": 1e-7, "bound_mult_init_method": "mu-based"},
}


@dataclass(frozen=True, eq=False)
class MotionProgram:
    """The program of all arms.

    Attributes:
        parts: of the arms.
        edges: times (i + 1,) [s] in the recording between which time may be added.
        terms: of the objective.
        distances: kept above their bounds; None: none.
    """

    parts: Sequence[ArmPart]
    edges: Array
    terms: Terms
    distances: DistanceRows | None = None

    @property
    def offsets(self) -> list[int]:
        """Where the variables of each arm begin, and those of the added times."""
        return [sum(part.size for part in self.parts[:k]) for k in range(len(self.parts) + 1)]

    @property
    def size(self) -> int:
        """Number of variables: nodes, added times, slack of the distances."""
        return self.size_of_paths + (0 if self.distances is None else len(self.distances.index))

    @property
    def size_of_paths(self) -> int:
        """Number of variables without the slack."""
        return self.offsets[-1] + len(self.edges) - 1

    def shares(self, part: ArmPart) -> list[Array]:
        """For each movement of an arm, the share of each interval in its duration."""
        given, steps = part.waypoints, np.diff(self.edges)
        found = []
        for begin, end in zip(given.begins, given.ends, strict=True):
            inside = (self.edges[:-1] >= begin - 1e-9) & (self.edges[1:] <= end + 1e-9)
            found.append(np.where(inside, steps, 0.0) / (end - begin))
        return found

    @cached_property
    def _speed_rows(self) -> tuple[ca.DM, ca.DM]:
        """A and B of all arms; see `ArmPart.speed_rows`."""
        found = [part.speed_rows(self.shares(part)) for part in self.parts]
        return ca.diagcat(*(each for each, _ in found)), ca.vertcat(*(each for _, each in found))

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """The program and its exact derivatives, as nlpsol takes them."""
        x, p, lam_f = ca.MX.sym("x", self.size), ca.MX.sym("p", 0), ca.MX.sym("lam_f")
        value, f, gradient = self._objective(x)
        g, jacobian = self._constraints(x)
        lam_g = ca.MX.sym("lam_g", g.shape[0])
        hessian = self._hessian(x, lam_f, lam_g)
        names = ["x", "p"]
        return {
            "nlp": ca.Function("nlp", [x, p], [value, g], names, ["f", "g"]),
            "grad_f": ca.Function("nlp_grad_f", [x, p], [f, gradient], names, ["f", "grad_f_x"]),
            "jac_g": ca.Function("nlp_jac_g", [x, p], [g, jacobian], names, ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, lam_f, lam_g],
                [hessian],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }

    def _at_waypoints(self, number: int, x: ca.MX) -> tuple[Index, ca.MX]:
        """Where an arm's configurations at the waypoints begin in x, and they (n, m + 1)."""
        part = self.parts[number]
        starts = self.offsets[number] + part.dof * np.array(part.waypoint_nodes)
        index = (starts[:, None] + np.arange(part.dof)).ravel()
        return starts, ca.reshape(x[index.tolist()], part.dof, starts.size)

    def _objective(self, x: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """The objective as CasADi can differentiate it, the same by other means, its gradient."""
        longer = ca.DM(self.terms.stretch * np.diff(self.edges) / self.terms.duration)
        slack = np.full(self.size - self.size_of_paths, _TOO_NEAR)
        longer = ca.vertcat(longer, slack)
        added = ca.dot(longer, x[self.offsets[-1] :])
        value, f, slopes, at_waypoints = added, added, [], ca.MX(self.size, 1)
        for number, (part, first) in enumerate(zip(self.parts, self.offsets[:-1], strict=True)):
            own, p = x[first : first + part.size], part.energy_parameters(self.terms.action)
            action, slope = part.transcription.objective(own, p)
            starts, q = self._at_waypoints(number, x)
            _, _, costs, by_q = part.functions.first.map(starts.size)(
                q, part.waypoint_parameters(self.terms)
            )
            mean = ca.sum2(costs) / starts.size
            f, value = f + action + mean, value + part.transcription.value(own, p) + mean
            slopes.append(slope)
            rows = (starts[:, None] + np.arange(part.dof)).ravel()
            entries = ca.vec(by_q) / starts.size
            at_waypoints += placed((self.size, 1), rows, np.zeros_like(rows), entries)
        return value, f, ca.densify(ca.vertcat(*slopes, longer) + at_waypoints)

    def _constraints(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Pose errors, mean speeds, distances; and their Jacobian."""
        values, slopes = [], []
        for number, part in enumerate(self.parts):
            starts, q = self._at_waypoints(number, x)
            errors, jacobians, _, _ = part.functions.first.map(starts.size)(
                q, part.waypoint_parameters(self.terms)
            )
            values.append(ca.vec(errors))
            count, n = errors.shape[0], part.dof
            column, row = (each.ravel() for each in np.indices((n, count)))
            rows = (count * np.arange(starts.size)[:, None] + row).ravel()
            columns = (starts[:, None] + column).ravel()
            shape = count * starts.size, self.size
            slopes.append(placed(shape, rows, columns, ca.vec(jacobians)))
        by_nodes, by_time = self._speed_rows
        slack = self.size - self.size_of_paths
        both = ca.horzcat(by_nodes, -by_time, ca.DM(by_nodes.shape[0], slack))
        values.append(both @ x)
        slopes.append(ca.MX(both))
        if self.distances is not None:
            distances, jacobian = self.distances.values(x)
            values.append(distances + x[self.size_of_paths :])
            units = ca.horzcat(ca.DM(slack, self.size_of_paths), ca.DM.eye(slack))
            slopes.append(jacobian + units)
        return ca.vertcat(*values), ca.vertcat(*slopes)

    def _hessian(self, x: ca.MX, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        """Upper triangle of the Hessian of the Lagrangian."""
        shape, used, of_paths = (self.size, self.size), 0, []
        total = ca.MX(*shape)
        for number, (part, first) in enumerate(zip(self.parts, self.offsets[:-1], strict=True)):
            own, p = x[first : first + part.size], part.energy_parameters(self.terms.action)
            of_paths.append(part.transcription.hessian(own, p, lam_f, ca.MX(0, 1)))
            starts, q = self._at_waypoints(number, x)
            count, rows = starts.size, len(part.waypoints.rows)
            factors = ca.reshape(lam_g[used : used + rows * count], rows, count)
            used += rows * count
            parameters = part.waypoint_parameters(self.terms)
            factor = ca.repmat(lam_f / count, 1, count)
            blocks = part.functions.second.map(count)(q, parameters, factors, factor)
            blocks = ca.reshape(blocks, part.dof**2, count)
            total += blocks_on_diagonal(shape, starts, part.dof, blocks)
        added = self.size - self.offsets[-1]
        total += ca.diagcat(*of_paths, ca.MX(added, added))
        if self.distances is not None:
            factors = lam_g[used + self._speed_rows[0].shape[0] :]
            total += ca.triu(self.distances.hessian(x, factors))
        return total

    def bounds(self) -> dict[str, Array]:
        """Of the variables and of the constraints."""
        low, high = zip(*(part.bounds() for part in self.parts), strict=True)
        count = self.size - self.offsets[-1]
        lower, upper = [], []
        for part in self.parts:
            rows, given = len(part.waypoints.rows), part.waypoints
            for number, within in enumerate(part.within_reach):
                free = not within or (number == 0 and given.start is not None)
                lower += [-np.inf if free else 0.0] * rows
                upper += [np.inf if free else 0.0] * rows
        speeds = self._speed_rows[0].shape[0]
        least = np.zeros(0) if self.distances is None else self.distances.lower
        return {
            "lbx": np.concatenate([*(each.ravel() for each in low), np.zeros(count)]),
            "ubx": np.concatenate([*(each.ravel() for each in high), np.full(count, np.inf)]),
            "lbg": np.concatenate([lower, np.full(speeds, -np.inf), least]),
            "ubg": np.concatenate([upper, np.ones(speeds), np.full(least.size, np.inf)]),
        }

    def guess(self, nodes: Sequence[Array], sigma: Array | None = None) -> Array:
        """Variables of positions at the nodes of each arm, with enough time for their speeds."""
        x = np.concatenate([each.ravel() for each in nodes])
        if sigma is None:
            by_nodes, by_time = self._speed_rows
            needed = (by_nodes @ x).full()[:, 0] - 1.0
            shares, count = by_time.full(), len(self.edges) - 1
            sigma = np.zeros(count)
            if needed.size:
                late = np.where(shares > 0.0, np.maximum(needed, 0.0)[:, None], 0.0)
                sigma = late.max(axis=0, initial=0.0)
        slack = np.zeros(self.size - self.size_of_paths)
        if self.distances is not None:
            slack = self.distances.missing(np.concatenate([x, sigma, slack]))
        return np.concatenate([x, sigma, slack])

    def solve(self, start: Array, near: bool = False) -> Outcome:
        """Ipopt's result from a start; `near` tells that it is nearly a solution."""
        derivatives = {name: self.functions[name] for name in ("grad_f", "jac_g", "hess_lag")}
        solver = Ipopt(self.functions["nlp"], derivatives, _NEAR if near else _IPOPT)
        return solver(x0=start, **self.bounds())

    def split(self, x: Array) -> tuple[list[Array], Array]:
        """Positions at the nodes of each arm (size, n), and the relative times added."""
        offsets = self.offsets
        nodes = [
            x[first : first + part.size].reshape(-1, part.dof)
            for part, first in zip(self.parts, offsets[:-1], strict=True)
        ]
        return nodes, np.maximum(x[offsets[-1] : self.size_of_paths], 0.0)
