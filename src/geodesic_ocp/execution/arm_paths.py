"""The paths of arms that move side by side, over knots in time, and splines through the knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.path import Path

OUTSIDE = 5e-7  # [rad or m]; lets a path touch its position limits


@dataclass(frozen=True, eq=False, repr=False)
class ArmPaths(ShortRepr):
    """The paths of one arm, to be travelled one after the other.

    Attributes:
        robot: the arm; its mass matrix, payload included, is the one that torques are made of.
        limits: limits of its joints.
        edges: times (k + 1,) [s] in the recording at which its k paths begin and end.
        paths: k of them; of zero length where the arm rests. Each begins where the one before ends.
        gravity: acceleration of free fall in the axes of the robot's base (3,) [m/s^2].
        progress: times (m,) in the recording [s], and how far the person has come by then (m,), in
            any unit, increasing: timing that the robot should have on every path; None: any.
    """

    robot: Model
    limits: JointLimits
    edges: Array
    paths: Sequence[Path]
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    progress: tuple[Array, Array] | None = None

    _shown = ("robot", "edges")

    @cached_property
    def ends(self) -> Array:
        """Configurations at the ends of the k paths (k + 1, n)."""
        return np.array([*(path(0.0) for path in self.paths), self.paths[-1](1.0)])

    @cached_property
    def ranges(self) -> tuple[Array, Array]:
        """Ranges of the joints (n,), just outside the limits, and beyond the ends of paths."""
        lower = np.minimum(self.robot.lower, self.ends.min(axis=0)) - OUTSIDE
        upper = np.maximum(self.robot.upper, self.ends.max(axis=0)) + OUTSIDE
        return lower, upper


def joint_names(arms: Sequence[ArmPaths]) -> tuple[str, ...]:
    """Return joint names of all arms, after the number of the arm if two arms share a name."""
    names = [name for arm in arms for name in arm.robot.joint_names]
    if len(set(names)) == len(names):
        return tuple(names)
    numbered = enumerate(arms)
    return tuple(f"{k}/{name}" for k, arm in numbered for name in arm.robot.joint_names)


def joint_forces(
    robots: Sequence[Model], gravities: Sequence[Array], q: Array, v: Array, a: Array
) -> Array:
    """Return inverse dynamics of robots side by side at a state (N,) or at states (k, N) [N m or
    N].
    """
    ends = np.cumsum([robot.dof for robot in robots])[:-1]
    states = (np.split(each, ends, axis=-1) for each in (q, v, a))
    forces = [
        robot.inverse_dynamics(own_q, own_v, own_a, gravity)
        for robot, gravity, own_q, own_v, own_a in zip(robots, gravities, *states, strict=True)
    ]
    return np.concatenate(forces, axis=-1)


def hand_speeds(robot: Model, q: Array, v: Array) -> Array:
    """Return speeds |J(q) v| of the hand, the largest of a body's, at states (k, n), (k,) [m/s]."""
    velocities = at_rows(hand_velocity(robot), q, v).reshape(len(q), -1, 3)
    return np.asarray(np.linalg.norm(velocities, axis=2).max(axis=1))


@lru_cache(maxsize=16)
def hand_velocity(robot: Model) -> ca.Function:
    """Return (q, v) -> J(q) v, the stacked velocities of the h hands (3 h,) [m/s]."""
    q = ca.SX.sym("q", robot.dof)
    v = ca.SX.sym("v", robot.dof)
    places = robot.stacked_poses(robot.hands, q)[1]
    return ca.Function("velocity", [q, v], [ca.jtimes(places, q, v)])


@dataclass(frozen=True, eq=False)
class KnotStates:
    """Values of a program's variables.

    Attributes:
        durations: durations of the intervals (m,) [s].
        arms: positions, velocities and accelerations of every arm, (3, knots, n) each.
    """

    durations: Array
    arms: tuple[Array, ...]


INSIDE = 1e-5  # how far inside the limits a program stays, relative

_SPACING = 0.04  # of knots [s]
# pieces of an interval, and about as many of all intervals together
_LEAST = 4
_MOST = 360
SAME = 1e-6  # edges of two arms that are no further apart [s] are one


@dataclass(frozen=True, eq=False)
class Knots:
    """Knots that divide the intervals between edges into pieces of equal durations.

    Attributes:
        edges: edges of all arms (m + 1,) in the recording's time [s].
        pieces: pieces of every interval (m,).
    """

    edges: Array
    pieces: np.ndarray

    @classmethod
    def spaced(cls, edges: Array, durations: Array, times: float = 1.0) -> Knots:
        """Return about 40 ms apart, or so many times that, when the intervals (m,) between edges
        (m + 1,) take these durations.
        """
        spacing = times * max(_SPACING, float(durations.sum()) / _MOST)
        return cls(edges, np.maximum(np.ceil(durations / spacing), _LEAST).astype(int))

    @property
    def person(self) -> Array:
        """Durations (m,) of the intervals in the recording [s]."""
        return np.asarray(np.diff(self.edges))

    @property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.pieces.sum())

    @cached_property
    def interval(self) -> np.ndarray:
        """Number of the interval of every piece, (count,)."""
        return np.repeat(np.arange(self.pieces.size), self.pieces)

    @cached_property
    def fraction(self) -> Array:
        """Duration of every piece as a fraction of its interval's, (count,)."""
        return np.asarray(1.0 / self.pieces[self.interval])

    @cached_property
    def at_edges(self) -> np.ndarray:
        """Numbers of the knots at the edges (m + 1,)."""
        return np.concatenate([[0], np.cumsum(self.pieces)])

    def of(self, edges: Array) -> np.ndarray:
        """Return numbers of the knots at some of the edges, by their times."""
        nearest = np.abs(self.edges[:, None] - edges).argmin(axis=0)
        return np.asarray(self.at_edges[nearest])

    def steps(self, durations: Array) -> Array:
        """Return durations of the pieces (count,) for durations (m,) of the intervals [s]."""
        return np.asarray(durations[self.interval] * self.fraction)

    def times(self, durations: Array) -> Array:
        """Return times of the knots (count + 1,) for durations (m,) of the intervals [s]."""
        return np.concatenate([[0.0], np.cumsum(self.steps(durations))])


def union_of_edges(arms: Sequence[ArmPaths]) -> Array:
    """Return times (m + 1,) in the recording at which any arm's path begins or ends [s]."""
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > SAME])])


_SAMPLES = 201  # of a path, to find its nearest point
_ALONG = 0.02  # of the squared deviation along the path that counts: it is a matter of timing
# With a known timing, paths count in this direction as if they were at most this long [rad or m].
_TIMED = 0.2
_ISOTROPIC = 0.3  # of the mean inertia, for joints that carry next to none
_STILL = 1e-9  # [rad or m]: a path that is no longer is a rest


class Reference(NamedTuple):
    """Points of an arm's paths, one for every knot.

    Attributes:
        positions: positions of the paths (k, n).
        weights: matrices (k, n, n) whose quadratic forms are squared distances from the paths.
    """

    positions: Array
    weights: Array


def _ratio(numerator: Array, denominator: Array) -> Array:
    """Return the ratio, zero where the denominator is zero."""
    out = np.zeros(np.broadcast_shapes(numerator.shape, denominator.shape))
    return np.asarray(np.divide(numerator, denominator, out=out, where=denominator != 0.0))


@dataclass(frozen=True, eq=False)
class Course:
    """The paths of one arm over the knots.

    Attributes:
        arm: arm with its paths.
        knots: knots of the trajectory.
    """

    arm: ArmPaths
    knots: Knots

    @cached_property
    def at(self) -> np.ndarray:
        """Numbers of the knots (k + 1,) at the ends of the arm's k paths."""
        return self.knots.of(self.arm.edges)

    @cached_property
    def resting(self) -> NDArray[np.bool_]:
        """True if the arm rests on each of its paths, (k,)."""
        moved = [np.ptp(path.nodes, axis=0).max() for path in self.arm.paths]
        return np.array(moved) <= _STILL

    @cached_property
    def path_of(self) -> np.ndarray:
        """Number of the path of every knot (knots,); a knot at a junction begins the next path."""
        numbers = np.repeat(np.arange(self.at.size - 1), np.diff(self.at))
        return np.append(numbers, numbers[-1])

    @cached_property
    def pieces_at_rest(self) -> NDArray[np.bool_]:
        """Pieces in which the arm rests, (pieces,)."""
        return np.asarray(self.resting[self.path_of[:-1]])

    @property
    def knots_at_rest(self) -> NDArray[np.bool_]:
        """Knots at which the arm rests, at the ends of rests as well, (knots,)."""
        rests = self.pieces_at_rest
        return np.asarray(np.append(rests, False) | np.append(False, rests))

    def as_recorded(self, rest: bool, stops: bool = False) -> Reference:
        """Return the paths with smooth progress in the recording's time, slowed down in their
        corners.

        Args:
            rest: whether the arm is at rest at both ends.
            stops: whether it stops in every corner.
        """
        # Knots are evenly spaced in an interval however long it takes.
        time = self.knots.edges[0] + self.knots.times(self.knots.person)
        own = self.path_of
        edges = self.arm.edges
        unit = np.clip((time - edges[own]) / np.diff(edges)[own], 0.0, 1.0)
        first, last = self._slopes(rest, stops)[own].T
        # The cubic Hermite polynomial from 0 to 1.
        s = unit**2 * (3.0 - 2.0 * unit) + unit * (1.0 - unit) * (
            first * (1.0 - unit) - last * unit
        )
        return self._at(np.clip(s, 0.0, 1.0))

    @cached_property
    def _timing(self) -> tuple[Array, Array] | None:
        """Matrices (knots, n, n) of the squared distances, along the paths alone, from points as
        far along every path as the person was, and their products with these points (knots, n).
        """
        if self.arm.progress is None:
            return None
        time = self.knots.edges[0] + self.knots.times(self.knots.person)
        own = self.path_of
        upto, ends = (np.interp(each, *self.arm.progress) for each in (time, self.arm.edges))
        positions, _, along, squares = self._along(
            np.clip((upto - ends[own]) / np.diff(ends)[own], 0.0, 1.0)
        )
        share = np.minimum(_ratio(np.full_like(squares, _TIMED**2), squares), 1.0)
        matrices = share[:, None, None] * along
        return matrices, np.einsum("kij,kj->ki", matrices, positions)

    def timed(self, reference: Reference) -> Reference:
        """Return the reference with the person's timing, if it is known."""
        if self._timing is None:
            return reference
        matrices, products = self._timing
        products = products + np.einsum("kij,kj->ki", reference.weights, reference.positions)
        weights = reference.weights + matrices
        return Reference(np.linalg.solve(weights, products[..., None])[..., 0], weights)

    def nearest(self, positions: Array) -> Reference:
        """Return the points of the paths nearest to positions (knots, n), in order along every
        path.
        """
        s = np.zeros(len(positions))
        grid = np.linspace(0.0, 1.0, _SAMPLES)
        for path, (first, last) in zip(self.arm.paths, pairwise(self.at), strict=True):
            inner = slice(first + 1, last)
            samples = path(grid)
            factor = np.linalg.cholesky(self._metrics(samples[_SAMPLES // 2, None])[0])
            found = cdist(positions[inner] @ factor, samples @ factor).argmin(axis=1)
            s[inner] = np.maximum.accumulate(grid[found])
        s[-1] = 1.0
        return self.timed(self._at(s))

    def _at(self, s: Array) -> Reference:
        """Return the points at path parameters s (knots,); at a junction the next path begins.

        Deviations along a path hardly count, except where the arm rests and at the ends, beyond
        which they would lead.
        """
        positions, metrics, along, _ = self._along(s)
        return Reference(positions, metrics - (1.0 - _ALONG) * along)

    def _along(self, s: Array) -> tuple[Array, Array, Array, Array]:
        """Return points, metrics and their parts along the paths, and squared speeds along them."""
        s = s.copy()
        s[self.at[:-1]] = 0.0
        positions, tangents = np.empty((2, s.size, self.arm.robot.dof))
        for number, path in enumerate(self.arm.paths):
            here = self.path_of == number
            positions[here], tangents[here] = path(s[here]), path(s[here], 1)
        tangents[(s == 0.0) | (s == 1.0) | self.resting[self.path_of]] = 0.0
        metrics = self._metrics(positions)
        covectors = np.einsum("kij,kj->ki", metrics, tangents)
        squares = np.einsum("ki,ki->k", covectors, tangents)
        shares = _ratio(np.ones_like(squares), squares)
        return positions, metrics, np.einsum("ki,kj,k->kij", covectors, covectors, shares), squares

    def _metrics(self, q: Array) -> Array:
        """Return G(q) + a I relative to its mean diagonal, (k, n, n), at configurations (k, n)."""
        matrices = self.arm.robot.mass_matrix(q)
        matrices = matrices / np.diagonal(matrices, axis1=1, axis2=2).mean()
        return np.asarray(matrices + _ISOTROPIC * np.eye(self.arm.robot.dof))

    def _slopes(self, rest: bool, stops: bool) -> Array:
        """Get derivatives (k, 2) of the parameter of every path at its ends, over its duration."""
        durations = np.diff(self.arm.edges)
        lengths = np.array([path.length for path in self.arm.paths])
        speeds = np.zeros(lengths.size + 1)
        mean = lengths / durations
        if not stops:
            harmonic = _ratio(2.0 * mean[:-1] * mean[1:], mean[:-1] + mean[1:])
            speeds[1:-1] = harmonic * [self._cosine(*each) for each in pairwise(self.arm.paths)]
        if not rest:
            speeds[[0, -1]] = mean[[0, -1]]
        both = np.stack([speeds[:-1], speeds[1:]], axis=1)
        return np.minimum(both * _ratio(durations, lengths)[:, None], 3.0)

    def _cosine(self, before: Path, after: Path) -> float:
        """Return the cosine of the angle between successive paths in the metric, at least zero."""
        metric = self.arm.robot.mass_matrix(after(0.0))
        incoming = before(1.0, 1)
        outgoing = after(0.0, 1)
        norm = np.sqrt((incoming @ metric @ incoming) * (outgoing @ metric @ outgoing))
        return float(max(incoming @ metric @ outgoing / norm, 0.0)) if norm > 0.0 else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class JointSpline(ShortRepr):
    """Joints over time, with constant jerk between knots.

    Attributes:
        curve: cubic spline of the positions (n,).
    """

    curve: CubicSpline
    _shown = ("duration",)

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.curve.x[-1])

    def __call__(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Return positions, velocities, accelerations and jerks at times within the spline (m,)."""
        q, v, a, j = (self.curve(time, order) for order in range(4))
        return q, v, a, j

    def within_pieces(self, count: int) -> Array:
        """Return evenly spaced times in every piece, both ends included, (k, count)."""
        return np.asarray(np.linspace(self.curve.x[:-1], self.curve.x[1:], count, axis=1))

    @cached_property
    def extreme_velocities(self) -> Array:
        """Largest magnitudes of the velocities in every piece, (k, n)."""
        # of a t^2 + 2 b t + c
        a = 3.0 * self.curve.c[0]
        b = self.curve.c[1]
        low, high = self._extremes(self.curve.derivative().c, [-_ratio(b, a)])
        return np.maximum(np.abs(low), np.abs(high))

    @cached_property
    def extreme_positions(self) -> tuple[Array, Array]:
        """Smallest and largest positions in every piece, (k, n) each."""
        a = 3.0 * self.curve.c[0]
        b = self.curve.c[1]
        c = self.curve.c[2]
        # Roots of the velocity a t^2 + 2 b t + c, in the form that does not cancel.
        both = -(b + np.copysign(np.sqrt(np.maximum(b**2 - a * c, 0.0)), b))
        return self._extremes(self.curve.c, [_ratio(both, a), _ratio(c, both)])

    def _extremes(self, powers: Array, turns: Sequence[Array]) -> tuple[Array, Array]:
        """Get least and largest values of polynomials in pieces (k, n) at their ends and turns."""
        end = np.broadcast_to(np.diff(self.curve.x)[:, None], powers.shape[1:])
        times = [0.0 * end, end, *(np.clip(turn, 0.0, end) for turn in turns)]
        values = [np.polyval(powers, t) for t in times]
        return np.min(values, axis=0), np.max(values, axis=0)


# how often time is stretched, and by how much at once
_ROUNDS = 8
_AT_MOST = 1.5
_CORNERS = 3.0  # times the limit that accelerations may have in corners, which will be rounded


def through(
    references: Sequence[Reference], knots: Knots, durations: Array, rest: bool
) -> KnotStates:
    """Return cubic splines through the references for durations of the intervals."""
    time = knots.times(durations)
    states = []
    for positions, _ in references:
        spline = CubicSpline(time, positions, bc_type="clamped" if rest else "natural")
        states.append(np.array([positions, spline(time, 1), spline(time, 2)]))
    return KnotStates(durations, tuple(states))


def stretched(
    arms: Sequence[ArmPaths], references: Sequence[Reference], knots: Knots, rest: bool
) -> Array:
    """Return durations (m,) of the intervals in which the references nearly keep the limits [s]."""
    durations = knots.person
    for _ in range(_ROUNDS):
        ratio = np.zeros(knots.count + 1)
        guess = through(references, knots, durations, rest)
        for arm, (positions, velocities, accelerations) in zip(arms, guess.arms, strict=True):
            speed = np.abs(velocities) / arm.limits.velocity
            growth = np.abs(accelerations) / (_CORNERS * arm.limits.acceleration)
            ratio = np.maximum(ratio, np.maximum(speed, np.sqrt(growth)).max(axis=1))
            if np.isfinite(arm.limits.hand_speed):
                fast = hand_speeds(arm.robot, positions, velocities) / arm.limits.hand_speed
                ratio = np.maximum(ratio, fast)
        ends = pairwise(knots.at_edges)
        needed = np.array([ratio[first : last + 1].max() for first, last in ends])
        if np.all(needed <= 1.0):
            break
        durations = durations * np.clip(1.05 * needed, 1.0, _AT_MOST)
    return durations
