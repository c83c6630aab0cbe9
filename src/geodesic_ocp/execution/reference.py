"""Knots in time, paths over them, and the first guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.execution.arm_paths import ArmPaths


@dataclass(frozen=True, eq=False)
class KnotStates:
    """Values of a program's variables.

    Attributes:
        durations: durations of the intervals (m,) [s].
        positions, velocities, accelerations: positions, velocities and accelerations of every arm,
            (knots, n) each.
    """

    durations: Array
    positions: tuple[Array, ...]
    velocities: tuple[Array, ...]
    accelerations: tuple[Array, ...]


INSIDE = 1e-5  # how far inside the limits a program stays, relative

_SPACING = 0.04  # of knots [s]
_LEAST, _MOST = 4, 360  # pieces of an interval, and about as many of all intervals together
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
    def spaced(cls, edges: Array, durations: Array) -> Knots:
        """Return about 40 ms apart when the intervals (m,) between edges (m + 1,) take these
        durations.
        """
        spacing = max(_SPACING, float(durations.sum()) / _MOST)
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

    def times(self, durations: Array) -> Array:
        """Return times of the knots (count + 1,) for durations (m,) of the intervals [s]."""
        steps = durations[self.interval] * self.fraction
        return np.concatenate([[0.0], np.cumsum(steps)])


def union_of_edges(arms: Sequence[ArmPaths]) -> Array:
    """Return times (m + 1,) in the recording at which any arm's path begins or ends [s]."""
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > SAME])])


_SAMPLES = 201  # of a path, to find its nearest point
_ALONG = 0.02  # of the squared deviation along the path that counts: it is a matter of timing
_ISOTROPIC = 0.3  # of the mean inertia, for joints that carry next to none
_STILL = 1e-9  # [rad or m]: a path that is no longer is a rest


@dataclass(frozen=True, eq=False)
class Reference:
    """Points of an arm's paths, one for every knot.

    Attributes:
        positions: positions of the paths (k, n).
        tangents: derivatives of the paths by s there (k, n); zero where the arm rests, and where
            a deviation along the path would lead beyond its end.
    """

    positions: Array
    tangents: Array

    def weights(self, arm: ArmPaths) -> Array:
        """Return matrices (k, n, n) whose quadratic forms are squared distances from the paths.

        In the metric G + a I relative to its mean diagonal, almost none along the path.
        """
        metric = np.array([arm.robot.mass_matrix(q) for q in self.positions])
        metric = metric / np.diagonal(metric, axis1=1, axis2=2).mean()
        metric = metric + _ISOTROPIC * np.eye(arm.robot.dof)
        covectors = np.einsum("kij,kj->ki", metric, self.tangents)
        squares = np.einsum("ki,ki->k", covectors, self.tangents)
        share = _ratio(np.full_like(squares, 1.0 - _ALONG), squares)
        return np.asarray(metric - np.einsum("ki,kj,k->kij", covectors, covectors, share))


def _ratio(numerator: Array, denominator: Array) -> Array:
    """Zero where the denominator is zero."""
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
        own, edges = self.path_of, self.arm.edges
        unit = np.clip((time - edges[own]) / np.diff(edges)[own], 0.0, 1.0)
        first, last = self._slopes(rest, stops)[own].T
        # The cubic Hermite polynomial from 0 to 1.
        s = unit**2 * (3.0 - 2.0 * unit) + unit * (1.0 - unit) * (
            first * (1.0 - unit) - last * unit
        )
        return self._at(np.clip(s, 0.0, 1.0))

    def nearest(self, positions: Array) -> Reference:
        """Return the points of the paths nearest to positions (knots, n), in order along every
        path.
        """
        s = np.zeros(len(positions))
        grid = np.linspace(0.0, 1.0, _SAMPLES)
        for path, (first, last) in zip(self.arm.paths, pairwise(self.at), strict=True):
            inner, samples = slice(first + 1, last), path(grid)
            metric = self.arm.robot.mass_matrix(samples[_SAMPLES // 2])
            metric = metric / np.diag(metric).mean() + _ISOTROPIC * np.eye(len(metric))
            factor = np.linalg.cholesky(metric)
            found = cdist(positions[inner] @ factor, samples @ factor).argmin(axis=1)
            s[inner] = np.maximum.accumulate(grid[found])
        s[-1] = 1.0
        return self._at(s)

    def _at(self, s: Array) -> Reference:
        """Get at path parameters s (knots,); a knot at a junction is where the next path begins."""
        s = s.copy()
        s[self.at[:-1]] = 0.0
        positions, tangents = np.empty((2, s.size, self.arm.robot.dof))
        for number, path in enumerate(self.arm.paths):
            here = self.path_of == number
            positions[here], tangents[here] = path(s[here]), path(s[here], 1)
        tangents[(s == 0.0) | (s == 1.0) | self.resting[self.path_of]] = 0.0
        return Reference(positions, tangents)

    def _slopes(self, rest: bool, stops: bool) -> Array:
        """Get derivatives (k, 2) of the parameter of every path at its ends, over its duration."""
        durations = np.diff(self.arm.edges)
        lengths = np.array([path.length for path in self.arm.paths])
        speeds = np.zeros(lengths.size + 1)
        mean = lengths / durations
        if not stops:
            harmonic = _ratio(2.0 * mean[:-1] * mean[1:], mean[:-1] + mean[1:])
            speeds[1:-1] = harmonic * self._cosines()
        if not rest:
            speeds[[0, -1]] = mean[[0, -1]]
        both = np.stack([speeds[:-1], speeds[1:]], axis=1)
        return np.minimum(both * _ratio(durations, lengths)[:, None], 3.0)

    def _cosines(self) -> Array:
        """Return cosines of the angles between successive paths in the metric, at least zero, (k -
        1,).
        """
        found = []
        for before, after in pairwise(self.arm.paths):
            metric = self.arm.robot.mass_matrix(after(0.0))
            incoming, outgoing = before(1.0, 1), after(0.0, 1)
            norm = np.sqrt((incoming @ metric @ incoming) * (outgoing @ metric @ outgoing))
            found.append(max(incoming @ metric @ outgoing / norm, 0.0) if norm > 0.0 else 0.0)
        return np.array(found)


@dataclass(frozen=True, eq=False, repr=False)
class JointSpline(ShortRepr):
    """Joints over time, with constant jerk between knots.

    Attributes:
        curve: cubic spline of the positions (n,).
    """

    curve: CubicSpline
    _shown = ("duration",)

    @classmethod
    def through(cls, time: Array, positions: Array, ends: Array) -> JointSpline:
        """Return through positions (k + 1, n) at times (k + 1,) [s], with end velocities (2, n)."""
        return cls(CubicSpline(time, positions, bc_type=((1, ends[0]), (1, ends[1]))))

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
        a, b = 3.0 * self.curve.c[0], self.curve.c[1]  # of a t^2 + 2 b t + c
        low, high = self._extremes(self.curve.derivative().c, [-_ratio(b, a)])
        return np.maximum(np.abs(low), np.abs(high))

    @cached_property
    def extreme_positions(self) -> tuple[Array, Array]:
        """Smallest and largest positions in every piece, (k, n) each."""
        a, b, c = 3.0 * self.curve.c[0], self.curve.c[1], self.curve.c[2]
        # Roots of the velocity a t^2 + 2 b t + c, in the form that does not cancel.
        both = -(b + np.copysign(np.sqrt(np.maximum(b**2 - a * c, 0.0)), b))
        return self._extremes(self.curve.c, [_ratio(both, a), _ratio(c, both)])

    def _extremes(self, powers: Array, turns: Sequence[Array]) -> tuple[Array, Array]:
        """Get least and largest values of polynomials in pieces (k, n) at their ends and turns."""
        end = np.broadcast_to(np.diff(self.curve.x)[:, None], powers.shape[1:])
        times = [0.0 * end, end, *(np.clip(turn, 0.0, end) for turn in turns)]
        values = [np.polyval(powers, t) for t in times]
        return np.min(values, axis=0), np.max(values, axis=0)


_ROUNDS, _AT_MOST = 8, 1.5  # how often time is stretched, and by how much at once
_CORNERS = 3.0  # times the limit that accelerations may have in corners, which will be rounded


def through(
    references: Sequence[Reference], knots: Knots, durations: Array, rest: bool
) -> KnotStates:
    """Return cubic splines through the references for durations of the intervals."""
    time = knots.times(durations)
    ends = "clamped" if rest else "natural"
    splines = [CubicSpline(time, each.positions, bc_type=ends) for each in references]
    return KnotStates(
        durations,
        tuple(each.positions for each in references),
        tuple(spline(time, 1) for spline in splines),
        tuple(spline(time, 2) for spline in splines),
    )


def stretched(
    arms: Sequence[ArmPaths], references: Sequence[Reference], knots: Knots, rest: bool
) -> Array:
    """Return durations (m,) of the intervals in which the references nearly keep the limits [s]."""
    durations = knots.person
    for _ in range(_ROUNDS):
        guess = through(references, knots, durations, rest)
        ratio = np.zeros(knots.count + 1)
        for k, arm in enumerate(arms):
            speed = np.abs(guess.velocities[k]) / arm.limits.velocity
            growth = np.abs(guess.accelerations[k]) / (_CORNERS * arm.limits.acceleration)
            ratio = np.maximum(ratio, np.maximum(speed, np.sqrt(growth)).max(axis=1))
        ends = pairwise(knots.at_edges)
        needed = np.array([ratio[first : last + 1].max() for first, last in ends])
        if np.all(needed <= 1.0):
            break
        durations = durations * np.clip(1.05 * needed, 1.0, _AT_MOST)
    return durations
