"""The Levi-Civita connection: parallel transport along curves, and curvature."""

from __future__ import annotations

import time
from itertools import combinations, pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.compiled.source import STAGE_TIMES
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.kernels import integrate_by_scipy
from geodesic_ocp.manifold.metric import Metric, as_metric

_MAX_STEPS = 20_000  # between two breakpoints


class ParametricCurve(Protocol):
    """A curve in R^n that is smooth between its breakpoints, such as a Path or a Motion."""

    @property
    def breakpoints(self) -> Array:
        """Increasing parameter values (k,) from the start of the curve to its end."""

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Get positions (len(s), n) at s, or derivatives of the given order with respect to s."""


def parallel_transport(
    metric: Metric, path_or_motion: ParametricCurve, v: ArrayLike, *, tolerance: float = 1e-9
) -> Array:
    """Parallel-transport a vector v (n,) from the start of a curve to its end, (n,).

    sum_j g_ij w'_j + sum_jk Gamma_ijk gamma'_j w_k = 0, w(0) = v. Norms and angles are preserved.

    The velocity of a geodesic is parallel along it:

    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0, q1 = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.8, 0.2, -0.3, 0.5, 0.1, 0.0, 0.0]
    >>> path = go.geodesic(metric, q0, q1)
    >>> transported = go.parallel_transport(metric, path, path(0.0, 1))
    >>> np.allclose(transported, path(1.0, 1), atol=1e-4)
    True

    Args:
        metric: metric of the manifold.
        path_or_motion: the curve: a `Path`, or a `Motion`, whose samples are interpolated by a
            cubic spline.
        v: vector (n,) at its start.
        tolerance: bound of the change of norms and angles, relative to |v|.

    Raises:
        ValueError: wrong shape, numbers that are not finite, or a curve of another dimension or
            where the metric is not defined.
        IntegrationFailed: the metric becomes singular along the curve.
    """
    curve = path_or_motion
    stops = path_or_motion.breakpoints
    metric = as_metric(metric)
    vector = as_vector("v", v, metric.dim)
    tolerance = as_positive("tolerance", tolerance)
    if np.shape(curve(stops[:1]))[-1] != metric.dim:
        raise ValueError(f"the curve must have the dimension of the metric, {metric.dim}")
    size = float(np.linalg.norm(vector))
    if size == 0.0:
        return np.zeros(metric.dim)
    if metric.has_constant_tensor:
        metric.point("the curve's start", curve(stops[:1])[0])
        return vector
    transport = _compiled if metric.kernels.available(at_once=False) else _by_scipy
    began = time.perf_counter()
    try:
        result = transport(metric, curve, vector / size, stops, 0.01 * tolerance)
    except IntegrationFailed:
        metric.check_domain_along("the curve", stops, curve(stops))
        raise
    if transport is _by_scipy:
        metric.kernels.used(time.perf_counter() - began)
    return np.asarray(size * result)


def _by_scipy(
    metric: Metric, curve: ParametricCurve, vector: Array, stops: Array, tolerance: float
) -> Array:
    """Return the vector transported along all stops, with adaptive steps of this tolerance."""
    for start, stop in pairwise(stops):

        def along(t: float, start: float = start, stop: float = stop) -> Array:
            return _states(curve, np.array([t]), start, stop).T

        ends = np.array([start, stop])
        rate = metric.transport_equation
        try:
            vector = integrate_by_scipy(rate, vector, ends, tolerance, along)[-1]
        except IntegrationFailed as failure:
            raise IntegrationFailed(f"parallel transport: {failure}") from None
    return vector


def _states(curve: ParametricCurve, times: Array, start: ArrayLike, stop: ArrayLike) -> Array:
    """Return positions and velocities (k, 2 n) at times (k,) between start and stop.

    One-sided at the ends, to exclude the derivative of the adjacent piece.
    """
    middle = np.add(start, stop) / 2
    half = np.subtract(stop, start) / 2
    inside = middle + (1.0 - 1e-12) * np.clip(times - middle, -half, half)
    return np.hstack([curve(inside), curve(inside, 1)])


def _compiled(
    metric: Metric, curve: ParametricCurve, vector: Array, stops: Array, tolerance: float
) -> Array:
    """Return the same, with equal steps between two stops, as many as each piece needs."""
    counts = np.ones(len(stops) - 1, dtype=int)
    while True:
        piece = np.repeat(np.arange(counts.size), counts)
        number = np.arange(piece.size) - np.repeat(np.cumsum(counts) - counts, counts)
        sizes = (np.diff(stops) / counts)[piece]
        times = (stops[piece] + number * sizes)[:, None] + sizes[:, None] * STAGE_TIMES
        starts, ends = (np.repeat(each[piece], STAGE_TIMES.size) for each in (stops, stops[1:]))
        states = _states(curve, times.ravel(), starts, ends).reshape(*times.shape, -1)
        vectors, errors = metric.kernels.transport(
            sizes, np.ascontiguousarray(states), vector, tolerance
        )
        errors = np.maximum.reduceat(errors, np.cumsum(counts) - counts)
        if np.all(errors <= 1.0):
            return np.asarray(vectors[-1])
        worst = int(np.argmax(errors))
        if counts[worst] >= _MAX_STEPS:
            raise IntegrationFailed(
                f"parallel transport: between {stops[worst]:.6g} and {stops[worst + 1]:.6g}, "
                f"{counts[worst]} steps do not reach a tolerance of {tolerance:.1e} per step; the "
                "metric is singular there, or the tolerance cannot be reached"
            )
        factors = np.clip(errors ** (1 / 8) / 0.9, 1.0, 8.0)
        counts = np.where(errors > 1.0, np.ceil(factors * counts).astype(int) + 1, counts)


# Vectors are parallel if |u|^2 |v|^2 - <u, v>^2 is below this fraction of |u|^2 |v|^2.
_PARALLEL = 1e-12


def riemann_curvature(
    metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike, w: ArrayLike, z: ArrayLike
) -> float:
    """Return Riemann curvature tensor <R(u, v) w, z> at q for four tangent vectors (n,).

    R(u, v) w = D_u D_v w - D_v D_u w - D_[u, v] w with the Levi-Civita connection D, so that
    <R(u, v) v, u> is positive on a sphere (do Carmo, "Riemannian Geometry" (1992), chapter 4, uses
    the opposite sign).

    >>> import casadi as ca
    >>> class Globe(go.Metric):  # radius 2, in colatitude and longitude
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return 4.0 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))
    >>> south, east = [1.0, 0.0], [0.0, 1.0]
    >>> round(go.manifold.riemann_curvature(Globe(), [1.5708, 0.0], south, east, east, south), 3)
    4.0

    Args:
        metric: metric of the manifold.
        q: configuration (n,).
        u, v, w, z: tangent vectors (n,) there.

    Raises:
        ValueError: wrong shapes or values, or the metric is not positive definite at q.
    """
    q = as_metric(metric).point("q", q)
    vectors = zip("uvwz", (u, v, w, z), strict=True)
    return _form(metric, q, *(as_vector(name, vector, metric.dim) for name, vector in vectors))


def sectional_curvature(metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike) -> float:
    """Return sectional curvature <R(u, v) v, u> / (|u|^2 |v|^2 - <u, v>^2) of the plane of u and v
    at q.

    It depends on the plane only: 1 on the unit sphere, 0 in flat space. If it is negative,
    geodesics from the same point diverge.

    >>> import casadi as ca
    >>> class Globe(go.Metric):  # radius 2, in colatitude and longitude
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return 4.0 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))
    >>> round(go.manifold.sectional_curvature(Globe(), [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]), 12)
    0.25

    Args:
        metric: metric of the manifold.
        q: configuration (n,).
        u, v: tangent vectors (n,) there that are not parallel.

    Raises:
        ValueError: wrong shapes or values, u and v are parallel, or the metric is not positive
            definite at q.
    """
    q = as_metric(metric).point("q", q)
    first = as_vector("u", u, metric.dim)
    second = as_vector("v", v, metric.dim)
    squares = metric.inner(q, first, first) * metric.inner(q, second, second)
    area = squares - metric.inner(q, first, second) ** 2
    if area <= _PARALLEL * squares:
        raise ValueError(f"u and v do not span a plane: u = {first}, v = {second}")
    return float(_form(metric, q, first, second, second, first) / area)


def scalar_curvature(metric: Metric, q: ArrayLike) -> float:
    """Return scalar curvature at q: the sum of sectional curvatures over ordered pairs of basis
    vectors.

    The basis is orthonormal, so each plane counts twice: in two dimensions it is twice the
    `sectional_curvature`, in one 0.

    >>> import casadi as ca
    >>> class Globe(go.Metric):  # radius 2, in colatitude and longitude
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return 4.0 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))
    >>> round(go.manifold.scalar_curvature(Globe(), [1.0, 0.0]), 12)
    0.5

    Args:
        metric: metric of the manifold.
        q: configuration (n,).

    Raises:
        ValueError: wrong shape or values, or the metric is not positive definite at q.
    """
    q = as_metric(metric).point("q", q)
    # The rows of L^-1 are orthonormal where G = L L'.
    basis = np.linalg.inv(np.linalg.cholesky(metric.matrix(q)))
    return sum((2.0 * _form(metric, q, u, v, v, u) for u, v in combinations(basis, 2)), start=0.0)


def _form(metric: Metric, *vectors: Array) -> float:
    return float(metric.curvature_form(*vectors))
