"""Knots in time, paths over them, and the first guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.execution.arm_paths import ArmPaths


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


INSIDE = 1e-5  # how far inside the limits a program stays, relative

_SPACING = 0.04  # of knots [s]
_LEAST, _MOST = 4, 360  # pieces of an interval, and about as many of all intervals together
SAME = 1e-6  # edges of two arms that are no further apart [s] are one


@dataclass(frozen=True, eq=False)
class Knots:
    """Knots that divide the intervals between edges into pieces of equal durations.

    Attributes:
        edges: of all arms (m + 1,) in the recording's time [s].
        pieces: of every interval (m,).
    """

    edges: Array
    pieces: np.ndarray

    @classmethod
    def spaced(cls, edges: Array, durations: Array) -> Knots:
        """About 40 ms apart when the intervals (m,) between edges (m + 1,) take these durations."""
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
        """Numbers of the knots at some of the edges, by their times."""
        nearest = np.abs(self.edges[:, None] - edges).argmin(axis=0)
        return np.asarray(self.at_edges[nearest])

    def times(self, durations: Array) -> Array:
        """Times of the knots (count + 1,) for durations (m,) of the intervals [s]."""
        steps = durations[self.interval] * self.fraction
        return np.concatenate([[0.0], np.cumsum(steps)])


def union_of_edges(arms: Sequence[ArmPaths]) -> Array:
    """Times (m + 1,) in the recording at which any arm's path begins or ends [s]."""
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > SAME])])


_SAMPLES = 201  # of a path, to find its nearest point
_ALONG = 0.02  # of the squared deviation along the path that counts: it is a matter of timing
_ISOTROPIC = 0.3  # of the mean inertia, for joints that carry next to none
_SECTIONS = 3  # of the nearest point: three times the curvature of a parabola


@dataclass(frozen=True, eq=False)
class Reference:
    """Points of an arm's paths, one for every knot.

    Attributes:
        positions: of the paths (k, n).
        tangents: derivatives of the paths by s there (k, n); zero where the arm rests, and where
            a deviation along the path would lead beyond its end.
    """

    positions: Array
    tangents: Array

    def weights(self, arm: ArmPaths) -> Array:
        """Matrices (k, n, n) whose quadratic forms are squared distances from the paths.

        In the metric G + a I relative to its mean diagonal, almost none along the path.
        """
        n = arm.robot.dof
        metric = np.array([arm.robot.mass_matrix(q) for q in self.positions])
        mean = float(np.trace(metric, axis1=1, axis2=2).mean()) / n
        metric = metric / mean + _ISOTROPIC * np.eye(n)
        covectors = np.einsum("kij,kj->ki", metric, self.tangents)
        squares = np.einsum("ki,ki->k", covectors, self.tangents)
        share = np.divide(1.0 - _ALONG, squares, out=np.zeros_like(squares), where=squares > 0.0)
        along = np.einsum("ki,kj,k->kij", covectors, covectors, share)
        return np.asarray(metric - along)


@dataclass(frozen=True, eq=False)
class Course:
    """The paths of one arm over the knots.

    Attributes:
        arm: with its paths.
        knots: of the trajectory.
    """

    arm: ArmPaths
    knots: Knots

    @cached_property
    def at(self) -> np.ndarray:
        """Numbers of the knots (k + 1,) at the ends of the arm's k paths."""
        return self.knots.of(self.arm.edges)

    @cached_property
    def resting(self) -> np.ndarray:
        """Whether the arm rests on each of its paths, (k,)."""
        return np.array([_rests(path.nodes) for path in self.arm.paths])

    @cached_property
    def pieces_at_rest(self) -> NDArray[np.bool_]:
        """Pieces in which the arm rests, (pieces,)."""
        found = np.zeros(self.knots.count, dtype=bool)
        for rests, first, last in zip(self.resting, self.at[:-1], self.at[1:], strict=True):
            found[first:last] = rests
        return found

    @property
    def knots_at_rest(self) -> NDArray[np.bool_]:
        """Knots at which the arm rests, at the ends of rests as well, (knots,)."""
        rests = self.pieces_at_rest
        return np.asarray(np.append(rests, False) | np.append(False, rests))

    @cached_property
    def junctions(self) -> Array:
        """Configurations at the ends of the paths (k + 1, n)."""
        return path_ends(self.arm)

    def as_recorded(self, rest: bool, stops: bool = False) -> Reference:
        """The paths with smooth progress in the recording's time, slowed down in their corners.

        Args:
            rest: whether the arm is at rest at both ends.
            stops: whether it stops in every corner.
        """
        laws = self._progress(rest, stops)
        # Knots are evenly spaced in an interval however long it takes.
        time = self.knots.edges[0] + self.knots.times(self.knots.person)
        s = np.zeros(time.size)
        for j, (first, last) in enumerate(zip(self.at[:-1], self.at[1:], strict=True)):
            start, end = self.arm.edges[j], self.arm.edges[j + 1]
            unit = np.clip((time[first : last + 1] - start) / (end - start), 0.0, 1.0)
            s[first : last + 1] = np.clip(laws[j](unit), 0.0, 1.0)
        s[self.at[:-1]] = 0.0
        return self._at(s)

    def nearest(self, positions: Array) -> Reference:
        """The points of the paths nearest to positions (knots, n), in order along every path."""
        s = np.zeros(len(positions))
        grid = np.linspace(0.0, 1.0, _SAMPLES)
        for path, first, last in zip(self.arm.paths, self.at[:-1], self.at[1:], strict=True):
            inner = slice(first + 1, last)
            samples = path(grid)
            metric = self.arm.robot.mass_matrix(samples[_SAMPLES // 2])
            metric = metric / np.trace(metric) + _ISOTROPIC / len(metric) * np.eye(len(metric))
            factor = np.linalg.cholesky(metric)
            offsets = (positions[inner, None, :] - samples) @ factor
            squares = np.sum(offsets**2, axis=2)
            found = grid[squares.argmin(axis=1)]
            s[inner] = np.maximum.accumulate(found) if found.size else found
        s[self.at[-1]] = 1.0
        return self._at(s)

    def _at(self, s: Array) -> Reference:
        """At path parameters s, one for every knot; a knot at a junction begins the next path."""
        positions, tangents = np.empty((2, s.size, self.arm.robot.dof))
        for j, (first, last) in enumerate(zip(self.at[:-1], self.at[1:], strict=True)):
            here, path = slice(first, last + 1), self.arm.paths[j]
            own = s[here].copy()
            own[-1] = 1.0
            positions[here] = path(own)
            inner = (own > 0.0) & (own < 1.0) & ~self.resting[j]
            tangents[here] = np.where(inner[:, None], path(own, 1), 0.0)
        return Reference(positions, tangents)

    def _progress(self, rest: bool, stops: bool) -> list[CubicHermiteSpline]:
        """S of every path as a function of the fraction of its duration."""
        durations = np.diff(self.arm.edges)
        lengths = np.array([path.length for path in self.arm.paths])
        mean = lengths / durations
        total = mean[:-1] + mean[1:]
        product = 2.0 * mean[:-1] * mean[1:]
        harmonic = np.divide(product, total, out=np.zeros_like(total), where=total > 0.0)
        inner = np.zeros_like(harmonic) if stops else harmonic * self._cosines()
        ends = np.zeros(2) if rest else mean[[0, -1]]
        speeds = np.concatenate([ends[:1], inner, ends[1:]])
        laws = []
        for j, duration in enumerate(durations):
            unit = duration / lengths[j] if lengths[j] > 0.0 else 0.0
            slopes = np.minimum(speeds[j : j + 2] * unit, 3.0)
            laws.append(CubicHermiteSpline([0.0, 1.0], [0.0, 1.0], slopes))
        return laws

    def _cosines(self) -> Array:
        """Of the angles between successive paths in the metric, at least zero, (k - 1,)."""
        found = []
        for before, after in zip(self.arm.paths[:-1], self.arm.paths[1:], strict=True):
            metric = self.arm.robot.mass_matrix(after(0.0))
            incoming, outgoing = before(1.0, 1), after(0.0, 1)
            norm = np.sqrt((incoming @ metric @ incoming) * (outgoing @ metric @ outgoing))
            product = float(incoming @ metric @ outgoing)
            found.append(max(product / norm, 0.0) if norm > 0.0 else 0.0)
        return np.array(found)


def path_ends(arm: ArmPaths) -> Array:
    """Configurations at the ends of an arm's k paths (k + 1, n)."""
    return np.array([*(path(0.0) for path in arm.paths), arm.paths[-1](1.0)])


def _rests(nodes: Array) -> bool:
    return bool(np.ptp(nodes, axis=0).max() <= 1e-9)


@dataclass(frozen=True, eq=False, repr=False)
class JointSpline(ShortRepr):
    """Joints over time, with constant jerk between knots.

    Attributes:
        time: of the knots (k + 1,) [s].
        positions, velocities, accelerations: at the knots, (k + 1, n) each.
    """

    time: Array
    positions: Array
    velocities: Array
    accelerations: Array
    _shown = ("duration",)

    @classmethod
    def through(cls, time: Array, positions: Array, ends: Array) -> JointSpline:
        """The cubic spline through positions (k + 1, n), with velocities (2, n) at its ends."""
        sides = ((1, ends[0]), (1, ends[1]))
        spline = CubicSpline(time, positions, bc_type=sides)
        return cls(time, positions, spline(time, 1), spline(time, 2))

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.time[-1])

    @cached_property
    def steps(self) -> Array:
        """Durations of the pieces (k,) [s]."""
        return np.asarray(np.diff(self.time))

    @cached_property
    def jerks(self) -> Array:
        """Jerks of the pieces (k, n)."""
        return np.asarray(np.diff(self.accelerations, axis=0) / self.steps[:, None])

    def __call__(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Positions, velocities, accelerations and jerks at times within the spline (m,)."""
        piece = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.jerks) - 1)
        h = (time - self.time[piece])[:, None]
        q, v, a = (each[piece] for each in (self.positions, self.velocities, self.accelerations))
        j = self.jerks[piece]
        return (
            q + h * (v + h * (a / 2.0 + h * j / 6.0)),
            v + h * (a + h * j / 2.0),
            a + h * j,
            j,
        )

    def within_pieces(self, count: int) -> Array:
        """Evenly spaced times in every piece, both ends included, (k, count)."""
        return np.asarray(self.time[:-1, None] + self.steps[:, None] * np.linspace(0.0, 1.0, count))

    @cached_property
    def extreme_velocities(self) -> Array:
        """Largest magnitudes of the velocities in every piece, (k, n)."""
        h, v, a, j = self.steps[:, None], self.velocities[:-1], self.accelerations[:-1], self.jerks
        turn = np.clip(np.divide(-a, j, out=np.zeros_like(a), where=j != 0.0), 0.0, h)
        inside = np.abs(v + turn * (a + turn * j / 2.0))
        return np.asarray(np.maximum(inside, np.maximum(np.abs(v), np.abs(self.velocities[1:]))))

    @cached_property
    def extreme_positions(self) -> tuple[Array, Array]:
        """Smallest and largest positions in every piece, (k, n) each."""
        h, q = self.steps[:, None], self.positions[:-1]
        v, a, j = self.velocities[:-1], self.accelerations[:-1], self.jerks
        # Roots of v + a t + j t^2 / 2, in the form that does not cancel.
        root = np.sqrt(np.maximum(a**2 - 2.0 * j * v, 0.0))
        sum_ = -(a + np.copysign(root, a))
        turns = [
            np.divide(sum_, j, out=np.zeros_like(a), where=j != 0.0),
            np.divide(2.0 * v, sum_, out=np.zeros_like(a), where=sum_ != 0.0),
        ]
        values = [q, self.positions[1:]]
        for turn in turns:
            t = np.clip(turn, 0.0, h)
            values.append(q + t * (v + t * (a / 2.0 + t * j / 6.0)))
        return np.min(values, axis=0), np.max(values, axis=0)


_ROUNDS, _AT_MOST = 8, 1.5  # how often time is stretched, and by how much at once
_CORNERS = 3.0  # times the limit that accelerations may have in corners, which will be rounded


def through(
    references: Sequence[Reference], knots: Knots, durations: Array, rest: bool
) -> KnotStates:
    """Cubic splines through the references for durations of the intervals."""
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
    """Durations (m,) of the intervals in which the references nearly keep the limits [s]."""
    durations = knots.person
    for _ in range(_ROUNDS):
        guess = through(references, knots, durations, rest)
        ratio = np.zeros(knots.count + 1)
        for k, arm in enumerate(arms):
            speed = np.abs(guess.velocities[k]) / arm.limits.velocity
            growth = np.abs(guess.accelerations[k]) / (_CORNERS * arm.limits.acceleration)
            ratio = np.maximum(ratio, np.maximum(speed, np.sqrt(growth)).max(axis=1))
        needed = np.array(
            [
                ratio[first : last + 1].max()
                for first, last in zip(knots.at_edges[:-1], knots.at_edges[1:], strict=True)
            ]
        )
        if np.all(needed <= 1.0):
            break
        durations = durations * np.clip(1.05 * needed, 1.0, _AT_MOST)
    return durations
