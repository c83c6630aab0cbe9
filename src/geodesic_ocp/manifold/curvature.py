"""Curvature of a metric, from exact derivatives of its tensor."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.manifold.metric import Metric, as_metric

# Vectors are parallel if |u|^2 |v|^2 - <u, v>^2 is below this fraction of |u|^2 |v|^2.
_PARALLEL = 1e-12


def riemann_curvature(
    metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike, w: ArrayLike, z: ArrayLike
) -> float:
    """Riemann curvature tensor <R(u, v) w, z> at q for four tangent vectors (n,).

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
    """Sectional curvature <R(u, v) v, u> / (|u|^2 |v|^2 - <u, v>^2) of the plane of u and v at q.

    It depends on the plane only: 1 on the unit sphere, 0 in flat space. If it is negative,
    geodesics from the same point diverge.

    >>> import casadi as ca
    >>> import geodesic_ocp as go
    >>> class Globe(go.Metric):  # radius 2, in colatitude and longitude
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return 4.0 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))
    >>> round(go.sectional_curvature(Globe(), [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]), 12)
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
    """Scalar curvature at q: the sum of sectional curvatures over ordered pairs of basis vectors.

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
