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
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.program.arm_functions import ArmFunctions
from geodesic_ocp.execution.program.blocks import Block, BlockProgram
from geodesic_ocp.execution.program.knots import Knots
from geodesic_ocp.execution.program.reference import Course, Reference
from geodesic_ocp.execution.program.settings import TrajectorySettings
from geodesic_ocp.execution.program.watched import Watched
from geodesic_ocp.ipopt import Ipopt, Outcome

_DISTANCE = 0.1  # from the paths [rad] that costs, if kept up, as much as twice the time
_UNEVEN = 0.05  # weight of the squared stretch of an interval
_SHORT = 0.2  # of intervals shorter than this [s], the squared stretch counts less
_ACCELERATION, _JERK = 2e-3, 1e-3
_JERK_TIME = 0.05  # [s] in which an acceleration changes by its limit, at the unit of jerk
_END_SPEED = 0.1
INSIDE = 1e-5  # how far inside the limits the program stays, relative
_TOUCHES = 1e-5  # of a position limit [rad or m]
_OUTSIDE = 5e-7  # [rad or m]; lets a path touch its position limits
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
    """The program for given knots and rows of distances.

    Attributes:
        arms: with their paths and limits.
        knots: in time.
        settings: of the trajectory.
        watched: limits that the program has to mind, of every arm and of distances.
    """

    arms: Sequence[ArmPaths]
    knots: Knots
    settings: TrajectorySettings
    watched: Watched

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Paths of the arms over the knots."""
        return tuple(Course(arm, self.knots) for arm in self.arms)

    @cached_property
    def functions(self) -> tuple[ArmFunctions, ...]:
        """Blocks of the arms."""
        first, found = self.knots.person.size, []
        for arm in self.arms:
            found.append(ArmFunctions(arm, first))
            first += 3 * arm.robot.dof * (self.knots.count + 1)
        return tuple(found)

    @property
    def size_x(self) -> int:
        """Number of variables."""
        dof = sum(arm.robot.dof for arm in self.arms)
        return int(self.knots.person.size + 3 * dof * (self.knots.count + 1))

    @property
    def _exact(self) -> bool:
        return self.settings.tolerance is None

    @cached_property
    def _blocks(self) -> tuple[Block, ...]:
        knots, interval = self.knots, self.knots.interval
        blocks = [self._durations()]
        for k, (functions, course) in enumerate(zip(self.functions, self.courses, strict=True)):
            blocks.append(functions.at_knots(knots.count + 1))
            blocks.append(functions.motion(interval))
            for kind, pairs in self.watched.pieces[k].items():
                blocks.append(functions.between_knots(interval, kind, pairs))
            if self.watched.torques[k].size:
                blocks.append(functions.torques(self.watched.torques[k]))
            if self.settings.tolerance is not None:
                blocks.append(functions.hand_poses(course.at))
            if not self.settings.rest:
                blocks.append(functions.end_speeds(np.array([0, knots.count])))
        for row in self.watched.distances:
            columns = [functions.indices(row.knots, 1) for functions in self.functions]
            q = ca.SX.sym("q", row.clearance.dof)
            distance = row.clearance.row(row.index)(q)
            blocks.append(Block(q, ca.SX(0, 1), ca.SX(0), distance, np.hstack(columns)))
        return tuple(blocks)

    def _durations(self) -> Block:
        """Parameters: the person's duration, weight, weight of the square."""
        duration, p = ca.SX.sym("T"), ca.SX.sym("p", 3)
        more = duration - p[0]
        objective = p[1] * more + p[2] * more**2
        indices = np.arange(self.knots.person.size)[:, None]
        return Block(duration, p, objective, ca.SX(0, 1), indices)

    @cached_property
    def solver(self) -> Ipopt:
        """Ipopt for this program."""
        return BlockProgram(self.size_x, self._blocks).solver(_IPOPT)

    def solve(
        self, start: KnotStates, references: Sequence[Reference], torque_shares: Sequence[Array]
    ) -> Outcome:
        """The solution near references, with torques within shares (knots, n) of their limits."""
        lower, upper = self.bounds
        lower_g, upper_g = self._bounds_g(torque_shares)
        return self.solver(
            x0=np.clip(self.as_x(start), lower, upper),
            p=self._parameters(references, start.durations),
            lbx=lower,
            ubx=upper,
            lbg=lower_g,
            ubg=upper_g,
        )

    def as_x(self, iterate: KnotStates) -> Array:
        """Vector of the variables."""
        parts = [iterate.durations]
        for k, functions in enumerate(self.functions):
            states = [
                iterate.positions[k],
                iterate.velocities[k] / functions.speed_unit,
                iterate.accelerations[k] / functions.acceleration_unit,
            ]
            parts.append(np.stack(states, axis=1).ravel())
        return np.concatenate(parts)

    def iterate(self, x: Array) -> KnotStates:
        """Values of the variables from their vector."""
        states = []
        for functions in self.functions:
            n = functions.dof
            size = 3 * n * (self.knots.count + 1)
            own = x[functions.first : functions.first + size].reshape(-1, 3, n)
            states.append(
                (
                    own[:, 0],
                    own[:, 1] * functions.speed_unit,
                    own[:, 2] * functions.acceleration_unit,
                )
            )
        return KnotStates(x[: self.knots.person.size], *zip(*states, strict=True))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the variables."""
        lowers, uppers = [self.knots.person], [np.full(self.knots.person.size, np.inf)]
        for functions, course in zip(self.functions, self.courses, strict=True):
            count, n = self.knots.count + 1, functions.dof
            upper = np.full((count, 3, n), np.inf)
            limits = functions.arm.limits
            upper[:, 1], upper[:, 2] = _within(limits.velocity), _within(limits.acceleration)
            lower = -upper
            lower[:, 0], upper[:, 0] = position_bounds(course)
            held = np.zeros(count, dtype=bool)
            for rests, first, last in zip(
                course.resting, course.at[:-1], course.at[1:], strict=True
            ):
                if rests:
                    held[first : last + 1] = True
                    if self._exact:
                        fixed = course.junctions[np.searchsorted(course.at, first)]
                        lower[first : last + 1, 0] = upper[first : last + 1, 0] = fixed
            if self.settings.rest:
                held[[0, -1]] = True
            lower[held, 1:] = upper[held, 1:] = 0.0
            if self._exact:
                lower[course.at, 0] = upper[course.at, 0] = course.junctions
                # At a limit a joint can only turn back.
                robot, ends = functions.arm.robot, course.junctions
                touches = np.minimum(ends - robot.lower, robot.upper - ends) < _TOUCHES
                knot, joint = np.nonzero(touches)
                lower[course.at[knot], 1, joint] = upper[course.at[knot], 1, joint] = 0.0
            lowers.append(lower.ravel())
            uppers.append(upper.ravel())
        return np.concatenate(lowers), np.concatenate(uppers)

    @cached_property
    def fixed_knots(self) -> NDArray[np.bool_]:
        """Knots at which the configuration of every arm is given, (knots,)."""
        lower, upper = (self.iterate(bound) for bound in self.bounds)
        pairs = zip(lower.positions, upper.positions, strict=True)
        fixed = [np.all(low == high, axis=1) for low, high in pairs]
        return np.asarray(np.all(fixed, axis=0))

    def _bounds_g(self, torque_shares: Sequence[Array]) -> tuple[Array, Array]:
        lowers: list[Array] = []
        uppers: list[Array] = []
        for k, (functions, course) in enumerate(zip(self.functions, self.courses, strict=True)):
            of_arm = [self._equations(functions, course)]
            for kind, pairs in self.watched.pieces[k].items():
                ones = np.full(len(pairs), 1.0 - INSIDE)
                low, high = -ones, ones
                if kind == "position":
                    low, high = (
                        np.repeat(bound[pairs[:, 1]], 2) for bound in position_bounds(course)
                    )
                of_arm.append((low, high))
            torques = torque_shares[k][self.watched.torques[k]][:, functions.limited_torques]
            of_arm.append((-torques, torques))
            if self.settings.tolerance is not None:
                # A box inside the ball: its sides are linear where the hand's position is.
                box = np.repeat(self.settings.tolerance, 3) * (1.0 - INSIDE) / np.sqrt(3.0)
                sides = np.tile(box, course.at.size)
                of_arm.append((-sides, sides))
            lowers += [lower.ravel() for lower, _ in of_arm]
            uppers += [upper.ravel() for _, upper in of_arm]
        for row in self.watched.distances:
            lowers.append(row.lower)
            uppers.append(np.full(row.lower.size, np.inf))
        return np.concatenate(lowers), np.concatenate(uppers)

    def _equations(self, functions: ArmFunctions, course: Course) -> tuple[Array, Array]:
        n = functions.dof
        upper = np.zeros((self.knots.count, 2 * n))
        for rests, first, last in zip(course.resting, course.at[:-1], course.at[1:], strict=True):
            if rests:  # fixed variables meet these; without them the equations are independent
                upper[first:last, : 2 * n if self._exact else n] = np.inf
        return -upper, upper

    def _parameters(self, references: Sequence[Reference], durations: Array) -> Array:
        """Of all blocks; integrals over time are by the trapezoidal rule for these durations."""
        knots, person = self.knots, self.knots.person
        total = float(person.sum())
        steps = durations[knots.interval] * knots.fraction
        shares = np.convolve(steps, [0.5, 0.5]) / total
        uneven = _UNEVEN / (total * (person + _SHORT))
        parts = [np.stack([person, np.full(person.size, 1.0 / total), uneven], axis=1).ravel()]
        jerk = _JERK * _JERK_TIME**2 / (total * steps)
        weight = self.settings.deviation_weight / _DISTANCE**2
        for k, (functions, reference) in enumerate(zip(self.functions, references, strict=True)):
            matrices = weight * shares[:, None, None] * reference.weights(functions.arm)
            count = len(shares)
            of_knots = [
                reference.positions,
                matrices.reshape(count, -1),
                _ACCELERATION * shares[:, None],
            ]
            parts.append(np.hstack(of_knots).ravel())
            of_pieces = np.stack([knots.fraction, jerk], axis=1)
            parts.append(of_pieces.ravel())
            parts += [
                functions.units_between_knots(knots.fraction, pairs).ravel()
                for pairs in self.watched.pieces[k].values()
            ]
            course = Course(functions.arm, knots)
            if not self._exact:
                rotations, positions = functions.arm.robot.hand_pose(course.junctions)
                columns = rotations.transpose(0, 2, 1).reshape(len(rotations), -1)
                parts.append(np.hstack([columns, positions]).ravel())
            if not self.settings.rest:
                speeds = _end_velocities(functions.arm) / functions.speed_unit
                speeds = np.clip(speeds, -0.9, 0.9)
                parts.append(np.hstack([speeds, np.full((2, 1), _END_SPEED)]).ravel())
        return np.concatenate(parts)


def _within(limit: Array) -> Array:
    """Bound of a quantity that is relative to a limit."""
    return np.where(np.isfinite(limit), 1.0 - INSIDE, np.inf)


def _end_velocities(arm: ArmPaths) -> Array:
    """Along the first and the last path at the person's mean speed, (2, n)."""
    durations = np.diff(arm.edges)
    first, last = arm.paths[0](0.0, 1) / durations[0], arm.paths[-1](1.0, 1) / durations[-1]
    return np.array([first, last])


def position_bounds(course: Course) -> tuple[Array, Array]:
    """Of the joints (n,) [rad or m], just outside the limits, and beyond the ends of paths."""
    robot, ends = course.arm.robot, course.junctions
    lower = np.minimum(robot.lower, ends.min(axis=0)) - _OUTSIDE
    upper = np.maximum(robot.upper, ends.max(axis=0)) + _OUTSIDE
    return lower, upper
