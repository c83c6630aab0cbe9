"""What the trajectory of an arm stays near: points of its paths, one for every knot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.program.knots import Knots

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
