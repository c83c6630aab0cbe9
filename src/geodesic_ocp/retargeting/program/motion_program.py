"""All synergies of a motion as one nonlinear program.

Minimized is the action of all paths, sum_k (energy of path k) / (its duration), which is the
integral of the kinetic energy at constant speeds, plus the time that the joints' speed limits add,
plus terms of posture and likeness (`ObjectiveWeights`). Variables are the positions at the nodes of
all paths, so that the configurations where they meet are shared, and the relative time added to
each interval between two instants at which a movement of any arm begins or ends. The hand's poses
at the waypoints are equalities, or squared errors where they are out of reach; joint limits are
bounds; mean speeds within limits are linear inequalities. Distances that are too small enter as
inequalities with slack variables, whose sum has a large weight (an exact penalty; Fletcher 1987),
as the pose at a waypoint may not allow them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.retargeting.program.arm_part import ArmPart
from geodesic_ocp.retargeting.program.distances.instants import place_at
from geodesic_ocp.retargeting.program.terms import ObjectiveWeights

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
        weights: of the objective.
        clearance: distances of links; None: none.
        rows: lower bounds [m] of those distances that are kept, by their number in the clearance
            and the time [s] in the recording.
    """

    parts: Sequence[ArmPart]
    edges: Array
    weights: ObjectiveWeights
    clearance: Clearance | None = None
    rows: Mapping[tuple[int, float], float] = field(default_factory=dict)

    @cached_property
    def offsets(self) -> list[int]:
        """Where the variables of each arm begin, those of the added times, and the slack."""
        sizes = [*(part.size for part in self.parts), len(self.edges) - 1]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def size(self) -> int:
        """Number of variables: nodes, added times, slack of the distances."""
        return self.offsets[-1] + len(self.rows)

    @cached_property
    def _speed_rows(self) -> tuple[scipy.sparse.csr_array, Array]:
        """A (rows, nodes of all arms) and B (rows, intervals): A x <= 1 + B sigma."""
        steps, found = np.diff(self.edges), []
        for part in self.parts:
            given, shares = part.waypoints, []
            for begin, end in zip(given.begins, given.ends, strict=True):
                inside = (self.edges[:-1] >= begin - 1e-9) & (self.edges[1:] <= end + 1e-9)
                shares.append(np.where(inside, steps, 0.0) / (end - begin))
            found.append(part.speed_rows(shares))
        by_nodes = scipy.sparse.block_diag([each for each, _ in found], format="csr")
        return by_nodes, np.vstack([each for _, each in found])

    @cached_property
    def program(self) -> BlockProgram:
        """The blocks of all terms."""
        blocks = []
        for part, first in zip(self.parts, self.offsets, strict=False):
            blocks += part.transcription.blocks(part.energy_parameters(self.weights.action), first)
            blocks.append(part.waypoint_block(first, self.weights))
        cost = self.weights.stretch * np.diff(self.edges) / self.weights.duration
        added = np.concatenate([cost, np.full(len(self.rows), _TOO_NEAR)])
        at = np.arange(self.offsets[-2], self.size)
        blocks.append(Block(_linear(), at[:, None], added[:, None]))
        by_nodes, by_time = self._speed_rows
        if rows := by_nodes.shape[0]:
            slack = scipy.sparse.csr_array((rows, len(self.rows)))
            both = scipy.sparse.hstack([by_nodes, -by_time, slack], format="csr")
            lower, upper = np.full((rows, 1), -np.inf), np.ones((rows, 1))
            blocks.append(Block(_identity(), both, None, lower, upper))
        return BlockProgram(self.size, blocks + self._distances())

    def _distances(self) -> list[Block]:
        blocks, order = [], sorted(self.rows)
        for number in dict.fromkeys(number for number, _ in order):
            assert self.clearance is not None
            here = [k for k, (other, _) in enumerate(order) if other == number]
            matrices = []
            for k in here:
                slack = self.offsets[-1] + k
                one = scipy.sparse.csr_array(([1.0], ([0], [slack])), (1, self.size))
                matrices += [place_at(self.parts, self.size, order[k][1]), one]
            places = scipy.sparse.vstack(matrices, format="csr")
            lower = np.array([[self.rows[order[k]]] for k in here])
            terms = _distance(self.clearance, number)
            blocks.append(Block(terms, places, None, lower, np.full_like(lower, np.inf)))
        return blocks

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the variables."""
        low, high = zip(*(part.bounds() for part in self.parts), strict=True)
        count = self.size - self.offsets[-2]
        return (
            np.concatenate([*(each.ravel() for each in low), np.zeros(count)]),
            np.concatenate([*(each.ravel() for each in high), np.full(count, np.inf)]),
        )

    def guess(self, nodes: Sequence[Array], sigma: Array | None = None) -> Array:
        """Variables of positions at the nodes of each arm, with enough time for their speeds."""
        x = np.concatenate([each.ravel() for each in nodes])
        if sigma is None:
            by_nodes, shares = self._speed_rows
            needed = np.maximum(by_nodes @ x - 1.0, 0.0)
            sigma = np.where(shares > 0.0, needed[:, None], 0.0).max(axis=0, initial=0.0)
        x = np.concatenate([x, sigma, np.zeros(len(self.rows))])
        if self.rows:
            g = self.program.functions["nlp"](x, [])[1].full()[-len(self.rows) :, 0]
            x[self.offsets[-1] :] = np.maximum(
                [self.rows[each] for each in sorted(self.rows)] - g, 0
            )
        return x

    def solve(self, start: Array, near: bool = False) -> Outcome:
        """Ipopt's result from a start; `near` tells that it is nearly a solution."""
        return self.program.solve(start, self.bounds, _NEAR if near else _IPOPT)

    def split(self, x: Array) -> tuple[list[Array], Array]:
        """Positions at the nodes of each arm (size, n), and the relative times added."""
        pairs = zip(self.parts, self.offsets, strict=False)
        nodes = [x[at : at + part.size].reshape(-1, part.dof) for part, at in pairs]
        return nodes, np.maximum(x[self.offsets[-2] : self.offsets[-1]], 0.0)


@lru_cache(maxsize=1)
def _linear() -> Terms:
    """A variable times its weight, in the objective."""
    x, weight = ca.SX.sym("x"), ca.SX.sym("weight")
    return Terms(x, weight, weight * x)


@lru_cache(maxsize=1)
def _identity() -> Terms:
    """A bounded sum of variables."""
    x = ca.SX.sym("x")
    return Terms(x, constraints=x)


@lru_cache(maxsize=256)
def _distance(clearance: Clearance, number: int) -> Terms:
    """A distance and its slack."""
    q, slack = ca.SX.sym("q", clearance.dof), ca.SX.sym("slack")
    return Terms(ca.vertcat(q, slack), constraints=clearance.row(number)(q) + slack)
