"""The search for Riemannian cubics and splines: least discrete action, then multiple shooting.

Times and tensions are in a unit of time of about one interval.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_newton import singularity_along
from geodesic_ocp.logarithm.motion_by_ipopt import find_by_ipopt
from geodesic_ocp.logarithm.riemannian_spline import (
    FINE,
    LONGEST,
    STEP,
    Mask,
    RiemannianSpline,
    arrivals,
    stumpff,
)
from geodesic_ocp.manifold.kernels import one_blas_thread
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.motion_kernels import (
    DiscreteMotion,
    SegmentBasis,
    motion_levels,
    second_order,
)
from geodesic_ocp.ocp.motion_program import bisected

Levels: TypeAlias = tuple[tuple[SegmentBasis, float], ...]

_TOLERANCE = 1e-9  # of positions and velocities where segments meet
_COARSER = 1e4  # first tolerance of the integration, relative to the last
_MOVING = 1e-8  # the last change of free knots: rounding of momenta moves them
_NEAR = 1e-5  # errors from which on integrations are fine
_ROUNDS = 12
_CONTRACTION = 0.4
_FAR = 0.5  # errors of the discrete motion from which on more segments are better
_COARSE = SegmentBasis(4, 9)
_DECREASE = 1e-11  # of the action, relative, by the last step
_BISECTIONS = 5
# segments, and steps of the continuation from small motions
_HALVINGS = 2
_SCALES = 8
_SAMPLES = 50


def least_action(
    metric: Metric, times: Array, knots: Array, is_free: Mask, tension: float
) -> RiemannianSpline:
    """Return the spline with given knots.

    Args:
        metric: metric of the manifold.
        times: of the knots (k + 1,).
        knots: positions and velocities (k + 1, 2 n); any where they are free.
        is_free: True for the components that are optimal (k + 1, 2 n).
        tension: zero for Riemannian cubics.

    Raises:
        NotConverged: none was found.
    """
    times, knots, is_free = _divided(times, knots, is_free, tension)
    knots, momenta = _flat_spline(times, knots, is_free, tension)
    if metric.has_constant_tensor:
        n = metric.dim
        tensor = metric.matrix(knots[0, :n])
        momenta = (momenta.reshape(-1, 2, n) @ tensor).reshape(-1, 2 * n)
        starts = np.hstack([knots[:-1], momenta])
        ends = arrivals(metric, starts, np.diff(times), tension)[:, : 2 * n]
        error = float(np.abs(ends - knots[1:]).max())
        return RiemannianSpline(metric, times, starts, knots[-1], error, is_free, tension)
    with one_blas_thread:
        for found in _attempts(metric, times, knots, is_free, tension):
            if found is not None:
                return found
    cause = singularity_along(metric, _between(times, knots)) or (
        "the ends are far apart or the velocities large for these times, or the curve passes near "
        "a singularity; give more configurations, or other times"
    )
    raise NotConverged(f"no motion of least covariant acceleration was found: {cause}")


def _divided(
    times: Array, knots: Array, is_free: Mask, tension: float
) -> tuple[Array, Array, Mask]:
    """Divide intervals, with free knots, in which motions in tension grow too much."""
    parts = np.maximum(1, np.ceil(tension * np.diff(times) / LONGEST)).astype(int)
    rows = np.append(0, np.cumsum(parts))
    instants = np.interp(np.arange(rows[-1] + 1), rows, times)
    divided = np.zeros((len(instants), knots.shape[1]))
    free = np.ones(divided.shape, dtype=bool)
    divided[rows] = knots
    free[rows] = is_free
    return instants, divided, free


def _flat_spline(times: Array, knots: Array, is_free: Mask, tension: float) -> tuple[Array, Array]:
    """Return the knots of the spline of a constant metric, and G^-1 (p, r) at the starts (k, 2 n).

    Between its knots q'''' = tension^2 q'' (splines in tension: Schweikert 1966). The action of an
    interval is a quadratic form of the positions and velocities at its ends.
    """
    n = knots.shape[1] // 2
    h = np.diff(times)[:, None]
    c0, c1, c2, c3 = stumpff(tension * h)
    q0, v0, q1, v1 = np.eye(4)
    step = q1 - q0 - h * v0
    change = v1 - v0
    determinant = c2**2 - c1 * c3
    a = (c2 * step / h**2 - c3 * change / h) / determinant
    j = (c2 * change / h**2 - c1 * step / h**3) / determinant
    p = tension**2 * v0 - j
    forms = np.stack([-p, -a, p, c0 * a + c1 * h * j], axis=1)  # second derivatives of the action
    origin = np.concatenate([knots[0, :n], np.zeros(n)])
    x = np.where(is_free, 0.0, knots - origin).reshape(-1, 2, n)
    rows = is_free[:, [0, n]]

    def slopes() -> Array:
        """Return the gradient of every interval's action by its ends (k, 4, n)."""
        return np.asarray(forms @ np.concatenate([x[:-1], x[1:]], axis=1))

    gradient = np.zeros_like(x)
    gradient[:-1] += slopes()[:, :2]
    gradient[1:] += slopes()[:, 2:]
    gradient[~rows] = 0.0
    factor = _banded_cholesky(forms, rows)
    x = x - cho_solve_banded((factor, False), gradient.reshape(-1, n)).reshape(x.shape)
    return x.reshape(-1, 2 * n) + origin, -slopes()[:, :2].reshape(-1, 2 * n)


def _between(times: Array, knots: Array) -> Array:
    """Return positions of the cubic polynomials through the knots, (k, n)."""
    n = knots.shape[1] // 2
    curve = CubicHermiteSpline(times, knots[:, :n], knots[:, n:])
    return np.asarray(curve(np.linspace(times[0], times[-1], _SAMPLES)))


def _attempts(
    metric: Metric, times: Array, knots: Array, is_free: Mask, tension: float
) -> Iterator[RiemannianSpline | None]:
    flat = np.zeros((len(times) - 1, _COARSE.bubbles, metric.dim))
    levels: Levels = ((_COARSE, 1e-6), (FINE, _DECREASE))
    found = _find(metric, levels, np.diff(times), knots, flat, is_free, tension)
    if found is not None:
        yield _matched(metric, times, found, is_free, tension)
        start = times, found.knots, found.coefficients, is_free
        yield from _refined(metric, *_bisected(*start), tension, _BISECTIONS)
    # From small motions, which are nearly those of a constant metric, to the whole one.
    start = times, knots, np.zeros((len(times) - 1, FINE.bubbles, metric.dim)), is_free
    for _ in range(_HALVINGS):
        start = _bisected(*start)
    times, knots, coefficients, is_free = start
    origin = np.append(knots[0, : metric.dim], np.zeros(metric.dim))
    whole = knots - origin
    small = (knots - origin) / _SCALES
    coefficients = coefficients / _SCALES
    for step in range(1, _SCALES + 1):
        small = np.where(is_free, small, whole * step / _SCALES)
        levels = ((FINE, 1e-4),)
        guess = origin + small, coefficients, is_free
        found = _find(metric, levels, np.diff(times), *guess, tension)
        if found is None:
            return
        growth = (step + 1) / step if step < _SCALES else 1.0
        small = (found.knots - origin) * growth
        coefficients = found.coefficients * growth
    start = times, origin + small, coefficients, is_free
    yield from _refined(metric, *start, tension, _BISECTIONS - 1)


def _find(
    metric: Metric,
    levels: Levels,
    durations: Array,
    knots: Array,
    coefficients: Array,
    is_free: Mask,
    tension: float,
) -> DiscreteMotion | None:
    """Return the discrete motion by the compiled core, or by Ipopt on the last level alone."""
    kernels = second_order(metric)
    if kernels.available():
        guess = knots, coefficients, is_free
        return kernels.find(motion_levels(*levels), durations, *guess, tension)
    basis = levels[-1][0]
    wider = np.zeros((len(durations), basis.bubbles, metric.dim))
    wider[:, : coefficients.shape[1]] = coefficients
    return find_by_ipopt(metric, basis, durations, knots, wider, is_free, tension)


def _refined(
    metric: Metric,
    times: Array,
    knots: Array,
    coefficients: Array,
    is_free: Mask,
    tension: float,
    rounds: int,
) -> Iterator[RiemannianSpline | None]:
    """Yield motions, None where the last failed, with twice as many segments in every round."""
    for _ in range(rounds):
        levels = ((FINE, _DECREASE),)
        found = _find(metric, levels, np.diff(times), knots, coefficients, is_free, tension)
        if found is None:
            return
        yield _matched(metric, times, found, is_free, tension)
        start = times, found.knots, found.coefficients, is_free
        times, knots, coefficients, is_free = _bisected(*start)


def _bisected(
    times: Array, knots: Array, coefficients: Array, is_free: Mask
) -> tuple[Array, Array, Array, Mask]:
    """Return the same motion with twice as many segments; the new knots are free."""
    twice = np.ones((2 * len(times) - 1, knots.shape[1]), dtype=bool)
    twice[::2] = is_free
    return (*bisected(FINE, times, knots, coefficients), twice)


def _matched(
    metric: Metric, times: Array, found: DiscreteMotion, is_free: Mask, tension: float
) -> RiemannianSpline | None:
    """Correct a discrete motion until the integrated cubics meet at the knots.

    Positions, velocities and, where these are free, momenta of both sides agree: Newton's method
    (multiple shooting) with the derivatives of the discrete action. None where it does not
    converge.
    """
    size = found.knots.shape[1]
    knots = found.knots.copy()
    durations = np.diff(times)
    momenta = -found.gradients[:, :size]
    start = found.hessians[:, :size, :size]
    mixed = found.hessians[:, :size, size:]
    end = found.hessians[:, size:, size:]
    try:
        factor = _banded_cholesky(found.hessians, is_free)
        last = np.inf
        for _ in range(_ROUNDS):
            is_fine = last < _NEAR
            starts = np.hstack([knots[:-1], momenta])
            step = STEP * (1.0 if is_fine else _COARSER)
            ends = arrivals(metric, starts, durations, tension, step)
            missed = ends[:, :size] - knots[1:]
            before = momenta + np.einsum("kij,kj->ki", mixed, missed)
            after = ends[:, size:] - np.einsum("kij,kj->ki", end, missed)
            jump = np.zeros_like(knots)
            jump[:-1] -= before
            jump[1:] += after
            jump[np.logical_not(is_free)] = 0.0
            change = -cho_solve_banded((factor, False), jump.ravel()).reshape(knots.shape)
            missing = np.abs(missed).max()
            moving = np.abs(change).max()
            error = max(missing, moving)
            if is_fine and missing <= _TOLERANCE and moving <= _MOVING:
                end = knots[-1]
                error = float(missing)
                return RiemannianSpline(metric, times, starts, end, error, is_free, tension)
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
    count = len(hessians)
    size = is_free.shape[1]
    band = np.zeros((2 * size, (count + 1) * size))
    row, column = np.triu_indices(2 * size)
    for k in range(count):
        free = is_free[k : k + 2].ravel()
        block = hessians[k] * np.outer(free, free)
        band[2 * size - 1 + row - column, k * size + column] += block[row, column]
    band[-1, np.logical_not(is_free.ravel())] = 1.0
    return np.asarray(cholesky_banded(band))
