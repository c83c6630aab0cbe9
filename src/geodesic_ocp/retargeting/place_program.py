"""The program in the place of a robot's base and its configurations at the waypoints.

Minimized are the squared misses of the poses, action and lateness of the straight lines between the
configurations, likeness, posture, and weak joints. The misses are variables, which are tied to
place and configurations by equalities that the start meets. Distances that are small enter as
inequalities with slacks, in a few rounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.execution.clearance import Clearance, active_rows
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log, stacked_error
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.paired_arm import (
    elbow_offset,
    gravity_on,
    has_elbow,
    middle_of_ranges,
    waist_turn,
)
from geodesic_ocp.retargeting.paths_program import TOO_NEAR, distance_terms, linear_terms
from geodesic_ocp.retargeting.settings import BEYOND
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights, weakness

_NEAR = 0.02  # [m] above its bound, from which on a distance enters the program
_APART = 8  # programs at most, each with the distances that are too small after the last one
_IPOPT = {"tol": 1e-4, "max_iter": 200, "mu_init": 1e-2, "mu_strategy": "adaptive"}
_EXACT = 1e3  # root of the weight of squared pose errors [1/m], [1/rad]


@dataclass(frozen=True, eq=False)
class PlaceProgram:
    """The program of one robot and the motions that it takes over from one place.

    Attributes:
        arms: waypoints of each recording, with the robot at its default place.
        weights: weights of the objective, of each recording.
        alignments: alignments of the robot's hands at the default place.
        lower, upper: bounds of the shift to the right, forward and up [m], and of the yaw [rad].
        clearance: distances to be kept; None: none.
    """

    arms: Sequence[ArmWaypoints]
    weights: Sequence[ObjectiveWeights]
    alignments: tuple[Alignment, ...]
    lower: Array
    upper: Array
    clearance: Clearance | None

    def solve(self, place: Array, q: Array) -> Array:
        """Return the place (4,) at which distances lack least, of the solutions from a place and
        configurations (k, n) at the waypoints of all recordings.
        """
        robot = self.arms[0].arm
        first = 4
        n = robot.dof
        aligned = self.alignments
        centre = middle_of_shoulders(aligned)
        base = np.asarray(aligned[0].base)
        places = []
        values = []
        steps = []
        lines = []
        for arm, weights in zip(self.arms, self.weights, strict=True):
            rows = first + np.arange((arm.count + 1) * n).reshape(-1, n)
            first += rows.size
            for number, (row, pose) in enumerate(zip(rows, arm.poses, strict=True)):
                offset, thorax, costs = arm.likeness(number, weights)
                shares = np.array(costs) / (arm.count + 1)
                axes = base.ravel(order="F"), thorax
                values.append(np.hstack([pose.numbers, centre, offset, *axes, shares]))
                places.append([0, 1, 2, 3, *row])
            for number, duration in enumerate(arm.durations):
                late = duration * weights.stretch / weights.duration
                steps.append([*rows[number], *rows[number + 1]])
                speed = arm.speed[number] * duration
                lines.append([1.0 / (duration * weights.action), late, *(1.0 / speed)])
        arm = self.arms[0]
        torque = tuple(self.arms[0].limits.torque.tolist())
        misses = first + np.arange(len(places) * len(arm.rows)).reshape(len(places), -1)
        exact = np.zeros(misses.shape)
        terms = _pose_terms(robot, arm.hands, aligned, arm.rows, torque)
        blocks = [
            Block(terms, np.hstack([places, misses]), np.array(values), exact, exact),
            Block(_line_terms(robot), np.array(steps), np.array(lines)),
        ]
        kept = dict[tuple[int, int], float]()
        free = np.full(misses.size, np.inf)
        at = np.tile(place, (len(q), 1))
        off = terms.at("value", np.hstack([at, q, exact]), np.array(values))[1]
        missed = _EXACT * off.ravel()  # so that the start meets the equalities
        lower = np.concatenate([self.lower, np.tile(robot.lower, len(q)), -free])
        upper = np.concatenate([self.upper, np.tile(robot.upper, len(q)), free])
        last = first + misses.size
        best = place
        least = np.inf
        for number in range(_APART + 1):
            kept, lacks = self._small_distances(q, kept)
            if number and lacks < least:
                best = place
                least = lacks
            if number == _APART or least == 0.0:
                break
            slack = np.zeros(len(kept))
            bounds = np.append(lower, slack), np.append(upper, slack + np.inf)
            program = BlockProgram(last + slack.size, blocks + self._distances(kept, last))
            found = program.solve(np.hstack([place, q.ravel(), missed, slack]), bounds, _IPOPT)
            place, q, missed, _ = np.split(found.x, [4, first, last])
            q = q.reshape(-1, n)
        return best

    def _small_distances(
        self, q: Array, known: Mapping[tuple[int, int], float]
    ) -> tuple[dict[tuple[int, int], float], float]:
        """Return bounds [m] of the distances that are small at configurations (k, n), or were so
        before, by the numbers of configuration and distance; and the sum of what they lack [m].

        What was small before, and is not any more, may become smaller again by as much as it is
        known to be above its bound: a bound from where links overlapped would exclude too much.
        """
        if self.clearance is None:
            return {}, 0.0
        active = active_rows(self.clearance, q, _NEAR)
        below = self.clearance.at(q) - _NEAR + BEYOND
        found = {key: min(least, float(below[key])) for key, least in known.items()}
        pairs = zip(active.samples.tolist(), active.rows.tolist(), strict=True)
        found |= zip(pairs, (active.lower - _NEAR + BEYOND).tolist(), strict=True)
        return found, float(np.maximum(active.lacks - _NEAR, 0.0).sum())

    def _distances(self, rows: Mapping[tuple[int, int], float], first: int) -> list[Block]:
        """Return the blocks of distances, whose slacks are the variables from `first` on."""
        groups: dict[ca.Function, list[tuple[Array, Array, float]]] = {}
        for slack, ((sample, row), least) in enumerate(rows.items(), first):
            assert self.clearance is not None
            part = self.clearance.part(row)
            columns = np.append(4 + self.arms[0].arm.dof * sample + np.array(part.columns), slack)
            groups.setdefault(part.function, []).append((columns, part.numbers, least))
        blocks = []
        for function, group in groups.items():
            columns, numbers, lower = map(np.vstack, zip(*group, strict=True))
            upper = np.full(lower.shape, np.inf)
            blocks.append(Block(distance_terms(function), columns, numbers, lower, upper))
        cost = np.full((len(rows), 1), 10.0 * TOO_NEAR)
        linear = Block(linear_terms(), first + np.arange(len(rows))[:, None], cost)
        return [*blocks, linear] if rows else []


def middle_of_shoulders(alignments: Sequence[Alignment]) -> Array:
    """Return the middle of the shoulders (3,) [m], about whose vertical the base is turned."""
    return np.asarray(np.mean([np.asarray(each.shoulder) for each in alignments], axis=0))


def yawed(angle: float | ca.SX) -> ca.SX | Array:
    """Return the rotation by an angle about z."""
    if isinstance(angle, ca.SX):
        c = ca.cos(angle)
        s = ca.sin(angle)
        return ca.blockcat([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=16)
def _pose_terms(
    robot: Model,
    hands: tuple[str, ...],
    alignments: tuple[Alignment, ...],
    rows: tuple[int, ...],
    torque: tuple[float, ...],
) -> Terms:
    """Return pose errors, posture, weak joints, and the errors of elbows and waist, in place and
    configuration; p as in `PlaceProgram.solve`.
    """
    count = len(hands)
    edges = np.cumsum([0, 3 * count, 9 * count, 3, 3 * count, 9, 9, 3]).tolist()
    place = ca.SX.sym("place", 4)
    q = ca.SX.sym("q", robot.dof)
    p = ca.SX.sym("p", edges[-1])
    positions, rotations, centre, offsets, base, thorax, weights = ca.vertsplit(p, edges)
    base = ca.reshape(base, 3, 3)
    thorax = ca.reshape(thorax, 3, 3)
    turned = base @ yawed(-place[3])
    turn = turned @ base.T
    moved = centre - turned @ place[:3]
    position = ca.vertcat(*(moved + turn @ (x - centre) for x in ca.vertsplit(positions, 3)))
    rotation = ca.vertcat(
        *(turn @ each for each in ca.vertsplit(ca.reshape(rotations, 3 * count, 3), 3))
    )
    error = stacked_error(robot, hands, q, position, rotation, ca.SX.eye(3))[list(rows)]
    middle, half = middle_of_ranges(robot)
    missed = ca.SX.sym("missed", len(rows))
    cost = ca.sumsqr(missed) / 2.0 + weights[0] * ca.sumsqr((q - middle) / half) / robot.dof
    cost += weakness(robot, q, torque, gravity_on(alignments[0]))
    for alignment, offset in zip(alignments, ca.vertsplit(offsets, 3), strict=True):
        if has_elbow(robot, alignment):
            shoulder = moved + turn @ (np.asarray(alignment.shoulder) - centre)
            off = elbow_offset(robot, alignment, q, shoulder) - turn @ offset
            cost += weights[1] / count * ca.sumsqr(off)
    if robot.shared_joints:
        beside = turn @ thorax.T @ turn.T @ waist_turn(robot, q)
        cost += weights[2] * ca.sumsqr(rotation_log(beside))
    return Terms(ca.vertcat(place, q, missed), p, cost, error - missed / _EXACT)


@lru_cache(maxsize=16)
def _line_terms(robot: Model) -> Terms:
    """Return action and lateness of the straight line between two configurations."""
    n = robot.dof
    z = ca.SX.sym("z", 2 * n)
    p = ca.SX.sym("p", 2 + n)
    change = z[n:] - z[:n]
    action = ca.bilin(robot.mass_matrix((z[:n] + z[n:]) / 2.0), change, change) / 2.0
    late = ca.fmax(0.0, ca.fabs(change * p[2:]) - 1.0) ** 2
    return Terms(z, p, action * p[0] + p[1] * ca.sum1(late))
