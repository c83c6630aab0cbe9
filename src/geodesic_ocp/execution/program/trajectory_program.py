"""The nonlinear program of a trajectory of all arms.

Variables: durations of the intervals between edges, no shorter than the person's; positions,
velocities and accelerations of all arms at the knots. Objective: the time beyond the person's, the
mean squared distance from the paths, and small weights on accelerations and jerks, which are taken
relative to their limits. Every arm passes the ends of its paths at its edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.program import weights
from geodesic_ocp.execution.program.arm_terms import ArmTerms
from geodesic_ocp.execution.program.knots import Knots
from geodesic_ocp.execution.program.reference import Course, Reference
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.execution.program.variable_bounds import variable_bounds
from geodesic_ocp.execution.program.watched import Watched, WatchedDistances
from geodesic_ocp.ipopt import Outcome

_IPOPT = {
    "tol": 1e-6,
    "constr_viol_tol": 1e-9,
    "dual_inf_tol": 1e-3,
    "max_iter": 400,
    "acceptable_iter": 0,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-9,
}


@dataclass(frozen=True, eq=False)
class KnotStates:
    """Values of a program's variables.

    Attributes:
        durations: of the intervals (m,) [s].
        positions, velocities, accelerations: of every arm, (knots, n) each.
    """

    durations: Array
    positions: tuple[Array, ...]
    velocities: tuple[Array, ...]
    accelerations: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class TrajectoryProgram:
    """The program for given knots.

    Attributes:
        arms: with their paths and limits.
        knots: in time.
        settings: of the trajectory.
    """

    arms: Sequence[ArmPaths]
    knots: Knots
    settings: TrajectorySettings

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Paths of the arms over the knots."""
        return tuple(Course(arm, self.knots) for arm in self.arms)

    @cached_property
    def terms(self) -> tuple[ArmTerms, ...]:
        """Terms of the arms."""
        first, found = self.knots.person.size, []
        for course in self.courses:
            found.append(ArmTerms(course, first))
            first += 3 * course.arm.robot.dof * (self.knots.count + 1)
        return tuple(found)

    @property
    def size_x(self) -> int:
        """Number of variables."""
        dof = sum(arm.robot.dof for arm in self.arms)
        return int(self.knots.person.size + 3 * dof * (self.knots.count + 1))

    def solve(
        self, start: KnotStates, references: Sequence[Reference], watched: Watched
    ) -> Outcome:
        """The solution near references, with the limits that are to be minded."""
        blocks = self._blocks(start.durations, references, watched)
        return BlockProgram(self.size_x, blocks).solve(self.as_x(start), self.bounds, _IPOPT)

    def _blocks(
        self, durations: Array, references: Sequence[Reference], watched: Watched
    ) -> list[Block]:
        """Integrals over time are by the trapezoidal rule for these durations (m,)."""
        knots, settings = self.knots, self.settings
        total = float(knots.person.sum())
        steps = durations[knots.interval] * knots.fraction
        shares = np.convolve(steps, [0.5, 0.5]) / total
        distance = settings.deviation_weight / weights.DISTANCE**2
        jerk = weights.JERK * weights.JERK_TIME**2 / (total * steps)
        blocks = [self._stretch(total)]
        for k, (terms, reference) in enumerate(zip(self.terms, references, strict=True)):
            blocks.append(terms.deviation(reference, shares, distance))
            blocks.append(terms.motion(jerk, settings.tolerance is None))
            limits = watched.arms[k]
            for kind, pairs in limits.pieces.items():
                blocks.append(terms.between_knots(kind, pairs))
            if limits.torques.size:
                allowed = limits.torque_shares[limits.torques]
                blocks.append(terms.torques(limits.torques, allowed))
            if settings.tolerance is not None:
                blocks.append(terms.hand_poses(settings.tolerance))
            if not settings.rest:
                blocks.append(terms.end_speeds())
        for kept in watched.clearances:
            blocks += [self._distance(kept, index) for index in kept.knots]
        return blocks

    def _distance(self, kept: WatchedDistances, index: int) -> Block:
        """One distance at some of the knots."""
        knots, q = kept.knots[index], ca.SX.sym("q", kept.clearance.dof)
        distance = kept.clearance.row(index)(q)
        columns = np.hstack([terms.indices(knots, 1) for terms in self.terms])
        lower = kept.lower[knots, index, None]
        upper = np.full_like(lower, np.inf)
        return Block(Terms(q, constraints=distance), columns, None, lower, upper)

    def _stretch(self, total: float) -> Block:
        """The time beyond the person's, and its square, so that no interval bears all of it."""
        person = self.knots.person
        duration, p = ca.SX.sym("T"), ca.SX.sym("p", 3)
        more = duration - p[0]
        objective = p[1] * more + p[2] * more**2
        uneven = weights.UNEVEN / (total * (person + weights.SHORT))
        values = np.stack([person, np.full(person.size, 1.0 / total), uneven], axis=1)
        return Block(Terms(duration, p, objective), np.arange(person.size)[:, None], values)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the variables."""
        lowers, uppers = [self.knots.person], [np.full(self.knots.person.size, np.inf)]
        for course in self.courses:
            lower, upper = variable_bounds(course, self.settings)
            lowers.append(lower.ravel())
            uppers.append(upper.ravel())
        return np.concatenate(lowers), np.concatenate(uppers)

    @cached_property
    def fixed_knots(self) -> NDArray[np.bool_]:
        """Knots at which the configuration of every arm is given, (knots,)."""
        lower, upper = (self.states(bound) for bound in self.bounds)
        pairs = zip(lower.positions, upper.positions, strict=True)
        fixed = [np.all(low == high, axis=1) for low, high in pairs]
        return np.asarray(np.all(fixed, axis=0))

    def as_x(self, states: KnotStates) -> Array:
        """Vector of the variables."""
        parts = [states.durations]
        for k, terms in enumerate(self.terms):
            relative = [
                states.positions[k],
                states.velocities[k] / terms.speed_unit,
                states.accelerations[k] / terms.acceleration_unit,
            ]
            parts.append(np.stack(relative, axis=1).ravel())
        return np.concatenate(parts)

    def states(self, x: Array) -> KnotStates:
        """Values of the variables from their vector."""
        found = []
        for terms in self.terms:
            size = 3 * terms.dof * (self.knots.count + 1)
            own = x[terms.first : terms.first + size].reshape(-1, 3, terms.dof)
            v, a = own[:, 1] * terms.speed_unit, own[:, 2] * terms.acceleration_unit
            found.append((own[:, 0], v, a))
        return KnotStates(x[: self.knots.person.size], *zip(*found, strict=True))
