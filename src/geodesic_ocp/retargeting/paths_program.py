"""All synergies of a motion as one nonlinear program.

Minimized is the action of all paths, sum_k (energy of path k) / (its duration), which is the
integral of the kinetic energy at constant speeds, plus the time that the joints' speed limits add,
plus terms of posture and likeness (`ObjectiveWeights`), and of the hand's distance from the
person's between the poses. Variables are the positions at the nodes of all paths, so that the
configurations where they meet are shared, and the relative time added to each interval between two
instants at which a movement of any arm begins or ends. The hand's poses at the waypoints are
equalities, or squared errors where they are out of reach; joint limits are bounds; mean speeds
within limits are linear inequalities. Distances that are too small enter as inequalities with slack
variables, whose sum has a large weight (an exact penalty; Fletcher 1987), as the pose at a waypoint
may not allow them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.conditions import NodeBounds
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.ocp.refinement import halved
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.paired_arm import gravity_on
from geodesic_ocp.retargeting.waypoints import TOO_WEAK, ArmWaypoints, ObjectiveWeights, weakness
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path


def own_time(part: ArmPart, times: Array) -> Array:
    """Get parameter s of an arm's whole path at times [s] in the recording; rests are left out."""
    given = part.waypoints
    instants = np.column_stack([given.begins, given.ends]).ravel()
    after = np.cumsum(given.durations)
    moved = np.column_stack([after - given.durations, after]).ravel()
    kept = np.append(True, np.diff(instants) > 0.0)
    return np.asarray(np.interp(times, instants[kept], moved[kept]) / part.moving_time)


def positions_at(parts: Sequence[ArmPart], nodes: Sequence[Array], times: Array) -> Array:
    """Return joints of all arms (k, N) at times (k,) [s] in the recording."""
    found = [
        part.path(each)(own_time(part, times)) for part, each in zip(parts, nodes, strict=True)
    ]
    return np.hstack(found)


def places_at(parts: Sequence[ArmPart], size: int, times: Array) -> scipy.sparse.csr_array:
    """Return the matrix (k N, size) from the variables to all joints at times (k,) [s]."""
    dof = sum(part.dof for part in parts)
    first = 0
    column = 0
    found = []
    for part in parts:
        grid = part.grid
        s = own_time(part, times)
        every = np.arange(grid.degree + 1)
        basis = grid.interpolate(np.tile(np.eye(every.size), (grid.segments, 1, 1)), s)
        segment = np.searchsorted(grid.breakpoints[1:-1], s, "right")
        nodes = grid.degree * segment[:, None] + every
        joints = np.arange(part.dof)[:, None, None]
        rows = dof * np.arange(s.size)[:, None] + column + joints
        places = first + part.dof * nodes + joints
        found.append([each.ravel() for each in np.broadcast_arrays(basis, rows, places)])
        first = first + part.size
        column = column + part.dof
    entries, at, columns = map(np.concatenate, zip(*found, strict=True))
    return scipy.sparse.csr_array((entries, (at, columns)), (dof * times.size, size))


@dataclass(frozen=True, eq=False)
class ArmPart:
    """One arm with the grid of its paths, one after the other over the time in which it moves.

    Attributes:
        waypoints: waypoints of the arm.
        definition: its energy, limits and further conditions along its paths, as a problem.
        missed: weights of the squared errors of poses that are missed (m + 1,); zero for those that
            are attained, which are equalities.
        allowed: which of the poses that are missed stay within the allowed distance (m + 1,).
        grid: over the arm's own time from 0 to 1, in which rests are left out.
        last_segments: last segments of the movements, (m,): number of segments up to the end of
            each.
        heavy: whether weak joints cost along the paths, as they do at the waypoints.
    """

    waypoints: ArmWaypoints
    definition: ProblemDefinition
    missed: Array
    allowed: NDArray[np.bool_]
    grid: Grid
    last_segments: tuple[int, ...]
    heavy: bool = False

    @classmethod
    def evenly(
        cls,
        waypoints: ArmWaypoints,
        definition: ProblemDefinition,
        missed: Array,
        segments: int,
        degree: int,
        allowed: NDArray[np.bool_] | None = None,
    ) -> ArmPart:
        """Return a mesh with so many segments of equal duration for each movement."""
        edges = np.concatenate([[0.0], np.cumsum(waypoints.durations)])
        edges /= edges[-1]
        edges[-1] = 1.0
        fine = np.interp(
            np.arange(segments * waypoints.count + 1) / segments, np.arange(edges.size), edges
        )
        grid = Grid(fine.size - 1, degree, tuple(fine.tolist()))
        last = tuple(segments * (number + 1) for number in range(waypoints.count))
        near = np.zeros(missed.size, dtype=bool) if allowed is None else allowed
        return cls(waypoints, definition, missed, near, grid, last)

    def halved(self, coarse: NDArray[np.bool_]) -> ArmPart:
        """Return the mesh with some of the segments (segments,) halved."""
        every = np.cumsum(1 + coarse)
        last = tuple(int(every[number - 1]) for number in self.last_segments)
        return replace(self, grid=halved(self.grid, coarse), last_segments=last)

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return self.waypoints.arm.dof

    @property
    def size(self) -> int:
        """Number of variables."""
        return self.grid.size * self.dof

    @property
    def moving_time(self) -> float:
        """Sum of the movements' durations [s]."""
        return float(self.waypoints.durations.sum())

    @cached_property
    def bounds(self) -> NodeBounds:
        """Return bounds of the positions at the nodes, and of conditions along the paths."""
        found = NodeBounds.on_grid(self.definition.conditions, self.grid)
        given = self.waypoints
        if not given.limited:
            return found
        lower, upper = (
            np.clip(np.clip(side, given.arm.lower, given.arm.upper), found.lower, found.upper)
            for side in (found.lower, found.upper)
        )
        return replace(found, lower=lower, upper=upper)

    def blocks(self, first: int, weights: ObjectiveWeights) -> list[Block]:
        """Return energy, conditions and the hand's way along the paths, poses and postures at the
        waypoints.

        Args:
            first: index of the first of the arm's variables.
            weights: weights of the objective.
        """
        # The objective is the action in its unit.
        units = Units(np.zeros(self.dof), 1.0, weights.action * self.moving_time)
        transcription = self.definition.transcription(self.grid)
        found = []
        row = 0
        for block in transcription.blocks(ca.DM(units.parameters(self.grid)), first):
            here = slice(row, row + block.size_g)
            lower, upper = (
                each[here].reshape(block.count, -1)
                for each in (self.bounds.lower_g, self.bounds.upper_g)
            )
            found.append(replace(block, lower=lower, upper=upper))
            row = here.stop
        if self.heavy:  # by the sum, not the mean, of the movements
            given = self.waypoints
            shares = self._at_nodes(self.grid.weights)
            terms = _weak_joints(given.arm, given.alignment, tuple(given.limits.torque.tolist()))
            found.append(Block(terms, self._places(first), weights=given.count * shares))
        return [*found, self.hand_block(first), self.waypoint_block(first, weights)]

    def _at_nodes(self, weights: Array) -> Array:
        """Return sums at the nodes (size,) of weights in the segments (segments, degree + 1)."""
        found = np.append(weights[:, :-1].ravel(), 0.0)
        found[self.grid.degree :: self.grid.degree] += weights[:, -1]
        return found

    def _places(self, first: int) -> NDArray[np.int64]:
        """Return indices of the variables of every node (size, n)."""
        return first + np.arange(self.size).reshape(-1, self.dof)

    def is_heavy(self, nodes: Array) -> bool:
        """Return whether joints that can hold the arm at all waypoints cannot in between."""
        ends = self.grid.degree * np.array([0, *self.last_segments])
        strong = self.waypoints.strong_enough(nodes)
        return bool(np.all(strong[ends]) and not np.all(strong))

    def hand_block(self, first: int) -> Block:
        """Return costs of the hands' distances and angles from the person's at the nodes, whose sum
        is a mean along the paths.
        """
        given = self.waypoints
        grid = self.grid
        edges = grid.breakpoints[[0, *self.last_segments]]
        poses = given.target_at(np.interp(grid.nodes, edges, np.arange(edges.size)))
        counted = [0 in given.rows, 3 in given.rows]
        units = np.where(counted, 1.0 / np.array(given.path_tolerance), 0.0)
        values = np.array([[*pose.numbers, *units] for pose in poses])
        # A way between poses that the hand cannot attain would be a detour.
        attained = (self.missed == 0.0) | self.allowed
        movement = np.searchsorted(self.last_segments, np.arange(grid.segments), side="right")
        weights = grid.weights * (attained[:-1] & attained[1:])[movement, None]
        shares = self._at_nodes(weights)
        terms = _off_the_hands(given.arm, given.hands)
        return Block(terms, self._places(first), values, weights=_HAND * shares)

    def waypoint_block(self, first: int, weights: ObjectiveWeights) -> Block:
        """Return poses and postures at the waypoints.

        Args:
            first: index of the first of the arm's variables.
            weights: weights of the objective.
        """
        given = self.waypoints
        count = self.waypoints.count + 1
        rows = [given.parameters(k, each, weights) for k, each in enumerate(self.missed[:, None])]
        nodes = self.grid.degree * np.array([0, *self.last_segments])
        places = first + self.dof * nodes[:, None] + np.arange(self.dof)
        free = self.missed > 0.0
        free[0] |= given.start is not None
        upper = np.where(free[:, None], np.inf, np.zeros(len(given.rows)))
        hands = len(given.hands)
        lower = np.full((count, len(given.rows) + 2 * hands), -np.inf)
        squares = np.full((count, 2 * hands), np.inf)
        lower[:, : -2 * hands] = -upper
        for k in np.flatnonzero(self.allowed).tolist():
            own = np.where([0 in given.rows, 3 in given.rows], np.square(given.allowed[k]), np.inf)
            squares[k] = np.tile(own, hands)
        share = np.full(count, 1.0 / count)
        return Block(
            given.terms, places, np.vstack(rows), lower, np.hstack([upper, squares]), share
        )

    def speed_rows(self, intervals: Array) -> tuple[scipy.sparse.coo_array, Array]:
        """Return matrices A (rows, size) and B (rows, intervals): A x <= 1 + B sigma bounds mean
        speeds.

        x are the positions, sigma the relative times added to the intervals. The means are those
        over the halves of the movements, which leaves the paths in between as they are.

        Args:
            intervals: for each movement the share of each interval in its duration, (m, intervals).
        """
        breakpoints = self.grid.breakpoints
        halves = list[tuple[int, int, int]]()
        for number, (first, last) in enumerate(pairwise([0, *self.last_segments])):
            middle = np.abs(2.0 * breakpoints - breakpoints[first] - breakpoints[last]).argmin()
            edges = dict.fromkeys([first, int(middle), last])
            halves += [(number, *pair) for pair in pairwise(edges)]
        numbers, begins, ends = np.array(halves).T
        speed = self.waypoints.speed[numbers]
        half, joint = np.nonzero(np.isfinite(speed))
        seconds = self.moving_time * (breakpoints[ends] - breakpoints[begins])[half]
        entries = 1.0 / (speed[half, joint] * seconds)
        rows = np.arange(half.size)
        columns = [self.grid.degree * self.dof * at[half] + joint for at in (ends, begins)]
        places = np.tile(rows, 2), np.concatenate(columns)
        given = np.concatenate([entries, -entries]), places
        step = scipy.sparse.coo_array(given, (half.size, self.size))
        both = scipy.sparse.vstack([step, -step], format="coo")
        return both, np.tile(intervals[numbers[half]], (2, 1))

    def nodes_on_lines(self, q: Array) -> Array:
        """Return positions at the nodes (size, n) on the straight lines between waypoints (m + 1,
        n).
        """
        edges = self.grid.breakpoints[[0, *self.last_segments]]
        return np.column_stack(
            [np.interp(self.grid.nodes, edges, q[:, joint]) for joint in range(self.dof)]
        )

    def path(self, nodes: Array) -> Path:
        """Return the whole path through the nodes (size, n)."""
        return Path(metric_of(self.waypoints.arm), self.grid, nodes)

    def paths(self, nodes: Array) -> list[Path]:
        """Return the path of each movement."""
        grid = self.grid
        found = []
        for first, last in pairwise([0, *self.last_segments]):
            ends = grid.breakpoints[first : last + 1]
            ends = (ends - ends[0]) / (ends[-1] - ends[0])
            several = tuple(ends.tolist()) if last - first > 1 else None
            here = nodes[grid.degree * first : grid.degree * last + 1]
            part = Grid(last - first, grid.degree, several)
            found.append(Path(metric_of(self.waypoints.arm), part, here))
        return found


_IPOPT: Mapping[str, Any] = {
    "tol": 1e-7,
    "gamma_theta": 0.9,
    "max_soc": 0,
    "mu_init": 1e-2,
    "max_iter": 1000,
}
# Distances that enter begin far below their bounds.
_APART: Mapping[str, Any] = {**_IPOPT, "bound_mult_init_method": "mu-based"}
TOO_NEAR = 300.0  # weight of a distance below its bound [1/m]
_NEAR: Mapping[str, Any] = {
    **_IPOPT,
    **{"mu_init": 1e-5, "bound_push": 1e-7, "bound_frac": 1e-7},
    **{"slack_bound_push": 1e-7, "slack_bound_frac": 1e-7, "bound_mult_init_method": "mu-based"},
}


@dataclass(frozen=True, eq=False)
class MotionProgram:
    """The program of all arms.

    Attributes:
        parts: parts of the arms.
        edges: times (i + 1,) [s] in the recording between which time may be added.
        weights: weights of the objective.
        clearance: distances of links; None: none.
        rows: lower bounds [m] of those distances that are kept, by their number in the clearance
            and the time [s] in the recording.
    """

    parts: Sequence[ArmPart]
    edges: Array
    weights: ObjectiveWeights
    clearance: Clearance
    rows: Mapping[tuple[int, float], float] = field(default_factory=dict)

    @cached_property
    def offsets(self) -> list[int]:
        """Indices at which the variables of each arm, of added times and of the slack begin."""
        sizes = [*(part.size for part in self.parts), len(self.edges) - 1]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def size(self) -> int:
        """Number of variables: nodes, added times, slack of the distances."""
        return self.offsets[-1] + len(self.rows)

    @cached_property
    def _speed_rows(self) -> tuple[scipy.sparse.csr_array, Array]:
        """A (rows, nodes of all arms) and B (rows, intervals): A x <= 1 + B sigma."""
        steps = np.diff(self.edges)
        found = []
        for part in self.parts:
            begins, ends = (each[:, None] for each in (part.waypoints.begins, part.waypoints.ends))
            inside = (self.edges[:-1] >= begins - 1e-9) & (self.edges[1:] <= ends + 1e-9)
            found.append(part.speed_rows(np.where(inside, steps, 0.0) / (ends - begins)))
        by_nodes = scipy.sparse.block_diag([each for each, _ in found], format="csr")
        return by_nodes, np.vstack([each for _, each in found])

    @cached_property
    def program(self) -> BlockProgram:
        """The blocks of all terms."""
        blocks = []
        for part, first in zip(self.parts, self.offsets, strict=False):
            blocks += part.blocks(first, self.weights)
        cost = self.weights.stretch * np.diff(self.edges) / self.weights.duration
        added = np.concatenate([cost, np.full(len(self.rows), TOO_NEAR)])
        at = np.arange(self.offsets[-2], self.size)
        blocks.append(Block(linear_terms(), at[:, None], added[:, None]))
        by_nodes, by_time = self._speed_rows
        if rows := by_nodes.shape[0]:
            slack = scipy.sparse.csr_array((rows, len(self.rows)))
            both = scipy.sparse.hstack([by_nodes, -by_time, slack], format="csr")
            lower = np.full((rows, 1), -np.inf)
            upper = np.ones((rows, 1))
            blocks.append(Block(_identity(), both, None, lower, upper))
        return BlockProgram(self.size, blocks + (self._distances() if self.rows else []))

    @cached_property
    def _groups(self) -> dict[ca.Function, list[tuple[int, float]]]:
        """The distances by their functions, in order."""
        found: dict[ca.Function, list[tuple[int, float]]] = {}
        for row in sorted(self.rows):
            found.setdefault(self.clearance.part(row[0]).function, []).append(row)
        return found

    def _lower_distances(self) -> Array:
        """Lower bounds of the distances, in the order of their slacks."""
        return np.array([self.rows[row] for group in self._groups.values() for row in group])

    def _distances(self) -> list[Block]:
        times = {time: number for number, time in enumerate({time for _, time in self.rows})}
        every = places_at(self.parts, self.size, np.array(list(times)))
        dof = self.clearance.dof
        slack = every.shape[0]
        every = scipy.sparse.vstack(
            [every, scipy.sparse.eye_array(self.size, format="csr")[self.offsets[-1] :]], "csr"
        )
        blocks = []
        for function, group in self._groups.items():
            places = []
            values = []
            for number, time in group:
                part = self.clearance.part(number)
                places.append([*(dof * times[time] + np.array(part.columns)), slack])
                values.append(part.numbers)
                slack += 1
            lower = np.array([[self.rows[row]] for row in group])
            blocks.append(
                Block(
                    distance_terms(function),
                    every[np.ravel(places)],
                    np.array(values),
                    lower,
                    np.full_like(lower, np.inf),
                )
            )
        return blocks

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables."""
        bounds = [part.bounds for part in self.parts]
        count = self.size - self.offsets[-2]
        return (
            np.concatenate([*(each.lower.ravel() for each in bounds), np.zeros(count)]),
            np.concatenate([*(each.upper.ravel() for each in bounds), np.full(count, np.inf)]),
        )

    def guess(self, nodes: Sequence[Array], sigma: Array | None = None) -> Array:
        """Return variables of positions at the nodes of each arm, with enough time for their
        speeds.
        """
        x = np.concatenate([each.ravel() for each in nodes])
        if sigma is None:
            by_nodes, shares = self._speed_rows
            needed = np.maximum(by_nodes @ x - 1.0, 0.0)
            sigma = np.where(shares > 0.0, needed[:, None], 0.0).max(axis=0, initial=0.0)
        x = np.concatenate([x, sigma, np.zeros(len(self.rows))])
        if self.rows:
            g = self.program.functions["nlp"](x, [])[1].full()[-len(self.rows) :, 0]
            x[self.offsets[-1] :] = np.maximum(self._lower_distances() - g, 0.0)
        return x

    def solve(self, start: Array, near: bool = False) -> Outcome:
        """Return Ipopt's result from a start; `near` tells that it is nearly a solution."""
        options = _NEAR if near else _APART if self.rows else _IPOPT
        return self.program.solve(start, self.bounds, options)

    def split(self, x: Array) -> tuple[list[Array], Array]:
        """Return positions at the nodes of each arm (size, n), and the relative times added."""
        pairs = zip(self.parts, self.offsets, strict=False)
        nodes = [x[at : at + part.size].reshape(-1, part.dof) for part, at in pairs]
        return nodes, np.maximum(x[self.offsets[-2] : self.offsets[-1]], 0.0)


_HAND = 0.3  # weight of the hand's distance or angle from the person's, in units of the tolerance


@lru_cache(maxsize=16)
def _off_the_hands(arm: Model, hands: tuple[str, ...]) -> Terms:
    """Return a cost of the distance x and angle y of each hand from the person's, in units of the
    tolerance.

    sqrt(1 + x^2) - 1 + sqrt(1 + y^2) - 1: squares nearby and proportional far off, so that a detour
    that cannot be avoided does not become slow.
    """
    count = len(hands)
    cost = ca.SX(0)
    q = ca.SX.sym("q", arm.dof)
    p = ca.SX.sym("p", 12 * count + 2)
    position, rotation, units = ca.vertsplit(p, [0, 3 * count, 12 * count, 12 * count + 2])
    rotation = ca.reshape(rotation, 3 * count, 3)
    for number, hand in enumerate(hands):
        own = slice(3 * number, 3 * number + 3)
        hand_rotation, hand_position = arm.frame_pose(hand, q)
        # |R - R'|^2 / 2 = 2 (1 - cos y), nearly y^2
        squares = (
            ca.sumsqr(hand_position - position[own]),
            ca.sumsqr(hand_rotation - rotation[own, :]) / 2.0,
        )
        for unit, square in zip(ca.vertsplit(units), squares, strict=True):
            cost += ca.sqrt(1.0 + unit**2 * square) - 1.0
    return Terms(q, p, cost)


@lru_cache(maxsize=16)
def _weak_joints(arm: Model, alignment: Alignment, torque: tuple[float, ...]) -> Terms:
    """Return the cost of joints that holding the arm takes much of their limits on torque."""
    q = ca.SX.sym("q", arm.dof)
    return Terms(q, objective=weakness(arm, q, torque, gravity_on(alignment), [TOO_WEAK]))


@lru_cache(maxsize=1)
def linear_terms() -> Terms:
    """Return a variable times its weight, in the objective."""
    x = ca.SX.sym("x")
    weight = ca.SX.sym("weight")
    return Terms(x, weight, weight * x)


@lru_cache(maxsize=1)
def _identity() -> Terms:
    """Return a bounded sum of variables."""
    x = ca.SX.sym("x")
    return Terms(x, constraints=x)


@lru_cache(maxsize=256)
def distance_terms(function: ca.Function) -> Terms:
    """Return a distance, see `DistancePart`, and its slack."""
    q, *numbers = function.sx_in()
    slack = ca.SX.sym("slack")
    given = ca.vertcat(q, slack), ca.vertcat(ca.SX(0, 1), *numbers)
    return Terms(*given, 0.0, function(q, *numbers) + slack)
