"""Curvature of a metric, from exact derivatives of its tensor."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.manifold.metric import Metric, as_metric

# |u|^2 |v|^2 - <u, v>^2 of parallel vectors is rounding, below this share of |u|^2 |v|^2.
_PARALLEL = 1e-12


def riemann_curvature(
    metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike, w: ArrayLike, z: ArrayLike
) -> float:
    """The curvature tensor <R(u, v) w, z> at q on four tangent vectors (n,).

    R(u, v) w = D_u D_v w - D_v D_u w - D_[u, v] w with the Levi-Civita connection D, so that
    <R(u, v) v, u> is positive on a sphere (do Carmo, *Riemannian Geometry* (1992), chapter 4, has
    the opposite sign of R).

    Raises:
        ValueError: wrong shapes or values, or no metric at q.
    """
    q = as_metric(metric).point("q", q)
    vectors = zip("uvwz", (u, v, w, z), strict=True)
    return _form(metric, q, *(as_vector(name, vector, metric.dim) for name, vector in vectors))


def sectional_curvature(metric: Metric, q: ArrayLike, u: ArrayLike, v: ArrayLike) -> float:
    """Curvature <R(u, v) v, u> / (|u|^2 |v|^2 - <u, v>^2) of the plane of u and v (n,) at q.

    It depends on the plane alone: 1 on the unit sphere, 0 where space is flat. Where it is
    negative, geodesics that start together run apart.

    Raises:
        ValueError: wrong shapes or values, u and v are parallel, or there is no metric at q.
    """
    q = as_metric(metric).point("q", q)
    first, second = as_vector("u", u, metric.dim), as_vector("v", v, metric.dim)
    squares = metric.inner(q, first, first) * metric.inner(q, second, second)
    area = squares - metric.inner(q, first, second) ** 2
    if area <= _PARALLEL * squares:
        raise ValueError(f"u and v span no plane: u = {first}, v = {second}")
    return float(_form(metric, q, first, second, second, first) / area)


def scalar_curvature(metric: Metric, q: ArrayLike) -> float:
    """Scalar curvature at q: the sum of the sectional curvatures of all pairs of an orthonormal
    basis, each plane counted twice; 0 in one dimension.

    Raises:
        ValueError: q is not a point of the metric.
    """
    q = as_metric(metric).point("q", q)
    # The rows of L^-1 are orthonormal where G = L L'.
    basis = np.linalg.inv(np.linalg.cholesky(metric.matrix(q)))
    return sum((2.0 * _form(metric, q, u, v, v, u) for u, v in combinations(basis, 2)), start=0.0)


def _form(metric: Metric, *vectors: Array) -> float:
    return float(metric.curvature_form(*vectors))
