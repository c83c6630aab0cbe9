"""The program of a trajectory: its variables, the terms of each arm, and the limits it minds.

Variables: durations of the intervals between edges, no shorter than the person's; for every knot
and arm position q, velocity and acceleration relative to their limits. Objective: the time beyond
the person's, the mean squared distance from the paths, and small weights on accelerations and
jerks, which are taken relative to their limits. Every arm passes the ends of its paths.

Between two knots a duration h apart the jerk is constant, so that

    v1 = v0 + h (a0 + a1) / 2,    q1 = q0 + h v0 + h^2 (2 a0 + a1) / 6.

Position and velocity are polynomials between their Bezier coefficients, which are kept within the
limits: q0, q0 + h v0 / 3, q1 - h v1 / 3, q1, and v0, v0 + h a0 / 2, v1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.execution.arm_paths import (
    INSIDE,
    ArmPaths,
    Course,
    Knots,
    KnotStates,
    Reference,
)
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.ipopt import Outcome

_TOUCHES = 1e-5  # of a position limit [rad or m]
_UNLIMITED = np.array([[1.0], [1.0], [10.0], [1.0]])  # units of joints without limits
# Weights of squared accelerations, one at the limit, and of squared differences from the intended
# speeds at the ends, relative to the limits.
_SMOOTH, _END_SPEED = 2e-3, 0.1


@dataclass(frozen=True, eq=False)
class ArmTerms(Course):
    """Terms of one arm, whose variables are (knots, 3, n).

    Attributes:
        first: index of its first variable.
    """

    first: int

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return self.arm.robot.dof

    @property
    def last(self) -> int:
        """Index after its last variable."""
        return self.first + 3 * self.dof * (self.knots.count + 1)

    @cached_property
    def units(self) -> Array:
        """Scales of positions, velocities, accelerations, jerks (4, n): the limits, if any."""
        limits = self.arm.limits
        found = np.array([np.ones(self.dof), limits.velocity, limits.acceleration, limits.jerk])
        return np.where(np.isfinite(found), found, _UNLIMITED)

    def bounds(self, rest: bool) -> tuple[Array, Array]:
        """Return bounds of the variables, (knots, 3, n) each."""
        arm, limits = self.arm, self.arm.limits
        upper = np.full((self.knots.count + 1, 3, self.dof), np.inf)
        limited = np.isfinite([limits.velocity, limits.acceleration])
        upper[:, 1:] = np.where(limited, 1.0 - INSIDE, np.inf)
        lower = -upper
        lower[:, 0], upper[:, 0] = arm.ranges
        still = self.knots_at_rest
        if rest:
            still[[0, -1]] = True
        lower[still, 1:] = upper[still, 1:] = 0.0
        given = self.resting[self.path_of]
        given[self.at] = True
        lower[given, 0] = upper[given, 0] = arm.ends[self.path_of[given]]
        lower[-1, 0] = upper[-1, 0] = arm.ends[-1]
        # At a limit a joint can only turn back.
        room = np.minimum(arm.ends - arm.robot.lower, arm.robot.upper - arm.ends)
        edge, joint = np.nonzero(room < _TOUCHES)
        lower[self.at[edge], 1, joint] = upper[self.at[edge], 1, joint] = 0.0
        return lower, upper

    def indices(self, knots: Indices, parts: int = 3) -> Indices:
        """Return indices of the position, or also its derivatives, at knots: (k, parts n)."""
        n = self.dof
        return np.asarray(self.first + 3 * n * knots[:, None] + np.arange(parts * n))

    def deviation(self, reference: Reference, shares: Array, weight: float) -> Block:
        """Return squared distances from points of the paths, and squared accelerations.

        Args:
            reference: the points.
            shares: shares of every knot in an integral over time (knots,).
            weight: weight of the distances.
        """
        n, count = self.dof, shares.size
        z, p = ca.SX.sym("z", 3 * n), ca.SX.sym("p", n + n * n + 1)
        q, _, a = ca.vertsplit(z, n)
        offset, matrix = q - p[:n], ca.reshape(p[n : n + n * n], n, n)
        objective = ca.dot(offset, matrix @ offset) + p[-1] * ca.sumsqr(a)
        matrices = weight * shares[:, None, None] * reference.weights
        smooth = _SMOOTH * shares[:, None]
        values = np.hstack([reference.positions, matrices.reshape(count, -1), smooth])
        return Block(Terms(z, p, objective), self.indices(np.arange(count)), values)

    def motion(self, steps: Array) -> Block:
        """Return the two equations of motion of every joint in every piece, and the cost of the
        jerk.

        Args:
            steps: weights of the squared changes of the accelerations (pieces,).
        """
        n, knots = self.dof, self.knots
        z, p = ca.SX.sym("z", 6 * n + 1), ca.SX.sym("p", 2)
        q0, v0, a0, q1, v1, a1 = ca.vertsplit(z[:-1], n)
        h, (_, speed, growth, _) = p[0] * z[-1], self.units
        mean = speed * v0 + h * growth * (2 * a0 + a1) / 6
        equations = ca.vertcat(v0 + h * growth / speed * (a0 + a1) / 2 - v1, q0 + h * mean - q1)
        piece = np.arange(knots.count)
        columns = [self.indices(piece), self.indices(piece + 1), knots.interval[:, None]]
        upper = np.zeros((knots.count, 2 * n))
        # Fixed variables meet the equations of a rest; without these, the others are independent.
        upper[self.pieces_at_rest] = np.inf
        values = np.stack([knots.fraction, steps], axis=1)
        objective = p[1] * ca.sumsqr(a1 - a0)
        return Block(Terms(z, p, objective, equations), np.hstack(columns), values, -upper, upper)

    def between_knots(self, kind: str, pairs: Indices) -> Block:
        """Return a limit between the knots, of one joint in one piece each.

        Args:
            kind: "jerk"; "velocity", the Bezier coefficient in the middle; "position", the two.
            pairs: (k, 2), numbers of the piece and of the joint.
        """
        z, p = ca.SX.sym("z", 7), ca.SX.sym("p", 4)
        q0, v0, a0, q1, v1, a1, duration = ca.vertsplit(z)
        fraction, speed, growth, jerk = ca.vertsplit(p)
        h = fraction * duration
        rows = {
            "jerk": (a1 - a0) * growth / (h * jerk),
            "velocity": v0 + h * growth * a0 / (2 * speed),
            "position": ca.vertcat(q0 + h * speed * v0 / 3, q1 - h * speed * v1 / 3),
        }
        (piece, joint), knots = pairs.T, self.knots
        first = self.first + 3 * self.dof * piece + joint
        offsets = self.dof * np.arange(6)  # the states of a knot are followed by the next one's
        columns = np.hstack([first[:, None] + offsets, knots.interval[piece][:, None]])
        values = np.column_stack([knots.fraction[piece], *self.units[1:, joint]])
        upper = np.full((len(pairs), 1), 1.0 - INSIDE)
        lower = -upper
        if kind == "position":
            lower, upper = (np.repeat(side[joint, None], 2, axis=1) for side in self.arm.ranges)
        return Block(Terms(z, p, 0.0, rows[kind]), columns, values, lower, upper)

    def torques(self, knots: Indices, shares: Array) -> Block:
        """Return torques at some of the knots (k,), within shares (k, n) of their limits."""
        z, arm = ca.SX.sym("z", 3 * self.dof), self.arm
        q, v, a = ca.vertsplit(z, self.dof)
        _, speed, growth, _ = self.units
        force = arm.robot.inverse_dynamics(q, v * speed, a * growth, ca.SX(arm.gravity))
        limited = np.flatnonzero(np.isfinite(arm.limits.torque))
        used = force[limited.tolist()] / arm.limits.torque[limited]
        upper = shares[:, limited]
        return Block(Terms(z, constraints=used), self.indices(knots), None, -upper, upper)

    def end_speeds(self) -> Block:
        """Return squared differences of the velocities at both ends from the person's progress."""
        n, arm, durations = self.dof, self.arm, np.diff(self.arm.edges)
        v, p = ca.SX.sym("v", n), ca.SX.sym("p", n)
        first, last = arm.paths[0](0.0, 1) / durations[0], arm.paths[-1](1.0, 1) / durations[-1]
        objective = _END_SPEED * ca.sumsqr(v - p)
        knots = np.array([0, self.knots.count])
        intended = np.clip(np.array([first, last]) / self.units[1], -0.9, 0.9)
        return Block(Terms(v, p, objective), self.indices(knots, 2)[:, n:], intended)


@dataclass(frozen=True, eq=False)
class WatchedArm:
    """Limits of one arm.

    Attributes:
        pieces: pieces by kind of limit ("jerk", "velocity", "position"): numbers (k, 2) of pieces
            and joints.
        torques: numbers of the knots at which torques are limited (k,).
        torque_shares: torque shares of the limits that torques may reach at the knots, (knots, n);
            less than all where a torque is larger between the knots.
    """

    pieces: Mapping[str, Indices]
    torques: Indices
    torque_shares: Array


@dataclass(frozen=True, eq=False)
class Watched:
    """Constraints of a program, beside those that it always has.

    Attributes:
        arms: limits of each arm.
        knots: knots at which each distance is kept, by its index.
        distances: bounds of the distances at all knots (knots, m) [m]; more than the clearance's
            where a distance is smaller between the knots, -inf where the configuration is given.
    """

    arms: tuple[WatchedArm, ...]
    knots: Mapping[int, Indices]
    distances: Array


# The objective counts time beyond the person's as a fraction of the person's; squared distances and
# jerks are integrated over the trajectory's time.
_DISTANCE = 0.1  # from the paths [rad] that costs, if kept up, as much as the time it is kept up
_UNEVEN = 0.05  # of the squared stretch of an interval
_SHORT = 0.2  # intervals shorter than this [s] may be stretched more
_JERK, _JERK_TIME = 1e-3, 0.05  # when an acceleration changes by its limit in this time [s]
_IPOPT = {
    "tol": 1e-6,
    "constr_viol_tol": 1e-9,
    "dual_inf_tol": 1e-3,
    "acceptable_iter": 0,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-9,
}


@dataclass(frozen=True, eq=False)
class TrajectoryProgram:
    """The program for given knots.

    Attributes:
        arms: arms with their paths and limits.
        clearance: distances of the links.
        rest: whether the trajectory begins and ends at rest.
        deviation_weight: weight of the squared distance from the paths.
        knots: in time.
    """

    arms: Sequence[ArmPaths]
    clearance: Clearance
    rest: bool
    deviation_weight: float
    knots: Knots

    @cached_property
    def terms(self) -> tuple[ArmTerms, ...]:
        """Terms of the arms."""
        first, found = self.knots.person.size, []
        for arm in self.arms:
            found.append(ArmTerms(arm, self.knots, first))
            first = found[-1].last
        return tuple(found)

    def solve(
        self, start: KnotStates, references: Sequence[Reference], watched: Watched, most: int
    ) -> Outcome:
        """Return the solution near references, with the limits that are to be minded.

        Args:
            start: states at the knots.
            references: references of the arms.
            watched: constraints.
            most: number of Ipopt's iterations.
        """
        x, blocks = self.as_x(start), self._blocks(start.durations, references, watched)
        options = {**_IPOPT, "max_iter": most}
        return BlockProgram(x.size, blocks).solve(x, self.bounds, options)

    def _blocks(
        self, durations: Array, references: Sequence[Reference], watched: Watched
    ) -> list[Block]:
        """Return all blocks, with integrals by the trapezoidal rule over durations (m,)."""
        total, steps = float(self.knots.person.sum()), self.knots.steps(durations)
        shares = np.convolve(steps, [0.5, 0.5]) / total
        distance = self.deviation_weight / _DISTANCE**2
        jerk = _JERK * _JERK_TIME**2 / (total * steps)
        blocks = [self._stretch(total)]
        for terms, reference, limits in zip(self.terms, references, watched.arms, strict=True):
            blocks += [terms.deviation(reference, shares, distance), terms.motion(jerk)]
            blocks += [terms.between_knots(kind, pairs) for kind, pairs in limits.pieces.items()]
            if limits.torques.size:
                allowed = limits.torque_shares[limits.torques]
                blocks.append(terms.torques(limits.torques, allowed))
            if not self.rest:
                blocks.append(terms.end_speeds())
        q = ca.SX.sym("q", self.clearance.dof)
        for index, knots in watched.knots.items():
            columns = np.hstack([terms.indices(knots, 1) for terms in self.terms])
            lower = watched.distances[knots, index, None]
            distance_terms = Terms(q, constraints=self.clearance.row(index)(q))
            blocks.append(Block(distance_terms, columns, None, lower, np.full_like(lower, np.inf)))
        return blocks

    def _stretch(self, total: float) -> Block:
        """Get the time beyond the person's, and its square, so that no interval bears all of it."""
        person = self.knots.person
        duration, p = ca.SX.sym("T"), ca.SX.sym("p", 3)
        more = duration - p[0]
        objective = p[1] * more + p[2] * more**2
        uneven = _UNEVEN / (total * (person + _SHORT))
        values = np.stack([person, np.full(person.size, 1.0 / total), uneven], axis=1)
        return Block(Terms(duration, p, objective), np.arange(person.size)[:, None], values)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables."""
        person = self.knots.person
        lower, upper = zip(*(terms.bounds(self.rest) for terms in self.terms), strict=True)
        return (
            np.concatenate([person, *map(np.ravel, lower)]),
            np.concatenate([np.full(person.size, np.inf), *map(np.ravel, upper)]),
        )

    @cached_property
    def fixed_knots(self) -> NDArray[np.bool_]:
        """Knots at which the configuration of every arm is given, (knots,)."""
        lower, upper = (self.states(bound).arms for bound in self.bounds)
        pairs = zip(lower, upper, strict=True)
        given = [np.all(low[0] == high[0], axis=1) for low, high in pairs]
        return np.asarray(np.all(given, axis=0))

    def as_x(self, states: KnotStates) -> Array:
        """Return vector of the variables."""
        pairs = zip(self.terms, states.arms, strict=True)
        arms = [(own.transpose(1, 0, 2) / terms.units[:3]).ravel() for terms, own in pairs]
        return np.concatenate([states.durations, *arms])

    def states(self, x: Array) -> KnotStates:
        """Return values of the variables from their vector."""
        found = []
        for terms in self.terms:
            own = x[terms.first : terms.last].reshape(-1, 3, terms.dof) * terms.units[:3]
            found.append(own.transpose(1, 0, 2))
        return KnotStates(x[: self.knots.person.size], tuple(found))
