"""Riemannian cubics and splines: motions of least covariant acceleration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, as_vector, evaluate, real_array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_newton import singularity_along
from geodesic_ocp.logarithm.motion_by_ipopt import action_program, find_by_ipopt
from geodesic_ocp.manifold.kernels import integrate_by_scipy, one_blas_thread
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.motion_kernels import (
    DiscreteMotion,
    MotionKernels,
    SegmentBasis,
    motion_levels,
    second_order,
)
from geodesic_ocp.ocp.certificate import stationarity_and_index
from geodesic_ocp.ocp.motion_program import bisected, instants, state_matrix, variables
from geodesic_ocp.trajectory.timed_motion import TimedMotion

Mask: TypeAlias = NDArray[np.bool_]
Levels: TypeAlias = tuple[tuple[SegmentBasis, float], ...]

TOLERANCE = 1e-9  # of positions and velocities where segments meet
_STEP, _COARSER = 1e-14, 1e4  # tolerance of a step of the integration, and its first multiple
_MOVING = 1e-8  # the last change of free knots: rounding of momenta moves them
_NEAR = 1e-5  # errors from which on integrations are fine
_ROUNDS, _CONTRACTION = 12, 0.4
_FAR = 0.5  # errors of the discrete motion from which on more segments are better
_COARSE, _FINE = SegmentBasis(4, 9), SegmentBasis(10, 14)
_DECREASE = 1e-11  # of the action, relative, by the last step
_BISECTIONS = 5
_HALVINGS, _SCALES = 2, 8  # segments, and steps of the continuation from small motions
_MAX_STEPS = 5000
_SAMPLES, _SMALL = 50, 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class RiemannianSpline(TimedMotion, ShortRepr):
    """A motion of least int |D_t q'|^2_G / 2 dt, a Riemannian cubic between its knots.

    Attributes:
        metric: metric of the manifold.
        times: of the knots and of points between them from which it is integrated (k + 1,) [s].
        starts: positions, velocities and their momenta p and r at the start of each interval,
            (k, 4 n).
        end: position and velocity at the last time (2 n).
        error: largest difference of the integrated cubics from the knots [rad or m, and per s].
        is_free: True for the components of the knots that were not given (k + 1, 2 n).
    """

    metric: Metric
    times: Array
    starts: Array
    end: Array
    error: float
    is_free: Mask

    _shown = ("duration", "action", "error")

    @cached_property
    def action(self) -> float:
        """The integral of |D_t q'|^2_G / 2 over time, by Gauss quadrature."""
        s, weights = _FINE.rule
        n, states = self.metric.dim, self.at(instants(self.times, s))
        squares = self._products(states[:, :n], states[:, 3 * n :]).reshape(-1, s.size)
        return float(np.diff(self.times) @ squares @ weights) / 2.0

    def _products(self, q: Array, r: Array) -> Array:
        """Return r' G(q)^-1 r at positions q (k, n), (k,)."""
        tensors = np.array([self.metric.matrix(each) for each in q]).reshape(-1, *2 * q.shape[1:])
        return np.asarray(np.sum(r * np.linalg.solve(tensors, r[..., None])[..., 0], axis=1))

    def at(self, t: ArrayLike) -> Array:
        """Return states (k, 4 n) at times (k,) [s]: q, q', and their momenta p and r.

        r = G D_t q' is the generalised force without gravity [N m or N].

        Raises:
            ValueError: a time before the first or after the last knot.
        """
        instants = self.checked(t)
        segment = np.searchsorted(self.times[1:-1], instants, "right")
        found = np.empty((len(instants), self.starts.shape[1]))
        for k in np.unique(segment):
            rows = np.flatnonzero(segment == k)
            since = np.maximum(instants[rows] - self.times[k], 0.0)
            local, row = np.unique(np.append(0.0, since), return_inverse=True)
            found[rows] = _integrated(self.metric, self.starts[k], local)[row[1:]]
        return found

    def states(self, t: Array, order: int) -> Array:
        """Return derivatives of this order at times (k,) within the motion, (k, n)."""
        n, found = self.metric.dim, self.at(t)
        if order == 2:
            found, order = _rates(self.metric, found), 1
        return found[:, order * n : (order + 1) * n]

    def torques(self, t: ArrayLike) -> Array:
        """Return the generalised forces without gravity, G D_t q', (n,) or (k, n) [N m or N]."""
        values = self.at(t)[:, 3 * self.metric.dim :]
        return values[0] if np.ndim(t) == 0 else values

    def hamiltonian(self, t: ArrayLike) -> Array:
        """Return p'q' + r' G^-1 r / 2 - r' G^-1 Gamma(q', q') at times (k,), which is constant
        between knots.
        """
        n, states = self.metric.dim, self.at(t)
        q, v, p, r = (states[:, i * n : (i + 1) * n] for i in range(4))
        acceleration = _rates(self.metric, states)[:, n : 2 * n]
        return np.asarray(np.sum(p * v + r * acceleration, axis=1) - self._products(q, r) / 2.0)

    def residual(self, t: ArrayLike) -> Array:
        """Return D_t^3 q' + R(D_t q', q') q' at times (k,), (k, n): zero up to rounding.

        The covariant derivatives follow from Hamilton's equations by the chain rule, the curvature
        from the metric alone.
        """
        equation = cubic_equation(self.metric)
        return np.array([equation(state).full()[:, 0] for state in self.at(t)])

    @cached_property
    def certificate(self) -> MotionCertificate:
        """The accuracy of the motion, and whether it is locally minimizing; takes a moment."""
        t = np.linspace(self.times[0], self.times[-1], _SAMPLES)
        a = _rates(self.metric, self.at(t))[:, self.metric.dim : 2 * self.metric.dim]
        scale = np.abs(a).max() / np.diff(self.times).min() ** 2
        residual = float(np.abs(self.residual(t)).max() / scale) if scale > 0.0 else 0.0
        halves = (self.times[:-1] + self.times[1:]) / 2.0
        times = np.sort(np.append(self.times, halves))
        knots = np.hstack([self(times), self(times, 1)])
        s = _FINE.rule[0]
        inside = state_matrix(_FINE, times, 1, instants(times, s))[::3].toarray()
        others = np.zeros((len(times) - 1, _FINE.bubbles, 1))
        is_knot = variables(np.ones((len(times), 2)), others) > 0.0
        x = np.zeros((is_knot.size, self.metric.dim))
        x[is_knot] = knots.reshape(-1, self.metric.dim)
        missing = self(instants(times, s)) - inside @ x
        x[~is_knot] = np.linalg.lstsq(inside[:, ~is_knot], missing)[0]
        free = np.ones((len(times), 2, self.metric.dim), dtype=bool)
        free[::2] = self.is_free.reshape(-1, 2, self.metric.dim)
        moves = np.ones(x.shape, dtype=bool)
        moves[is_knot] = free.reshape(-1, self.metric.dim)
        functions = action_program(self.metric, _FINE, np.diff(times)).functions
        tensor, index = self.metric.matrix(knots[0, : self.metric.dim]), np.flatnonzero(moves)
        # The unit of a motion at constant speed, or of none, whose action vanishes.
        speed = np.sum(knots[:, self.metric.dim :] ** 2) / self.duration
        floor = _SMALL * np.trace(tensor) * (speed + 1.0 / self.duration**3)
        unit = max(self.action, float(floor))
        gradient = functions["grad_f"](x.ravel(), [])[1].full()[index, 0] / unit
        hessian = functions["hess_lag"](x.ravel(), [], 1.0 / unit, []).full()
        hessian = (np.triu(hessian) + np.triu(hessian, 1).T)[np.ix_(index, index)]
        stationary, negative = stationarity_and_index(gradient, hessian)
        return MotionCertificate(self.error, residual, stationary, negative)


@dataclass(frozen=True, repr=False)
class MotionCertificate(ShortRepr):
    """What was checked of a motion, independently of how it was found.

    Attributes:
        knot_error: largest difference of the integrated cubics from the knots [rad or m, per s].
        residual: of D_t^3 q' + R(D_t q', q') q' = 0, relative to the largest acceleration over the
            square of the shortest interval.
        stationary: whether a Newton step on twice as many segments changes the action by less
            than 1e-5 of it.
        negative: number of negative eigenvalues of the second variation there.
    """

    knot_error: float
    residual: float
    stationary: bool
    negative: int

    _shown = ("knot_error", "residual", "stationary", "negative")

    @property
    def locally_minimizing(self) -> bool:
        """True if the motion is stationary and its second variation is not negative anywhere."""
        return self.stationary and self.negative == 0


def cubic_equation(metric: Metric) -> ca.Function:
    """Return (q, q', p, r) -> D_t^3 q' + R(D_t q', q') q' along Hamilton's equations, (4 n) -> (n).

    Riemannian cubics make it vanish (Noakes, Heinzinger, Paden 1989, equation 3).
    """
    n = metric.dim
    y, z = ca.SX.sym("y", 4 * n), ca.SX.sym("z", n)
    q, v, r = y[:n], y[n : 2 * n], y[3 * n :]
    rate = second_order(metric).rate(y)

    w = ca.SX.sym("w", n)
    along = metric._transport_rate(q, v, w)  # of a field that is held constant

    def covariant(field: ca.SX) -> ca.SX:
        """Return D_t of a vector field along the motion."""
        return ca.jtimes(field, y, rate) - ca.substitute(along, w, field)

    first = ca.ldl_solve(r, *ca.ldl(metric._matrix_function(q), False))
    third = covariant(covariant(first))
    lowered = ca.gradient(metric.curvature_form(q, first, v, v, z), z)
    curvature = ca.ldl_solve(lowered, *ca.ldl(metric._matrix_function(q), False))
    return ca.Function("cubic_equation", [y], [ca.densify(third + curvature)])


def cubic(
    metric: Metric,
    q0: ArrayLike,
    v0: ArrayLike | None,
    q1: ArrayLike,
    v1: ArrayLike | None,
    duration: float,
) -> RiemannianSpline:
    """Return the Riemannian cubic between two positions and velocities.

    It minimizes int |D_t q'|^2_G dt locally, D_t q' = q'' + G^-1 Gamma(q', q') (Noakes, Heinzinger,
    Paden 1989; Crouch, Silva Leite 1995), and satisfies D_t^3 q' + R(D_t q', q') q' = 0. The result
    was integrated from its states: positions and velocities meet to 1e-9, and the second variation
    of the discrete action is positive.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm()
    >>> metric = go.KineticEnergy(arm.with_armature(go.manifold.default_joint_inertia(arm)))
    >>> q0, q1 = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> reach = go.cubic(metric, q0, [0.0] * 7, q1, [0.0] * 7, 0.5)
    >>> reach(0.25).round(3)
    array([ 0.408,  0.118, -0.537,  1.197,  0.05 ,  0.009,  0.063])

    Args:
        metric: metric of the manifold.
        q0, q1: the ends (n,).
        v0, v1: velocities there (n,) [per s]; None leaves one free, so that D_t q' is zero there.
        duration: time from q0 to q1 [s].

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a metric that is not positive
            definite at the ends.
        NotConverged: no cubic was found.
    """
    metric, times = as_metric(metric), np.array([0.0, as_positive("duration", duration, "s")])
    points = np.array([metric.point("q0", q0), metric.point("q1", q1)])
    return _spline(metric, times, points, v0, v1)


def spline(
    metric: Metric,
    times: ArrayLike,
    configurations: Sequence[ArrayLike] | Array,
    *,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
) -> RiemannianSpline:
    """Return the Riemannian cubic spline through configurations at given times.

    It minimizes int |D_t q'|^2_G dt locally among the motions through the configurations: between
    them it is a Riemannian cubic, at them it is twice continuously differentiable.

    Args:
        metric: metric of the manifold.
        times: increasing (k,) [s], at least two.
        configurations: (k, n).
        v0, v1: velocities at the ends (n,) [per s]: zeros for rest, None for natural ends, at which
            D_t q' is zero.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, times that do not increase, or a
            metric that is not positive definite at a configuration.
        NotConverged: no spline was found.
    """
    metric = as_metric(metric)
    instants = real_array(times, "times")
    increasing = instants.ndim == 1 and np.all(np.diff(instants) > 0.0)
    if not (increasing and len(instants) > 1 and np.all(np.isfinite(instants))):
        raise ValueError("times must be at least two increasing numbers")
    count = len(configurations) if hasattr(configurations, "__len__") else 0
    if count != len(instants):
        raise ValueError(
            f"there must be one configuration for each time, got {len(instants)} times and "
            f"{count} configurations"
        )
    named = enumerate(configurations)
    points = np.array([metric.point(f"configurations[{i}]", q) for i, q in named])
    return _spline(metric, instants, points, v0, v1)


def _spline(
    metric: Metric, times: Array, points: Array, v0: ArrayLike | None, v1: ArrayLike | None
) -> RiemannianSpline:
    named = ("v0", v0), ("v1", v1)
    velocities = [None if v is None else as_vector(name, v, metric.dim) for name, v in named]
    flat = _flat_spline(times, points, *velocities)
    is_free = np.repeat([[False, True]], len(times), axis=0)
    is_free[[0, -1], 1] = [v is None for v in velocities]
    is_free = np.repeat(is_free, metric.dim, axis=1)
    if metric.has_constant_tensor:
        return _closed_form(metric, times, flat, is_free)
    knots = np.hstack([points, flat(times, 1)])
    return _least_action(metric, times, knots, is_free)


def _flat_spline(times: Array, points: Array, v0: Array | None, v1: Array | None) -> CubicSpline:
    """Return the cubic spline of a constant metric."""
    zeros = np.zeros(points.shape[1])
    ends = tuple((2, zeros) if v is None else (1, v) for v in (v0, v1))
    return CubicSpline(times, points, bc_type=ends)


def _closed_form(
    metric: Metric, times: Array, flat: CubicSpline, is_free: Mask
) -> RiemannianSpline:
    tensor = metric.matrix(flat(times[0]))
    q, v, a, j = (flat.derivative(k)(times[:-1]) if k else flat(times[:-1]) for k in range(4))
    end = np.append(flat(times[-1]), flat(times[-1], 1))
    states = np.hstack([q, v, -j @ tensor, a @ tensor])
    return RiemannianSpline(metric, times, states, end, 0.0, is_free)


def _least_action(metric: Metric, times: Array, knots: Array, is_free: Mask) -> RiemannianSpline:
    with one_blas_thread:
        for found in _attempts(metric, times, knots, is_free):
            if found is not None:
                return found
    cause = singularity_along(metric, _between(times, knots)) or (
        "the velocities are large for these configurations and times; give more configurations, "
        "or other times"
    )
    raise NotConverged(f"no motion of least covariant acceleration was found: {cause}")


def _between(times: Array, knots: Array) -> Array:
    """Return positions of the cubic polynomials through the knots, (k, n)."""
    n = knots.shape[1] // 2
    curve = CubicHermiteSpline(times, knots[:, :n], knots[:, n:])
    return np.asarray(curve(np.linspace(times[0], times[-1], _SAMPLES)))


def _attempts(
    metric: Metric, times: Array, knots: Array, is_free: Mask
) -> Iterator[RiemannianSpline | None]:
    flat = np.zeros((len(times) - 1, _COARSE.bubbles, metric.dim))
    levels: Levels = ((_COARSE, 1e-6), (_FINE, _DECREASE))
    found = _find(metric, levels, np.diff(times), knots, flat, is_free)
    if found is not None:
        yield _matched(metric, times, found, is_free)
        start = times, found.knots, found.coefficients, is_free
        yield from _refined(metric, *_bisected(*start), _BISECTIONS)
    # From small motions, which are nearly those of a constant metric, to the whole one.
    start = times, knots, np.zeros((len(times) - 1, _FINE.bubbles, metric.dim)), is_free
    for _ in range(_HALVINGS):
        start = _bisected(*start)
    times, knots, coefficients, is_free = start
    origin = np.append(knots[0, : metric.dim], np.zeros(metric.dim))
    whole, small = knots - origin, (knots - origin) / _SCALES
    coefficients = coefficients / _SCALES
    for step in range(1, _SCALES + 1):
        small = np.where(is_free, small, whole * step / _SCALES)
        levels = ((_FINE, 1e-4),)
        found = _find(metric, levels, np.diff(times), origin + small, coefficients, is_free)
        if found is None:
            return
        growth = (step + 1) / step if step < _SCALES else 1.0
        small, coefficients = (found.knots - origin) * growth, found.coefficients * growth
    yield from _refined(metric, times, origin + small, coefficients, is_free, _BISECTIONS - 1)


def _find(
    metric: Metric,
    levels: Levels,
    durations: Array,
    knots: Array,
    coefficients: Array,
    is_free: Mask,
) -> DiscreteMotion | None:
    """Return the discrete motion by the compiled core, or by Ipopt on the last level alone."""
    kernels = second_order(metric)
    if kernels.available():
        return kernels.find(motion_levels(*levels), durations, knots, coefficients, is_free)
    basis = levels[-1][0]
    wider = np.zeros((len(durations), basis.bubbles, metric.dim))
    wider[:, : coefficients.shape[1]] = coefficients
    return find_by_ipopt(metric, basis, durations, knots, wider, is_free)


def _refined(
    metric: Metric,
    times: Array,
    knots: Array,
    coefficients: Array,
    is_free: Mask,
    rounds: int,
) -> Iterator[RiemannianSpline | None]:
    """Yield motions, None where the last failed, with twice as many segments in every round."""
    for _ in range(rounds):
        levels = ((_FINE, _DECREASE),)
        found = _find(metric, levels, np.diff(times), knots, coefficients, is_free)
        if found is None:
            return
        yield _matched(metric, times, found, is_free)
        start = times, found.knots, found.coefficients, is_free
        times, knots, coefficients, is_free = _bisected(*start)


def _bisected(
    times: Array, knots: Array, coefficients: Array, is_free: Mask
) -> tuple[Array, Array, Array, Mask]:
    """Return the same motion with twice as many segments; the new knots are free."""
    twice = np.ones((2 * len(times) - 1, knots.shape[1]), dtype=bool)
    twice[::2] = is_free
    return (*bisected(_FINE, times, knots, coefficients), twice)


def _matched(
    metric: Metric, times: Array, found: DiscreteMotion, is_free: Mask
) -> RiemannianSpline | None:
    """Correct a discrete motion until the integrated cubics meet at the knots.

    Positions, velocities and, where these are free, momenta of both sides agree: Newton's method
    (multiple shooting) with the derivatives of the discrete action. None where it does not
    converge.
    """
    size = found.knots.shape[1]
    knots, durations = found.knots.copy(), np.diff(times)
    momenta = -found.gradients[:, :size]
    start, mixed = found.hessians[:, :size, :size], found.hessians[:, :size, size:]
    end = found.hessians[:, size:, size:]
    try:
        factor = _banded_cholesky(found.hessians, is_free)
        last = np.inf
        for _ in range(_ROUNDS):
            is_fine = last < _NEAR
            ends = _ends(metric, knots, momenta, durations, _STEP * (1.0 if is_fine else _COARSER))
            missed = ends[:, :size] - knots[1:]
            before = momenta + np.einsum("kij,kj->ki", mixed, missed)
            after = ends[:, size:] - np.einsum("kij,kj->ki", end, missed)
            jump = np.zeros_like(knots)
            jump[:-1] -= before
            jump[1:] += after
            jump[np.logical_not(is_free)] = 0.0
            change = -cho_solve_banded((factor, False), jump.ravel()).reshape(knots.shape)
            missing, moving = np.abs(missed).max(), np.abs(change).max()
            error = max(missing, moving)
            if is_fine and missing <= TOLERANCE and moving <= _MOVING:
                states = np.hstack([knots[:-1], momenta])
                return RiemannianSpline(metric, times, states, knots[-1], float(missing), is_free)
            if not error < min(_CONTRACTION * last, _FAR):
                return None
            last = error
            knots = knots + change
            momenta = before - np.einsum("kij,kj->ki", start, change[:-1])
            momenta -= np.einsum("kij,kj->ki", mixed, change[1:])
    except (IntegrationFailed, np.linalg.LinAlgError):
        return None
    return None


def _banded_cholesky(hessians: Array, is_free: Mask) -> Array:
    """Return the factor of the sum of the segments' Hessians, with unit rows where not free."""
    count, size = len(hessians), is_free.shape[1]
    band = np.zeros((2 * size, (count + 1) * size))
    row, column = np.triu_indices(2 * size)
    for k in range(count):
        free = is_free[k : k + 2].ravel()
        block = hessians[k] * np.outer(free, free)
        band[2 * size - 1 + row - column, k * size + column] += block[row, column]
    band[-1, np.logical_not(is_free.ravel())] = 1.0
    return np.asarray(cholesky_banded(band))


def _ends(
    metric: Metric, knots: Array, momenta: Array, durations: Array, tolerance: float
) -> Array:
    """Return the final states (k, 4 n) of cubics from the knots."""
    starts = np.hstack([knots[:-1], momenta])
    pairs = zip(starts, durations, strict=True)
    return np.array(
        [_integrated(metric, each, np.array([0.0, length]), tolerance)[1] for each, length in pairs]
    )


def _integrated(metric: Metric, start: Array, times: Array, tolerance: float = _STEP) -> Array:
    """Return states (k, 4 n) of Hamilton's equations at times (k,) from the first on."""
    if metric.has_constant_tensor:
        q, v, p, r = start.reshape(4, -1)
        t = times[:, None] - times[0]
        a, j = np.linalg.solve(metric.matrix(q), np.column_stack([r, -p])).T
        position = q + t * (v + t * (a / 2.0 + t * j / 6.0))
        return np.hstack([position, v + t * (a + t * j / 2.0), np.tile(p, t.shape), r - t * p])
    kernels: MotionKernels = second_order(metric)
    if kernels.available():
        return kernels.states(start, times, tolerance, _MAX_STEPS)
    return integrate_by_scipy(kernels.rate, start, times, tolerance, None, _MAX_STEPS)


def _rates(metric: Metric, states: Array) -> Array:
    """Return Hamilton's equations at states (k, 4 n)."""
    rate = second_order(metric).rate
    return np.array([evaluate(rate, state)[:, 0] for state in states]).reshape(states.shape)
