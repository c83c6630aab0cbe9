"""Path: a curve q(s), s in [0, 1], on a manifold."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_number, real_array, settle
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.trajectory.grid import Grid, Quadrature, interpolation_between

# Newton's method for s at an arc length converges quadratically: one step below this is the last.
_NEWTON = 4
_CONVERGED = 1e-10
# of the length, relative
_LEVELS = 6
_RESOLVED = 1e-10
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False, repr=False)
class Path:
    """A piecewise polynomial curve through the nodes of a grid.

    Attributes:
        metric: metric of the manifold.
        grid: grid of its nodes.
        nodes: positions at the grid's nodes, (grid.size, n).

    Raises:
        ValueError: nodes of another shape, or not finite.
    """

    metric: Metric
    grid: Grid
    nodes: Array = field(repr=False)

    def __post_init__(self) -> None:
        nodes = real_array(self.nodes, "nodes")
        if nodes.shape != (self.grid.size, self.metric.dim):
            raise ValueError(
                f"nodes must have shape {(self.grid.size, self.metric.dim)}, got {nodes.shape}"
            )
        if not np.all(np.isfinite(nodes)):
            raise ValueError("nodes must be finite")
        nodes.flags.writeable = False
        settle(self, nodes=nodes)

    @classmethod
    def through(cls, metric: Metric, waypoints: ArrayLike) -> Path:
        """Return the polyline through waypoints (m, n), such as those of a planner.

        Its speed is constant: s is proportional to the length of the straight pieces. Waypoints
        that repeat the one before are left out.

        >>> detour = go.Path.through(go.Euclidean(2), [(0.0, 0.0), (1.0, 0.0), (1.0, 3.0)])
        >>> detour(0.25).tolist(), detour.length
        ([1.0, 0.0], 4.0)

        Raises:
            ValueError: fewer than two different waypoints, another shape, or not finite.
        """
        q = real_array(waypoints, "waypoints")
        if q.ndim != 2 or q.shape[1] != metric.dim or not np.all(np.isfinite(q)):
            raise ValueError(f"waypoints must be finite, (m, {metric.dim}), got shape {q.shape}")
        steps = np.diff(q, axis=0)
        lengths = np.zeros(len(steps))
        if np.any(steps):
            lengths = speeds_at(metric, q[:-1] + steps / 2.0, steps)
        q = q[np.append(True, ~(lengths == 0.0))]
        lengths = lengths[~(lengths == 0.0)]
        if not (len(lengths) and np.all(np.isfinite(lengths))):
            raise ValueError(
                f"waypoints must be two or more different ones, where the metric is defined, got "
                f"{waypoints!r}"
            )
        ends = np.append(0.0, np.cumsum(lengths))
        middle = (q[1:] + q[:-1]) / 2.0
        nodes = np.vstack([q[:1], *np.stack([middle, q[1:]], axis=1)])
        return cls(metric, Grid(len(lengths), 2, tuple((ends / ends[-1]).tolist())), nodes)

    def __repr__(self) -> str:
        with np.printoptions(precision=4, suppress=True, linewidth=1000, threshold=8):
            ends = f"from {self.nodes[0]} to {self.nodes[-1]}"
        return f"{type(self).__name__}(length {self.length:.6g}, {ends})"

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Return q(s) or its derivative of this order by s: (n,) for a number, (k, n) for k.

        Raises:
            ValueError: s lies outside [0, 1] or is not finite, or the order is negative.
        """
        times = np.asarray(s, dtype=float)
        if times.ndim > 1:
            raise ValueError(f"s must be a number or have shape (k,), got {times.shape}")
        if order < 0:
            raise ValueError(f"order must not be negative, got {order}")
        if not np.all((times >= -1e-9) & (times <= 1.0 + 1e-9)):
            raise ValueError(f"s must lie in [0, 1], got {s!r}")
        values = self._derivatives_at_nodes(order)[order]
        result = self.grid.interpolate(values, np.clip(np.atleast_1d(times), 0.0, 1.0))
        return result[0] if times.ndim == 0 else result

    def derivatives(self, s: Array, order: int) -> list[Array]:
        """Return q(s) and its derivatives up to this order, (k, n) each, at s (k,) in [0, 1]."""
        values = np.concatenate(self._derivatives_at_nodes(order), axis=2)
        return np.split(self.grid.interpolate(values, s), order + 1, axis=1)

    def _derivatives_at_nodes(self, order: int) -> list[Array]:
        """Return derivatives at the nodes by segment, (segments, degree + 1, n) each."""
        values = [self.grid.in_segments(self.nodes)]
        for _ in range(order):
            # The derivative of a constant is exactly zero, and short paths lose no digits.
            values.append(self.grid.differentiation @ (values[-1] - values[-1][:, :1]))
        return values

    @property
    def breakpoints(self) -> Array:
        """Breakpoints of the grid, between which the path is smooth."""
        return self.grid.breakpoints

    @cached_property
    def speeds_at_quadrature_points(self) -> Array:
        """Speeds |q'|_G (segments, m) at the points of `Grid.quadrature`."""
        return self.speeds_at(self.grid.quadrature)

    def speeds_at(self, quadrature: Quadrature) -> Array:
        """Return speeds |q'|_G (segments, m) at the points of a quadrature of the grid."""
        speeds = speeds_at(self.metric, *self.states_at(quadrature))
        return speeds.reshape(quadrature.weights.shape)

    def states_at(self, quadrature: Quadrature) -> tuple[Array, Array]:
        """Return q and q' (segments * m, n) at the points of a quadrature of the grid."""
        n = self.metric.dim
        nodes = self.grid.in_segments(self.nodes)
        positions = (quadrature.values @ nodes).reshape(-1, n)
        slopes = (quadrature.slopes @ (nodes - nodes[:, :1])).reshape(-1, n)
        return positions, slopes

    @property
    def discrete_energy(self) -> float:
        """Energy by the quadrature of the grid, which is what a solver minimizes."""
        return float(np.sum(self.grid.quadrature.weights * self.speeds_at_quadrature_points**2)) / 2

    def _speeds_on(self, fine: Grid) -> Array:
        """Return speeds |q'|_G (segments, degree + 1) at the nodes of a refinement of the path's
        grid.

        One-sided at breakpoints, where the derivative may jump.
        """
        grid = self.grid
        n = self.metric.dim
        values, slopes = interpolation_between(
            grid.degree, fine.degree, fine.segments // grid.segments
        )
        nodes = grid.in_segments(self.nodes)
        rates = (slopes @ (nodes - nodes[:, :1])) * (2.0 / grid.widths)[:, None, None]
        q = (values @ nodes).reshape(-1, n)
        velocity = rates.reshape(-1, n)
        return speeds_at(self.metric, q, velocity).reshape(fine.segments, fine.degree + 1)

    @cached_property
    def _speeds(self) -> tuple[Grid, Array]:
        """A grid that resolves the speed, and the speeds at its nodes, by segment.

        Its degree is twice the path's, and it is refined until the length no longer changes:
        rounded corners are almost kinks of the speed.
        """
        length = np.inf
        for level in range(_LEVELS + 1):
            fine = _refined(self.grid, level)
            before = length
            speeds = self._speeds_on(fine)
            length = float(np.sum(fine.weights * speeds))
            if level > 0 and not abs(length - before) > _RESOLVED * before:
                break
        return fine, speeds

    @property
    def length(self) -> float:
        """Length: the integral of |q'(s)|_G over s."""
        fine, speeds = self._speeds
        return float(np.sum(fine.weights * speeds))

    @property
    def energy(self) -> float:
        """Energy: half the integral of |q'(s)|_G^2 over s; at least length^2 / 2."""
        fine, speeds = self._speeds
        return float(0.5 * np.sum(fine.weights * speeds**2))

    def at_length(self, lengths: ArrayLike) -> Array:
        """Return path parameters s (k,) at which the arc length from the start has the values (k,).

        Raises:
            ValueError: a length below zero or above the path's length.
        """
        wanted = np.asarray(lengths, dtype=float)
        total = self.length
        slack = 1e-9 * total
        if wanted.size == 0:
            return np.zeros(0)
        if wanted.ndim != 1 or not np.all((wanted >= -slack) & (wanted <= total + slack)):
            raise ValueError(f"lengths must be (k,) between 0 and {total:.6g}, got {lengths!r}")
        fine, values = self._arc_length
        s = fine.nodes
        upto = np.append(values[:, :-1, 0].ravel(), values[-1, -1, 0])
        upto = np.maximum.accumulate(upto)
        found = np.interp(wanted, upto, s)
        place = np.searchsorted(upto, wanted)
        below, above = (s[np.clip(place + k, 0, s.size - 1)] for k in (-1, 0))
        for _ in range(_NEWTON):
            here, rates = fine.interpolate(values, found).T
            step = np.divide(here - wanted, rates, out=np.zeros_like(found), where=rates > 0)
            found = np.clip(found - step, below, above)
            if np.abs(step).max() <= _CONVERGED:
                break
        return np.asarray(found)

    @cached_property
    def _arc_length(self) -> tuple[Grid, Array]:
        """Arc length from the start and its derivative by s, as polynomials on a finer grid.

        (segments, degree + 1, 2), at the nodes of the grid that resolves the speed.
        """
        fine, speeds = self._speeds
        # D y = speeds with y = 0 at the first node of each segment.
        inner = fine.differentiation[:, 1:, 1:]
        rest = np.linalg.solve(inner, speeds[:, 1:, None])[:, :, 0]
        parts = np.concatenate([np.zeros((fine.segments, 1)), rest], axis=1)
        before = np.concatenate([[0.0], np.cumsum(parts[:, -1])])
        values = np.stack([before[:-1, None] + parts, speeds], axis=2)
        return fine, values * (self.length / max(before[-1], _TINY))

    def resample(self, count: int) -> Array:
        """Return positions (count, n), evenly spaced in the metric, from one end to the other.

        Raises:
            ValueError: fewer than two positions.
        """
        if not (np.isfinite(as_number("count", count)) and int(count) == count >= 2):
            raise ValueError(f"count must be an integer above one, got {count!r}")
        return self(self.at_length(np.linspace(0.0, self.length, int(count))))


@lru_cache(maxsize=64)
def _refined(grid: Grid, level: int) -> Grid:
    """Get the grid, then with twice its degree, then with its segments halved again and again."""
    degree = min(2 * grid.degree, 100)
    parts = 2 ** (level - 1)
    if level <= 1:
        return replace(grid, degree=degree if level else grid.degree, via_segments=())
    fractions = np.arange(parts * grid.segments + 1) / parts
    ends = np.interp(fractions, np.arange(grid.segments + 1), grid.breakpoints)
    return Grid(parts * grid.segments, degree, tuple(ends.tolist()))
