"""The program of a trajectory: its variables, the terms of each arm, and the limits it minds.

Variables: durations of the intervals between edges, no shorter than the person's; for every knot
and arm position q, velocity and acceleration relative to their limits. Objective: the time beyond
the person's, the mean squared distance from the paths, and small weights on accelerations and
jerks, which are taken relative to their limits. Every arm passes the ends of its paths.

Between two knots a duration h apart the jerk is constant, so that

    v1 = v0 + h (a0 + a1) / 2,    q1 = q0 + h v0 + h^2 (2 a0 + a1) / 6.

Position and velocity are polynomials between their Bezier coefficients, which are kept within the
limits: q0, q0 + h v0 / 3, q1 - h v1 / 3, q1, and v0, v0 + h a0 / 2, v1. Jerks are kept within the
limits with the overshoot of a controller that interpolates samples (`jerks_between`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

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
    hand_velocity,
)
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.interpolation import JERK_OVERSHOOT

_TOUCHES = 1e-5  # of a position limit [rad or m]
_UNLIMITED = np.array([[1.0], [1.0], [10.0], [1.0]])  # units of joints without limits
# Weights of squared accelerations, one at the limit, and of squared differences from the intended
# speeds at the ends, relative to the limits.
_SMOOTH = 2e-3
_END_SPEED = 0.1


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
        arm = self.arm
        limits = self.arm.limits
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
        count = shares.size
        matrices = weight * shares[:, None, None] * reference.weights
        smooth = _SMOOTH * shares[:, None]
        values = np.hstack([reference.positions, matrices.reshape(count, -1), smooth])
        return Block(_deviation(self.dof), self.indices(np.arange(count)), values)

    def motion(self, steps: Array) -> Block:
        """Return the two equations of motion of every joint in every piece, and the cost of the
        jerk.

        Args:
            steps: weights of the squared changes of the accelerations (pieces,).
        """
        n = self.dof
        knots = self.knots
        piece = np.arange(knots.count)
        columns = [self.indices(piece), self.indices(piece + 1), knots.interval[:, None]]
        upper = np.zeros((knots.count, 2 * n))
        # Fixed variables meet the equations of a rest; without these, the others are independent.
        upper[self.pieces_at_rest] = np.inf
        units = np.tile(self.units[1:3].ravel(), (knots.count, 1))
        values = np.column_stack([knots.fraction, steps, units])
        return Block(_motion(n), np.hstack(columns), values, -upper, upper)

    def between_knots(self, kind: str, pairs: Indices) -> Block:
        """Return a limit between the knots, of one joint in one piece each.

        Args:
            kind: "velocity", the Bezier coefficient in the middle; "position", the two; "jerk",
                that of a controller's interpolation around the end of the piece.
            pairs: (k, 2), numbers of the piece and of the joint.
        """
        if kind == "jerk":
            return self._jerks(pairs)
        (piece, joint) = pairs.T
        knots = self.knots
        first = self.first + 3 * self.dof * piece + joint
        offsets = self.dof * np.arange(6)  # the states of a knot are followed by the next one's
        columns = np.hstack([first[:, None] + offsets, knots.interval[piece][:, None]])
        values = np.column_stack([knots.fraction[piece], *self.units[1:3, joint]])
        upper = np.full((len(pairs), 1), 1.0 - INSIDE)
        lower = -upper
        if kind == "position":
            lower, upper = (np.repeat(side[joint, None], 2, axis=1) for side in self.arm.ranges)
        return Block(_between_knots(kind), columns, values, lower, upper)

    def _jerks(self, pairs: Indices) -> Block:
        """Return the jerks that a quintic through samples has around the ends of pieces.

        The jerk of the last piece ends in that of a rest, as if of a piece of the same duration
        that begins and ends with the last acceleration.
        """
        piece, joint = pairs.T
        knots = self.knots
        n = self.dof
        last = knots.count
        following = np.minimum(piece + 1, last - 1)
        accelerations = self.first + 2 * n + joint + 3 * n * piece
        end = self.first + 2 * n + joint + 3 * n * np.minimum(piece + 2, last)
        columns = np.column_stack(
            [
                *(accelerations, accelerations + 3 * n, end),
                *(knots.interval[piece], knots.interval[following]),
            ]
        )
        values = np.column_stack(
            [knots.fraction[piece], knots.fraction[following], *self.units[2:, joint]]
        )
        upper = np.full((len(pairs), 2), 1.0 - INSIDE)
        return Block(_jerks(), columns, values, -upper, upper)

    def torques(self, knots: Indices, shares: Array) -> Block:
        """Return torques at some of the knots (k,), within shares (k, n) of their limits."""
        units, upper, terms = self._torques("torque", shares)
        columns = self.indices(knots)
        return Block(terms, columns, np.tile(units, (knots.size, 1)), -upper, upper)

    def torque_rates(self, pieces: Indices, shares: Array) -> Block:
        """Return mean rates of torques in some of the pieces, within shares of their limits."""
        units, upper, terms = self._torques("torque_rate", shares)
        ends = self.indices(pieces), self.indices(pieces + 1)
        columns = np.hstack([*ends, self.knots.interval[pieces, None]])
        values = np.hstack([self.knots.fraction[pieces, None], np.tile(units, (pieces.size, 1))])
        return Block(terms, columns, values, -upper, upper)

    def _torques(self, kind: str, shares: Array) -> tuple[Array, Array, Terms]:
        limit = getattr(self.arm.limits, kind)
        limited = np.flatnonzero(np.isfinite(limit))
        units = np.concatenate([*self.units[1:3], limit[limited], np.ravel(self.arm.gravity)])
        make = _torques if kind == "torque" else _torque_rates
        return units, shares[:, limited], make(self.arm.robot, tuple(limited.tolist()))

    def hand_speeds(self, pieces: Indices, shares: Array) -> Block:
        """Return squared speeds of the hands at a quarter and three quarters of some of the pieces,
        within shares (k, 1) of the limit.
        """
        ends = self.indices(pieces), self.indices(pieces + 1)
        columns = np.hstack([*ends, self.knots.interval[pieces, None]])
        units = [*self.units[1:3].ravel(), self.arm.limits.hand_speed]
        values = np.hstack([self.knots.fraction[pieces, None], np.tile(units, (pieces.size, 1))])
        upper = np.repeat(shares**2, 2 * len(self.arm.robot.hands), axis=1)
        lower = np.full_like(upper, -np.inf)
        return Block(_hand_speeds(self.arm.robot), columns, values, lower, upper)

    def end_speeds(self) -> Block:
        """Return squared differences of the velocities at both ends from the person's progress."""
        n = self.dof
        arm = self.arm
        durations = np.diff(self.arm.edges)
        first = arm.paths[0](0.0, 1) / durations[0]
        last = arm.paths[-1](1.0, 1) / durations[-1]
        knots = np.array([0, self.knots.count])
        intended = np.clip(np.array([first, last]) / self.units[1], -0.9, 0.9)
        return Block(_end_speeds(n), self.indices(knots, 2)[:, n:], intended)


# Terms of every kind, which robots, recordings and rounds share with their compiled derivatives.
@lru_cache(maxsize=16)
def _deviation(n: int) -> Terms:
    z = ca.SX.sym("z", 3 * n)
    p = ca.SX.sym("p", n + n * n + 1)
    q, _, a = ca.vertsplit(z, n)
    offset = q - p[:n]
    matrix = ca.reshape(p[n : n + n * n], n, n)
    return Terms(z, p, ca.dot(offset, matrix @ offset) + p[-1] * ca.sumsqr(a))


@lru_cache(maxsize=16)
def _motion(n: int) -> Terms:
    z = ca.SX.sym("z", 6 * n + 1)
    p = ca.SX.sym("p", 2 + 2 * n)
    q0, v0, a0, q1, v1, a1 = ca.vertsplit(z[:-1], n)
    fraction, step, speed, growth = ca.vertsplit(p, [0, 1, 2, 2 + n, 2 + 2 * n])
    h = fraction * z[-1]
    mean = speed * v0 + h * growth * (2 * a0 + a1) / 6
    equations = ca.vertcat(v0 + h * growth / speed * (a0 + a1) / 2 - v1, q0 + h * mean - q1)
    return Terms(z, p, step * ca.sumsqr(a1 - a0), equations)


@lru_cache(maxsize=1)
def _jerks() -> Terms:
    z = ca.SX.sym("z", 5)
    p = ca.SX.sym("p", 4)
    a0, a1, a2, before, after = ca.vertsplit(z)
    first, second, growth, limit = ca.vertsplit(p)
    begin = (a1 - a0) * growth / (first * before * limit)
    end = (a2 - a1) * growth / (second * after * limit)
    return Terms(z, p, 0.0, ca.vertcat(*jerks_between(begin, end)))


def jerks_between(begin: Any, end: Any) -> tuple[Any, Any]:
    """Return the extreme jerks of a quintic through samples around a step of the jerk.

    Wherever the step is between two samples, the quintic overshoots it by up to `JERK_OVERSHOOT`
    times the step at both of its ends.
    """
    more = JERK_OVERSHOOT * (end - begin)
    return begin - more, end + more


@lru_cache(maxsize=2)
def _between_knots(kind: str) -> Terms:
    z = ca.SX.sym("z", 7)
    p = ca.SX.sym("p", 3)
    q0, v0, a0, q1, v1, _, duration = ca.vertsplit(z)
    fraction, speed, growth = ca.vertsplit(p)
    h = fraction * duration
    rows = {
        "velocity": v0 + h * growth * a0 / (2 * speed),
        "position": ca.vertcat(q0 + h * speed * v0 / 3, q1 - h * speed * v1 / 3),
    }
    return Terms(z, p, 0.0, rows[kind])


@lru_cache(maxsize=16)
def _torques(robot: Model, limited: tuple[int, ...]) -> Terms:
    n = robot.dof
    count = len(limited)
    z = ca.SX.sym("z", 3 * n)
    p = ca.SX.sym("p", 2 * n + count + 3)
    q, v, a = ca.vertsplit(z, n)
    speed, growth, limit, gravity = ca.vertsplit(p, np.cumsum([0, n, n, count, 3]).tolist())
    force = robot.inverse_dynamics(q, v * speed, a * growth, gravity)
    return Terms(z, p, 0.0, force[list(limited)] / limit)


@lru_cache(maxsize=16)
def _torque_rates(robot: Model, limited: tuple[int, ...]) -> Terms:
    n = robot.dof
    torques = _torques(robot, limited)
    z = ca.SX.sym("z", 6 * n + 1)
    p = ca.SX.sym("p", 1 + torques.size_p)
    first, last = (torques.value(state, p[1:])[1] for state in ca.vertsplit(z[:-1], 3 * n))
    return Terms(z, p, 0.0, (last - first) / (p[0] * z[-1]))


@lru_cache(maxsize=16)
def _hand_speeds(robot: Model) -> Terms:
    n = robot.dof
    rows = list[ca.SX]()
    z = ca.SX.sym("z", 6 * n + 1)
    p = ca.SX.sym("p", 2 + 2 * n)
    q, v, a, _, _, a1 = ca.vertsplit(z[:-1], n)
    fraction, speed, growth, limit = ca.vertsplit(p, [0, 1, 1 + n, 1 + 2 * n, 2 + 2 * n])
    h, v, a, change = fraction * z[-1], v * speed, a * growth, (a1 - a) * growth
    for s in (0.25, 0.75):
        at = q + s * h * (v + s * h * (a / 2 + s * change / 6))
        velocity = hand_velocity(robot)(at, v + s * h * (a + s * change / 2))
        rows += map(ca.sumsqr, ca.vertsplit(velocity / limit, 3))
    return Terms(z, p, 0.0, ca.vertcat(*rows))


@lru_cache(maxsize=16)
def _end_speeds(n: int) -> Terms:
    v = ca.SX.sym("v", n)
    p = ca.SX.sym("p", n)
    return Terms(v, p, _END_SPEED * ca.sumsqr(v - p))


@lru_cache(maxsize=1)
def _stretch() -> Terms:
    duration = ca.SX.sym("T")
    p = ca.SX.sym("p", 3)
    more = duration - p[0]
    return Terms(duration, p, p[1] * more + p[2] * more**2)


@lru_cache(maxsize=256)
def _distance(function: ca.Function) -> Terms:
    """Return a distance, see `DistancePart`."""
    q, *numbers = function.sx_in()
    return Terms(q, ca.vertcat(ca.SX(0, 1), *numbers), 0.0, function(q, *numbers))


SAMPLED = ("torque", "torque_rate", "hand_speed")  # limits that are checked at samples


@dataclass(frozen=True, eq=False)
class WatchedArm:
    """Limits of one arm.

    Attributes:
        pieces: pieces by kind of limit ("jerk", "velocity", "position"): numbers (k, 2) of pieces
            and joints.
        sampled: by the kind of limit, numbers (k,) of the knots at which "torque" is limited, or
            of pieces for "torque_rate" and "hand_speed", and the shares of the limits that are
            allowed at all knots or in all pieces, (knots, m); less than all where more is
            reached in between.
    """

    pieces: Mapping[str, Indices]
    sampled: Mapping[str, tuple[Indices, Array]]


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
_UNEVEN = 2.0  # of the squared stretch of an interval
_SHORT = 0.05  # intervals shorter than this [s] may be stretched more
# when an acceleration changes by its limit in this time [s]
_JERK = 1e-2
_JERK_TIME = 0.05
_IPOPT = {
    "tol": 1e-6,
    "constr_viol_tol": 1e-9,
    "dual_inf_tol": 1e-3,
    "acceptable_iter": 0,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-9,
    # The matrices are narrow bands: the simplest ordering, without scaling, is the quickest.
    **{"mumps_pivot_order": 0, "mumps_permuting_scaling": 0, "mumps_scaling": 0},
    "min_refinement_steps": 0,
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
        first = self.knots.person.size
        found = []
        for arm in self.arms:
            found.append(ArmTerms(arm, self.knots, first))
            first = found[-1].last
        return tuple(found)

    def solve(
        self,
        start: KnotStates,
        references: Sequence[Reference],
        watched: Watched,
        most: int,
    ) -> Outcome:
        """Return the solution near references, with the limits that are to be enforced.

        Args:
            start: states at the knots.
            references: references of the arms.
            watched: constraints.
            most: number of Ipopt's iterations.
        """
        x = self.as_x(start)
        blocks = list(self._blocks(start.durations, references, watched))
        options = {**_IPOPT, "max_iter": most}
        return BlockProgram(x.size, blocks).solve(x, self.bounds, options)

    def _blocks(
        self, durations: Array, references: Sequence[Reference], watched: Watched
    ) -> Iterator[Block]:
        """Yield the terms of all arms, and the distances.

        Integrals are by the trapezoidal rule over durations (m,).
        """
        total = float(self.knots.person.sum())
        steps = self.knots.steps(durations)
        shares = np.convolve(steps, [0.5, 0.5]) / total
        distance = self.deviation_weight / _DISTANCE**2
        jerk = _JERK * _JERK_TIME**2 / (total * steps)
        yield self._stretch(total)
        for terms, reference, limits in zip(self.terms, references, watched.arms, strict=True):
            yield terms.deviation(reference, shares, distance)
            yield terms.motion(jerk)
            for kind, pairs in limits.pieces.items():
                yield terms.between_knots(kind, pairs)
            rows = terms.torques, terms.torque_rates, terms.hand_speeds
            of_kind = dict(zip(SAMPLED, rows, strict=True))
            for kind, (numbers, allowed) in limits.sampled.items():
                yield of_kind[kind](numbers, allowed[numbers])
            if not self.rest:
                yield terms.end_speeds()
        for index, knots in watched.knots.items():
            part = self.clearance.part(index)
            every = np.hstack([terms.indices(knots, 1) for terms in self.terms])
            values = np.tile(part.numbers, (knots.size, 1))
            lower = watched.distances[knots, index, None]
            yield Block(
                _distance(part.function),
                every[:, part.columns],
                values,
                lower,
                np.full_like(lower, np.inf),
            )

    def _stretch(self, total: float) -> Block:
        """Get the time beyond the person's, and its square, so that no interval bears all of it."""
        person = self.knots.person
        uneven = _UNEVEN / (total * (person + _SHORT))
        values = np.stack([person, np.full(person.size, 1.0 / total), uneven], axis=1)
        return Block(_stretch(), np.arange(person.size)[:, None], values)

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
