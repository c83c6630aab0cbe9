"""The Levi-Civita connection: parallel transport along curves, and curvature."""

from __future__ import annotations

from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, as_metric

_MAX_STEPS = 4096  # between two breakpoints
# The method of Gauss of order 8 on [0, 1] (Hairer, Norsett, Wanner, *Solving Ordinary Differential
# Equations I*, 2nd ed., section II.7).
_NODES, _WEIGHTS = (each / 2.0 for each in np.polynomial.legendre.leggauss(4))
_NODES = _NODES + 0.5
_POWERS = np.arange(1, 5)
_STAGES = _NODES[:, None] ** _POWERS / _POWERS @ np.linalg.inv(_NODES[:, None] ** (_POWERS - 1))


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
    """Return parallel-transport a vector v (n,) from the start of a curve to its end, (n,).

    sum_j g_ij w'_j + sum_jk Gamma_ijk gamma'_j w_k = 0, w(0) = v. Norms and angles are preserved,
    to `tolerance` relative to |v|. The curve is a Path, or a Motion, whose samples are interpolated
    by a cubic spline.

    The velocity of a geodesic is parallel along it:

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0, q1 = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.8, 0.2, -0.3, 0.5, 0.1, 0.0, 0.0]
    >>> path = go.geodesic(metric, q0, q1)
    >>> transported = go.parallel_transport(metric, path, path(0.0, 1))
    >>> np.allclose(transported, path(1.0, 1), atol=1e-4)
    True

    Raises:
        ValueError: wrong shape, numbers that are not finite, or a curve of another dimension or
            where the metric is not defined.
        IntegrationFailed: the metric becomes singular along the curve.
    """
    curve, stops = path_or_motion, path_or_motion.breakpoints
    metric = as_metric(metric)
    vector = as_vector("v", v, metric.dim)
    tolerance = as_positive("tolerance", tolerance)
    if np.shape(curve(stops[:1]))[-1] != metric.dim:
        raise ValueError(f"the curve must have the dimension of the metric, {metric.dim}")
    if metric.has_constant_tensor:
        metric.point("the curve's start", curve(stops[:1])[0])
        return vector
    parts, before = 1, np.full(metric.dim, np.nan)
    while True:
        times, sizes = _gauss_points(stops, parts)
        found = transport_by_steps(
            metric, sizes, np.hstack([curve(times), curve(times, 1)]), vector
        )
        if np.abs(found - before).max() <= tolerance * np.linalg.norm(vector):
            return found
        if parts >= _MAX_STEPS or not np.all(np.isfinite(found)):
            metric.check_domain_along("the curve", stops, curve(stops))
            raise IntegrationFailed(
                f"parallel transport: {parts} steps between two breakpoints of the curve do not "
                f"reach a tolerance of {tolerance:.1e}; the metric is singular there, or the "
                "tolerance cannot be reached"
            )
        parts, before = 2 * parts, found


def _gauss_points(stops: Array, parts: int) -> tuple[Array, Array]:
    """Return times (k * 4,) of the stages and sizes (k,) of equal steps between two breakpoints."""
    pieces = np.arange(stops.size)
    ends = np.interp(np.arange(parts * pieces[-1] + 1) / parts, pieces, stops)
    sizes = np.diff(ends)
    return (ends[:-1, None] + sizes[:, None] * _NODES).ravel(), sizes


def transport_by_steps(metric: Metric, sizes: Array, curve: Array, vector: Array) -> Array:
    """Transport w (n,) with the method of Gauss of order 8, and return it at the end.

    The equation is linear, w' = A w: a step multiplies w by a matrix, found for all steps at once.

    Args:
        metric: metric of the curve.
        sizes: of the steps (k,).
        curve: positions and velocities (k * 4, 2 n) at the stages of each step.
        vector: w at the start.
    """
    n, stages, h = vector.size, _NODES.size, sizes[:, None, None]
    rates = metric.transport_matrices(curve).reshape(sizes.size, stages, n, n)
    coupled = np.einsum("ij,kiab->kiajb", _STAGES, rates).reshape(sizes.size, stages * n, -1)
    slopes = np.linalg.solve(np.eye(stages * n) - h * coupled, rates.reshape(len(h), -1, n))
    changes = np.tensordot(slopes.reshape(rates.shape), _WEIGHTS, (1, 0))
    for step in np.eye(n) + h * changes:
        vector = step.dot(vector)
    return vector


# Vectors are parallel if |u|^2 |v|^2 - <u, v>^2 is below this fraction of |u|^2 |v|^2.
_PARALLEL = 1e-12


def riemann_curvature(
    metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike, w: ArrayLike, z: ArrayLike
) -> float:
    """Return Riemann curvature tensor <R(u, v) w, z> at q for four tangent vectors (n,).

    R(u, v) w = D_u D_v w - D_v D_u w - D_[u, v] w with the Levi-Civita connection D, so that
    <R(u, v) v, u> is positive on a sphere (do Carmo, "Riemannian Geometry" (1992), chapter 4, uses
    the opposite sign).

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
    >>> import geodesic_ocp as go
    >>> class Globe(go.Metric):  # radius 2, in colatitude and longitude
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return 4.0 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))
    >>> round(go.manifold.sectional_curvature(Globe(), [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]), 12)
    0.25

    Raises:
        ValueError: wrong shapes or values, u and v are parallel, or the metric is not positive
            definite at q.
    """
    q = as_metric(metric).point("q", q)
    first, second = as_vector("u", u, metric.dim), as_vector("v", v, metric.dim)
    squares = metric.inner(q, first, first) * metric.inner(q, second, second)
    area = squares - metric.inner(q, first, second) ** 2
    if area <= _PARALLEL * squares:
        raise ValueError(f"u and v do not span a plane: u = {first}, v = {second}")
    return float(_form(metric, q, first, second, second, first) / area)


def scalar_curvature(metric: Metric, q: ArrayLike) -> float:
    """Return scalar curvature at q: the sum of sectional curvatures over ordered pairs of basis
    vectors.

    The basis is orthonormal, so each plane counts twice; the result is 0 in one dimension.

    Raises:
        ValueError: wrong shape or values, or the metric is not positive definite at q.
    """
    q = as_metric(metric).point("q", q)
    # The rows of L^-1 are orthonormal where G = L L'.
    basis = np.linalg.inv(np.linalg.cholesky(metric.matrix(q)))
    return sum((2.0 * _form(metric, q, u, v, v, u) for u, v in combinations(basis, 2)), start=0.0)


def _form(metric: Metric, *vectors: Array) -> float:
    return float(metric.curvature_form(*vectors))
