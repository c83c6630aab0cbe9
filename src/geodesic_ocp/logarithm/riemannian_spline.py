"""Riemannian cubics and splines, also in tension: their evaluation, equation and certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import TypeAlias

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, ShortRepr, evaluate
from geodesic_ocp.logarithm.hand_target import HandTarget
from geodesic_ocp.logarithm.motion_by_ipopt import action_program
from geodesic_ocp.manifold.kernels import integrate_by_scipy
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import SegmentBasis, second_order
from geodesic_ocp.ocp.certificate import stationarity_and_index
from geodesic_ocp.ocp.motion_program import instants, variables
from geodesic_ocp.trajectory.timed_motion import TimedMotion

Mask: TypeAlias = NDArray[np.bool_]

FINE = SegmentBasis(10, 14)
STEP = 1e-14  # tolerance of a step of the integration
_MAX_STEPS = 5000
_SAMPLES = 50
_PARTS = (2, 4, 8, 16)  # of an interval between knots, in which polynomials are fitted to it
_REPRESENTED = 1e-8  # of the extent of a motion, that such polynomials may miss
# Of the action of other motions as far and long: below it is zero, as errors of 1e-9 of positions
# are some 1e-5 of accelerations in polynomials of degree 12, and stationary is 1e-5 of the action.
_SMALL = 1e-5
_TERMS = 20  # of the Stumpff functions, up to a tension of `LONGEST` intervals
LONGEST = 5.0  # interval between knots, times the tension: motions grow by exp(5) in it
BOUNDARY = 1e-6  # residual of natural boundary conditions at an optimal end
_SETTLED = 1e-6  # jump of the Hamiltonian at an optimal time, of the action over the mean interval
_AT_BOUND = 1e-9  # distance from a bound, of the duration


@dataclass(frozen=True, eq=False, repr=False)
class RiemannianSpline(TimedMotion, ShortRepr):
    """A motion of least int (|D_t q'|^2_G + tension^2 |q'|^2_G) / 2 dt between its knots.

    Attributes:
        metric: metric of the manifold.
        times: of the knots and of points between them from which it is integrated (k + 1,) [s].
        starts: positions, velocities and their momenta p and r at the start of each interval,
            (k, 4 n).
        end: position and velocity at the last time (2 n).
        error: largest difference of the integrated curves from the knots: of positions [rad or m],
            and of velocities times the mean interval.
        is_free: True for the components of the knots that were not given (k + 1, 2 n).
        tension: [1/s]; zero for Riemannian cubics.
        hand: pose of the hand at the end, where that was given in place of a position.
        time_bounds: bounds of the times of the knots between the ends where these are optimal,
            (2, m) [s].
    """

    metric: Metric
    times: Array
    starts: Array
    end: Array
    error: float
    is_free: Mask
    tension: float = 0.0
    hand: HandTarget | None = None
    time_bounds: Array | None = None

    _shown = ("duration", "action", "error", "tension")

    @property
    def unit(self) -> float:
        """The mean interval [s], in which time is counted where numbers depend on its unit."""
        return self.duration / len(self.starts)

    def slower(self, factor: float) -> RiemannianSpline:
        """Return the same curve at times multiplied by a factor."""
        powers = np.repeat(factor ** -np.array([0.0, 1.0, 3.0, 2.0]), self.metric.dim)
        bounds = self.time_bounds
        return replace(
            self,
            times=factor * self.times,
            starts=self.starts * powers,
            end=self.end * powers[: self.end.size],
            tension=self.tension / factor,
            time_bounds=None if bounds is None else factor * bounds,
        )

    @cached_property
    def _in_units(self) -> RiemannianSpline:
        return self.slower(1.0 / self.unit)

    @cached_property
    def action(self) -> float:
        """The integral of (|D_t q'|^2_G + tension^2 |q'|^2_G) / 2, by Gauss quadrature."""
        s, weights = FINE.rule
        states = self.at(instants(self.times, s))
        densities = self._densities(states).reshape(-1, s.size)
        return float(np.diff(self.times) @ densities @ weights)

    def _densities(self, states: Array) -> Array:
        """Return (r' G^-1 r + tension^2 v' G v) / 2 at states (k, 4 n), (k,)."""
        q, v, _, r = np.split(states, 4, axis=1)
        tensors = np.array([self.metric.matrix(each) for each in q]).reshape(-1, *2 * q.shape[1:])
        squares = np.sum(r * np.linalg.solve(tensors, r[..., None])[..., 0], axis=1)
        speeds = np.sum(v * (tensors @ v[..., None])[..., 0], axis=1)
        return np.asarray(squares + self.tension**2 * speeds) / 2.0

    def at(self, t: ArrayLike) -> Array:
        """Return states (k, 4 n) at times (k,) [s]: q, q', and their momenta p and r.

        r = G D_t q' is the generalised force without gravity [N m or N].

        Raises:
            ValueError: a time before the first or after the last knot.
        """
        instants = self.checked(t)
        scaled = self._in_units
        segment = np.searchsorted(self.times[1:-1], instants, "right")
        found = np.empty((len(instants), self.starts.shape[1]))
        for k in np.unique(segment):
            rows = np.flatnonzero(segment == k)
            since = np.maximum(instants[rows] - self.times[k], 0.0) / self.unit
            local, row = np.unique(np.append(0.0, since), return_inverse=True)
            states = integrated(self.metric, scaled.starts[k], local, scaled.tension)
            found[rows] = states[row[1:]]
        powers = self.unit ** -np.array([0.0, 1.0, 3.0, 2.0])
        return found * np.repeat(powers, self.metric.dim)

    def states(self, t: Array, order: int) -> Array:
        """Return derivatives of this order at times (k,) within the motion, (k, n)."""
        n = self.metric.dim
        found = self.at(t)
        if order == 2:
            found = self._rates(found)
            order = 1
        return found[:, order * n : (order + 1) * n]

    def _rates(self, states: Array) -> Array:
        """Return Hamilton's equations at states (k, 4 n)."""
        rate = second_order(self.metric).rate
        square = self.tension**2
        found = [evaluate(rate, state, square)[:, 0] for state in states]
        return np.array(found).reshape(states.shape)

    def torques(self, t: ArrayLike) -> Array:
        """Return the generalised forces without gravity, G D_t q', (n,) or (k, n) [N m or N]."""
        values = self.at(t)[:, 3 * self.metric.dim :]
        return values[0] if np.ndim(t) == 0 else values

    def hamiltonian(self, t: ArrayLike) -> Array:
        """Return p'q' + r'q'' - (|D_t q'|^2_G + tension^2 |q'|^2_G) / 2 at times (k,), which is
        constant between knots.
        """
        return self._hamiltonian(self.at(t))

    def _hamiltonian(self, states: Array) -> Array:
        _, v, p, r = np.split(states, 4, axis=1)
        acceleration = self._rates(states)[:, self.metric.dim : 2 * self.metric.dim]
        return np.asarray(np.sum(p * v + r * acceleration, axis=1)) - self._densities(states)

    @cached_property
    def arrivals(self) -> Array:
        """States at the ends of the intervals, as integrated from their starts, (k, 4 n)."""
        scaled = self._in_units
        ends = arrivals(self.metric, scaled.starts, np.diff(scaled.times), scaled.tension)
        powers = self.unit ** -np.array([0.0, 1.0, 3.0, 2.0])
        return ends * np.repeat(powers, self.metric.dim)

    @property
    def inner(self) -> NDArray[np.int64]:
        """Rows of `times` that are knots between the ends."""
        given = np.logical_not(self.is_free[:, : self.metric.dim].all(axis=1))
        return np.flatnonzero(given[1:-1]) + 1

    @cached_property
    def hamiltonian_jumps(self) -> Array:
        """Differences (m,) of the Hamiltonian after and before the knots between the ends.

        They are the derivatives of the least action by the times of these knots, as minus the
        Hamiltonian is the one by the time of an end (Hamilton, Jacobi).
        """
        after = self.starts[self.inner]
        before = self.arrivals[self.inner - 1]
        return self._hamiltonian(after) - self._hamiltonian(before)

    def residual(self, t: ArrayLike) -> Array:
        """Return D_t^3 q' + R(D_t q', q') q' - tension^2 D_t q' at times (k,), (k, n): zero up to
        rounding.

        The covariant derivatives follow from Hamilton's equations by the chain rule, the curvature
        from the metric alone.
        """
        equation = spline_equation(self.metric)
        square = self.tension**2
        return np.array([equation(state, square).full()[:, 0] for state in self.at(t)])

    def relative_residual(self, t: Array) -> float:
        """Return the largest residual at times (k,), relative to the largest acceleration, or
        velocity over the duration, over the square of the shortest interval.
        """
        sizes = np.abs(self(t, 2)).max(), np.abs(self(t, 1)).max() / self.duration
        scale = max(sizes) / np.diff(self.times).min() ** 2
        return float(np.abs(self.residual(t)).max() / scale) if scale > 0.0 else 0.0

    @cached_property
    def certificate(self) -> MotionCertificate:
        """What was checked of the motion, and whether it is locally minimizing; takes a moment."""
        scaled = self._in_units
        residual = scaled.relative_residual(
            np.linspace(scaled.times[0], scaled.times[-1], _SAMPLES)
        )
        stationary, negative = stationarity_and_index(*scaled._second_variation())
        at_bounds, others = self.optimal_times
        return MotionCertificate(
            self.error,
            residual,
            scaled.boundary_residual,
            stationary,
            negative,
            others,
            at_bounds,
        )

    @property
    def boundary_residual(self) -> float:
        """The largest component of momenta that vanish at free ends, relative to all momenta."""
        n = self.metric.dim
        first = self.starts[0]
        last = self.arrivals[-1]
        largest = np.abs(np.vstack([self.starts, self.arrivals])[:, 2 * n :]).max()
        free = [first[3 * n :][self.is_free[0, n:]], last[3 * n :][self.is_free[-1, n:]]]
        if self.hand is not None:
            free.append(self.hand.tangents(self.end[:n]).T @ last[2 * n : 3 * n])
        found = float(np.abs(np.concatenate(free)).max(initial=0.0))
        return found / float(largest) if largest > 0.0 else 0.0

    @property
    def optimal_times(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Times of knots at an active bound, and those at which the Hamiltonian does not jump."""
        if self.time_bounds is None:
            return (), ()
        times = self.times[self.inner]
        jumps = self.hamiltonian_jumps
        lower, upper = np.abs(self.time_bounds - times) <= _AT_BOUND * self.duration
        is_active = (lower & (jumps > 0.0)) | (upper & (jumps < 0.0))
        is_settled = np.abs(jumps) <= _SETTLED * self.action / self.unit
        return tuple(times[is_active].tolist()), tuple(times[is_settled & ~is_active].tolist())

    def _second_variation(self) -> tuple[Array, scipy.sparse.csc_array]:
        """Return gradient and Hessian of the discrete action on so many segments that their
        polynomials are the motion, twice as many at least, by what is free, relative to the action.
        """
        n = self.metric.dim
        (s, _) = FINE.rule
        values = FINE.values(s)
        count = len(self.times) - 1
        for parts in _PARTS:
            fractions = np.arange(parts * count + 1) / parts
            times = np.interp(fractions, np.arange(count + 1), self.times)
            q = self(times)
            v = self(times, 1)
            durations = np.diff(times)[:, None]
            ends = np.stack([q[:-1], durations * v[:-1], q[1:], durations * v[1:]], axis=1)
            missing = self(instants(times, s)).reshape(len(ends), s.size, n) - values[:4].T @ ends
            coefficients = np.linalg.pinv(values[4:].T) @ missing
            error = np.abs(values[4:].T @ coefficients - missing).max()
            extent = float(np.ptp(q, axis=0).max())
            if error <= _REPRESENTED * extent:
                break
        x = variables(np.hstack([q, v]), coefficients)
        free = np.ones((len(times), 2 * n))
        free[::parts] = self.is_free
        moves = variables(free, np.ones_like(coefficients)) > 0.0
        functions = action_program(self.metric, FINE, durations[:, 0], self.tension).functions
        # The action of a geodesic vanishes: it is compared with that of motions as far, as long.
        usual = np.trace(self.metric.matrix(q[0])) * (extent or 1.0) ** 2 / self.duration**3
        unit = max(self.action, float(_SMALL * usual))
        gradient = functions["grad_f"](x, [])[1].full()[:, 0] / unit
        upper = scipy.sparse.csc_array(functions["hess_lag"](x, [], 1.0 / unit, []).sparse())
        hessian = (upper + scipy.sparse.triu(upper, 1).T).tolil()
        directions = scipy.sparse.eye_array(x.size, format="csc")[:, moves]
        if self.hand is not None:
            last = np.arange(x.size - 2 * n, x.size - n)
            force, curvature, tangents = self.hand.reaction(self.end[:n], gradient[last])
            gradient[last] += force
            hessian[np.ix_(last, last)] += curvature
            moves[last] = False
            along = scipy.sparse.lil_array((x.size, tangents.shape[1]))
            along[last] = tangents
            fixed = scipy.sparse.eye_array(x.size, format="csc")[:, moves]
            directions = scipy.sparse.hstack([fixed, along], format="csc")
        reduced = directions.T @ hessian.tocsc() @ directions
        return directions.T @ gradient, scipy.sparse.csc_array(reduced)


@dataclass(frozen=True, repr=False)
class MotionCertificate(ShortRepr):
    """What was checked of a motion, independently of how it was found.

    Attributes:
        knot_error: largest difference of the integrated curves from the knots: of positions [rad or
            m], and of velocities times the mean interval.
        residual: of D_t^3 q' + R(D_t q', q') q' - tension^2 D_t q' = 0, see `relative_residual`.
        boundary_residual: largest component of the momenta that vanish at free ends, relative to
            the largest of all momenta, in the mean interval as unit of time: of r where a velocity
            is free, and of p along the configurations with one pose where the hand's is given.
        stationary: whether a Newton step on twice as many segments changes the action by less
            than 1e-5 of it.
        negative: number of negative eigenvalues of the second variation there, at fixed times.
        stationary_times: optimal times of knots within their bounds: the jump of the Hamiltonian is
            less than 1e-6 of the action over the mean interval [s].
        times_at_bounds: times of knots at a bound beyond which the action would decrease [s].
    """

    knot_error: float
    residual: float
    boundary_residual: float
    stationary: bool
    negative: int
    stationary_times: tuple[float, ...] = ()
    times_at_bounds: tuple[float, ...] = ()

    @property
    def locally_minimizing(self) -> bool:
        """True if the motion is stationary and its second variation is not negative anywhere."""
        return self.stationary and self.negative == 0


def spline_equation(metric: Metric) -> ca.Function:
    """Return ((q, q', p, r), s) -> D_t^3 q' + R(D_t q', q') q' - s D_t q' along Hamilton's
    equations.

    Riemannian cubics make it vanish for s = 0 (Noakes, Heinzinger, Paden 1989, equation 3), splines
    in tension for its square (Silva Leite, Camarinha, Crouch 2000).
    """
    n = metric.dim
    y = ca.SX.sym("y", 4 * n)
    z = ca.SX.sym("z", n)
    s = ca.SX.sym("s")
    q = y[:n]
    v = y[n : 2 * n]
    r = y[3 * n :]
    rate = second_order(metric).rate(y, s)

    w = ca.SX.sym("w", n)
    along = metric._transport_rate(q, v, w)  # of a field that is held constant

    def covariant(field: ca.SX) -> ca.SX:
        """Return D_t of a vector field along the motion."""
        return ca.jtimes(field, y, rate) - ca.substitute(along, w, field)

    first = ca.ldl_solve(r, *ca.ldl(metric._matrix_function(q), False))
    third = covariant(covariant(first))
    lowered = ca.gradient(metric.curvature_form(q, first, v, v, z), z)
    curvature = ca.ldl_solve(lowered, *ca.ldl(metric._matrix_function(q), False))
    return ca.Function("spline_equation", [y, s], [ca.densify(third + curvature - s * first)])


def stumpff(z: Array) -> Array:
    """Return c_k(z) = sum_i z^(2 i) / (2 i + k)!, k = 0, ..., 3, for 0 <= z <= `LONGEST`, (4, ...).

    They are cosh(z), sinh(z) / z, (cosh(z) - 1) / z^2 and (sinh(z) - z) / z^3 without their
    cancellation (Stumpff's functions).
    """
    square = np.asarray(z, dtype=float) ** 2
    found = np.zeros((4, *square.shape))
    for i in range(_TERMS, -1, -1):
        for k in range(4):
            found[k] = 1.0 / factorial(2 * i + k) + square * found[k]
    return found


def arrivals(
    metric: Metric, starts: Array, durations: Array, tension: float, tolerance: float = STEP
) -> Array:
    """Return the states (k, 4 n) at the ends of intervals from those at their starts."""
    ends = [
        integrated(metric, start, np.array([0.0, duration]), tension, tolerance)[1]
        for start, duration in zip(starts, durations, strict=True)
    ]
    return np.array(ends)


def integrated(
    metric: Metric, start: Array, times: Array, tension: float, tolerance: float = STEP
) -> Array:
    """Return states (k, 4 n) of Hamilton's equations at times (k,) from the first on."""
    if metric.has_constant_tensor:
        q, v, p, r = start.reshape(4, -1)
        tensor = metric.matrix(q)
        t = times[:, None] - times[0]
        a, j = np.linalg.solve(tensor, np.column_stack([r, -p])).T
        j = j + tension**2 * v
        c0, c1, c2, c3 = stumpff(tension * t)
        position = q + t * (v + t * (c2 * a + c3 * t * j))
        velocity = v + t * (c1 * a + c2 * t * j)
        momentum = (c0 * a + c1 * t * j) @ tensor
        return np.hstack([position, velocity, np.tile(p, t.shape), momentum])
    kernels = second_order(metric)
    square = np.array([tension**2])
    if kernels.available():
        return kernels.states(start, times, tension, tolerance, _MAX_STEPS)
    return integrate_by_scipy(kernels.rate, start, times, tolerance, lambda _: square, _MAX_STEPS)
